// Based on: position encodings and rotations of the networks that nn/positions.h names.
#include "nn/positions.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 12;
constexpr size_t kAxes = 3;
constexpr size_t kWholePowers = 16;

std::vector<float> frequenciesOf(PositionEncoding encoding, size_t count) {
  std::vector<float> frequencies(count);
  for (size_t i = 0; i < count; ++i) {
    double exponent = 0.0;
    if (encoding == PositionEncoding::kGeometric) {
      if (count > 1) exponent = 10.0 * static_cast<double>(i) / static_cast<double>(count - 1);
    } else if (i < kWholePowers) {
      exponent = static_cast<double>(i);
    } else {
      exponent =
          16.0 * static_cast<double>(i - kWholePowers) / static_cast<double>(count - kWholePowers);
    }
    // The exponent too is a float32 number where the networks were trained.
    const auto rounded = static_cast<double>(static_cast<float>(exponent));
    frequencies[i] = static_cast<float>(std::exp2(rounded));
  }
  return frequencies;
}

/// The angle in float32, step by step as the released networks were trained with it: high
/// frequencies turn many times, so that the rounding of an angle is part of the encoding.
float angleOf(PositionEncoding encoding, float x, float frequency) {
  constexpr float kPi = std::numbers::pi_v<float>;
  if (encoding == PositionEncoding::kGeometric) return kPi * x * frequency;
  return x * frequency * 2.0f * kPi;
}

}  // namespace

void addPositions(PositionEncoding encoding, size_t rows, size_t width, const float* points,
                  float* out) {
  const std::vector<float> frequencies = frequenciesOf(encoding, width / (2 * kAxes));
  const size_t count = frequencies.size();
  const size_t grain = 1 + kGrain / std::max<size_t>(width, 1);
  parallelFor(rows, grain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      for (size_t axis = 0; axis < kAxes; ++axis) {
        float* sines = out + row * width + 2 * axis * count;
        float* cosines = sines + count;
        const float x = points[row * kAxes + axis];
        for (size_t i = 0; i < count; ++i) {
          const auto angle = static_cast<double>(angleOf(encoding, x, frequencies[i]));
          sines[i] += static_cast<float>(std::sin(angle));
          cosines[i] += static_cast<float>(std::cos(angle));
        }
      }
    }
  });
}

std::vector<float> timeEncoding(double t, double longest, size_t width) {
  const size_t count = width / 2;
  std::vector<float> encoding(2 * count);
  for (size_t i = 0; i < count; ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(count);
    const double angle = t * std::exp(-std::log(longest) * part);
    encoding[i] = static_cast<float>(std::cos(angle));
    encoding[count + i] = static_cast<float>(std::sin(angle));
  }
  return encoding;
}

void rotateHalves(const RotaryTable& table, size_t rows, size_t heads, size_t head_width,
                  float* values, size_t row_stride) {
  const size_t pairs = head_width / 2;
  const size_t grain = 1 + kGrain / std::max<size_t>(heads * head_width, 1);
  parallelFor(rows, grain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const float* cosines = table.cosines.data() + row * table.pairs;
      const float* sines = table.sines.data() + row * table.pairs;
      for (size_t head = 0; head < heads; ++head) {
        float* first = values + row * row_stride + head * head_width;
        float* second = first + pairs;
        for (size_t i = 0; i < pairs; ++i) {
          const float a = first[i], b = second[i];
          first[i] = a * cosines[i] - b * sines[i];
          second[i] = b * cosines[i] + a * sines[i];
        }
      }
    }
  });
}

void rotateAdjacent(const RotaryTable& table, size_t rows, size_t heads, size_t head_width,
                    float* values, size_t row_stride) {
  const size_t pairs = heads * (head_width / 2);
  const size_t grain = 1 + kGrain / std::max<size_t>(heads * head_width, 1);
  parallelFor(rows, grain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const float* cosines = table.cosines.data() + row * table.pairs;
      const float* sines = table.sines.data() + row * table.pairs;
      float* pair = values + row * row_stride;
      for (size_t i = 0; i < pairs; ++i, pair += 2) {
        const float a = pair[0], b = pair[1];
        pair[0] = a * cosines[i] - b * sines[i];
        pair[1] = a * sines[i] + b * cosines[i];
      }
    }
  });
}

}  // namespace stipple
