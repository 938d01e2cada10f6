#pragma once

#include <cstdint>

#include "plot/plot.h"

namespace stipple::api {

/// A sheet as an image in the caller's buffer. In: pixels, or null for its size alone. Errors:
/// kInvalidArgument for a null width or height and a scale out of range; kBufferTooSmall, with the
/// size set.
void deliverPlot(const PlotSheet& sheet, double scale, uint64_t capacity, float* pixels,
                 uint32_t* width, uint32_t* height);

}  // namespace stipple::api
