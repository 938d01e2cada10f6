#include "train/networks/example_gradients.h"

#include <algorithm>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

}  // namespace

size_t examplesAtOnce(size_t count) {
  return std::max<size_t>(1, std::min(count, threadLimit()));
}

void ExampleGradients::sum(size_t count, std::span<float> gradients,
                           const std::function<void(size_t, std::span<float>)>& add) {
  std::fill(gradients.begin(), gradients.end(), 0.0f);
  const size_t most = examplesAtOnce(count);
  own_.resize(most);
  for (size_t first = 0; first < count; first += most) {
    const size_t at_once = std::min(most, count - first);
    // The first one needs no room of its own: nothing is before it.
    const size_t begin_own = first == 0 ? 1 : 0;
    parallelFor(at_once, 1, [&](size_t i, size_t) {
      if (i < begin_own) return add(first + i, gradients);
      own_[i].assign(gradients.size(), 0.0f);
      add(first + i, own_[i]);
    });
    parallelFor(gradients.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin_own; i < at_once; ++i) {
        const float* const from = own_[i].data();
        for (size_t at = begin; at < end; ++at) gradients[at] += from[at];
      }
    });
  }
}

}  // namespace stipple
