#include "nn/max_pool.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"

namespace stipple {

FeatureMap maxPool(const NetworkRun& run, const FeatureMap& map, size_t window, size_t stride) {
  if (window == 0 || stride == 0 || map.height < window || map.width < window) {
    fail(ErrorCode::kInvalidArgument, "A map of " + sizeText(map.width, map.height) +
                                          " pixels has no windows of " + std::to_string(window) +
                                          " pixels that are " + std::to_string(stride) + " apart.");
  }
  FeatureMap out = FeatureMap::ofSize((map.height - window) / stride + 1,
                                      (map.width - window) / stride + 1, map.channels);
  const size_t channels = map.channels;
  parallelFor(out.height, 4, [&](size_t begin, size_t end) {
    if (run.progress != nullptr) run.progress->throwIfCancelled();
    for (size_t y = begin; y < end; ++y) {
      for (size_t x = 0; x < out.width; ++x) {
        float* to = out.values.data() + (y * out.width + x) * channels;
        for (size_t k = 0; k < window * window; ++k) {
          const size_t row = y * stride + k / window, column = x * stride + k % window;
          const float* from = map.values.data() + (row * map.width + column) * channels;
          if (k == 0) std::copy_n(from, channels, to);
          for (size_t c = 0; c < channels; ++c) to[c] = std::max(to[c], from[c]);
        }
      }
    }
  });
  return out;
}

}  // namespace stipple
