#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace stipple {

/// A line of text in an image. Its font is DejaVu Sans; printable ASCII, other characters are drawn
/// as '?'.
struct OutlinedText {
  std::string text;
  double size_px = 0;  ///< of the em square, as the font-size of SVG
  double x = 0;        ///< pixels, where the baseline starts
  double y = 0;
  bool is_bold = false;
  bool is_upright = true;  ///< false: runs upwards
};

/// Length of its baseline, pixels.
double lengthOf(const OutlinedText& text);

/// How much of a pixel the letters cover, 0..1, for every pixel that they touch, letter by letter;
/// pixels may lie outside the image.
using VisitCovered = std::function<void(int x, int y, float share)>;
void coverText(const OutlinedText& text, const VisitCovered& visit);

}  // namespace stipple
