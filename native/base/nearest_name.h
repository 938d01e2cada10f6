#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace stipple {

/// How many letters have to be added, left out or replaced to make one text of the other.
size_t editDistance(std::string_view a, std::string_view b);

/// The known name that a mistyped one is most likely meant to be: that of the least distance, the
/// first of several; empty where none shares half of its letters with it.
std::string nearestName(std::string_view name, std::span<const std::string> known);

}  // namespace stipple
