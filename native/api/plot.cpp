#include "api/plot.h"

#include <algorithm>
#include <string>

#include "api/guard.h"
#include "plot/plot_image.h"

namespace stipple::api {

void deliverPlot(const PlotSheet& sheet, double scale, uint64_t capacity, float* pixels,
                 uint32_t* width, uint32_t* height) {
  const uint64_t count = uint64_t{4} * (require(width, "width") = plotPixels(sheet.width, scale)) *
                         (require(height, "height") = plotPixels(sheet.height, scale));
  if (!pixels) return;
  if (capacity < count) {
    fail(ErrorCode::kBufferTooSmall, "capacity is " + std::to_string(capacity) +
                                         " floats; the image needs " + std::to_string(count));
  }
  const Image image = imageOf(sheet, scale);
  std::copy(image.pixels.begin(), image.pixels.end(), pixels);
}

}  // namespace stipple::api
