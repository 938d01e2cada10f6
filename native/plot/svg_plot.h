#pragma once

#include <string>

#include "plot/plot.h"

namespace stipple {

/// A sheet as SVG 1.1, without scripts or fonts of its own.
std::string svgOf(const PlotSheet& sheet);

}  // namespace stipple
