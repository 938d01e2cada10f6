#include "nn/training/rotary_backward.h"

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

}  // namespace

void rotateAdjacentBackward(const RotaryTable& table, size_t rows, size_t heads, size_t head_width,
                            const float* rotated, size_t rotated_stride, float* gradient,
                            size_t gradient_stride, std::span<float> by_angles) {
  const size_t pairs = heads * head_width / 2;
  parallelFor(rows, 1 + kGrain / (pairs + 1), [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const float* made = rotated + row * rotated_stride;
      float* by = gradient + row * gradient_stride;
      for (size_t pair = 0; pair < pairs; ++pair) {
        const float cosine = table.cosines[row * pairs + pair];
        const float sine = table.sines[row * pairs + pair];
        const float first = by[2 * pair], second = by[2 * pair + 1];
        by_angles[row * pairs + pair] += second * made[2 * pair] - first * made[2 * pair + 1];
        by[2 * pair] = first * cosine + second * sine;
        by[2 * pair + 1] = second * cosine - first * sine;
      }
    }
  });
}

}  // namespace stipple
