#pragma once

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

/// Panels side by side, two in a row, as one picture with axes, ticks and legends: SVG 1.1, black
/// on white, without scripts or fonts of its own. A panel without a point to show says so.
std::string svgOf(const std::vector<PlotPanel>& panels);

}  // namespace stipple
