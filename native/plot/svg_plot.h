#pragma once

#include <string>

#include "plot/plot.h"

namespace stipple {

/// A sheet as SVG 1.1, without scripts or fonts of its own.
std::string svgOf(const PlotSheet& sheet);

/// Whether a text of at least 200 letters, or a whole file, begins as svgOf() writes.
bool isHeadOfSvgPlot(const std::string& head);

}  // namespace stipple
