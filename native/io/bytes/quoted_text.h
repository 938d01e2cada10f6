#pragma once

#include <string>

namespace stipple {

/// A text between double quotes, as JSON and layers of USD have it: quotes and backslashes of its
/// own with a backslash before them, control characters as blanks.
std::string quotedText(const std::string& text);

}  // namespace stipple
