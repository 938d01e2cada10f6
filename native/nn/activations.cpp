#include "nn/activations.h"

#include <algorithm>

#include "base/parallel.h"
#include "nn/kernels/layer_kernel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

}  // namespace

void activate(Activation activation, std::span<float> values) {
  const LayerKernel& kernel = chosenLayerKernel();
  parallelFor(values.size(), kGrain, [&](size_t begin, size_t end) {
    kernel.activate(activation, end - begin, values.data() + begin);
  });
}

void activateBackward(Activation activation, std::span<const float> in, std::span<float> gradient) {
  const LayerKernel& kernel = chosenLayerKernel();
  parallelFor(gradient.size(), kGrain, [&](size_t begin, size_t end) {
    kernel.scaleBySlope(activation, end - begin, in.data() + begin, gradient.data() + begin);
  });
}

void siluGate(size_t count, const float* gate, const float* up, float* out) {
  const LayerKernel& kernel = chosenLayerKernel();
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    kernel.siluGate(end - begin, gate + begin, up + begin, out + begin);
  });
}

void addScaled(size_t rows, size_t width, std::span<const float> factor, const float* y, float* x) {
  const size_t grain = 1 + kGrain / std::max<size_t>(width, 1);
  parallelFor(rows, grain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const float* from = y + row * width;
      float* to = x + row * width;
      if (factor.empty()) {
        for (size_t i = 0; i < width; ++i) to[i] += from[i];
      } else {
        for (size_t i = 0; i < width; ++i) to[i] += factor[i] * from[i];
      }
    }
  });
}

}  // namespace stipple
