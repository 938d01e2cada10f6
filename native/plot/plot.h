#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace stipple {

/// A curve. Points that are not finite (or not positive on a logarithmic axis) are left out.
struct PlotLine {
  std::string label;  ///< in the legend; empty: none
  std::vector<double> x;
  std::vector<double> y;
  bool is_faint = false;     ///< behind the others
  bool has_markers = false;  ///< a dot at each point
  bool has_stroke = true;    ///< through the points
  /// [x.size()] beside each point, where there is room; or empty.
  std::vector<std::string> names;
};

struct PlotPanel {
  std::string title;
  std::string x_label;
  std::string y_label;
  bool x_is_logarithmic = false;
  bool y_is_logarithmic = false;
  bool y_starts_at_zero = false;
  std::vector<PlotLine> lines;
};

enum class TextAnchor { kStart, kMiddle, kEnd };

/// One thing that is drawn. Positions and lengths in units of the sheet, y downwards.
struct PlotMark {
  enum class Kind { kStroke, kDot, kBox, kText };
  Kind kind = Kind::kStroke;
  std::vector<std::array<double, 2>> points;  ///< of a stroke; two corners of a box; a place
  uint32_t colour = 0;                        ///< 0xRRGGBB, display sRGB
  double opacity = 1;
  double size = 1;         ///< width of a stroke, radius of a dot, height of a line of text
  bool is_bold = false;    ///< text
  bool is_upright = true;  ///< text; false: runs upwards
  TextAnchor anchor = TextAnchor::kStart;
  std::string text;
};

/// Marks in the order in which they cover each other, on white.
struct PlotSheet {
  double width = 0;
  double height = 0;
  std::vector<PlotMark> marks;
};

struct PanelSize {
  double width = 480;
  double height = 320;
};

/// Panels side by side, two in a row, with axes, ticks and legends. A panel without a point to show
/// says so.
PlotSheet sheetOf(const std::vector<PlotPanel>& panels, PanelSize size = {});

}  // namespace stipple
