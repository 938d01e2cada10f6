#pragma once

#include <array>

namespace stipple {

/// TrueType fonts with printable ASCII alone, which images of plots are lettered with. They lie in
/// the library because no machine has to have a font, and 19 KiB hold both.
extern const std::array<unsigned char, 10636> kSansRegular;
extern const std::array<unsigned char, 8732> kSansBold;

}  // namespace stipple
