#pragma once

#include <array>
#include <string>
#include <vector>

namespace stipple {

using PenStroke = std::vector<std::array<double, 2>>;

/// Height of a capital letter in units of the font; its baseline is y = 0, y upwards.
inline constexpr double kCapHeight = 7;

/// Width of a text, from the left end of its first letter to the right end of its last.
double penWidth(const std::string& text);

/// Centre lines of the strokes of a text that starts at x = 0. A stroke of one point is a dot.
/// Printable ASCII; other bytes are drawn as '?'.
std::vector<PenStroke> penStrokes(const std::string& text);

}  // namespace stipple
