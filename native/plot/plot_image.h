#pragma once

#include "data/images/image.h"
#include "plot/plot.h"

namespace stipple {

/// Pixels along one side. In: scale, pixels of a unit of the sheet.
uint32_t plotPixels(double units, double scale);

/// A sheet as an image [height,width,4], display sRGB, opaque, smooth edges. Text is lettered in
/// the library's own copy of DejaVu Sans (text_outlines.h): no font file is needed. Errors:
/// kInvalidArgument for a scale outside 0.25..8. The same bits everywhere, on the calling thread.
Image imageOf(const PlotSheet& sheet, double scale);

}  // namespace stipple
