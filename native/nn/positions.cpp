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

/// `count` numbers from 0 to `last` in even steps, with the rounding of torch.linspace on x86
/// processors: pairs of runs of eight, each from where it begins, and the rest one by one; the
/// second half is counted from the end.
std::vector<float> evenSteps(size_t count, float last) {
  constexpr size_t kRun = 8;
  std::vector<float> steps(count, 0.0f);
  if (count < 2) return steps;
  const float step = last / static_cast<float>(count - 1);
  const auto at = [&](size_t i) {
    return i < count / 2 ? step * static_cast<float>(i)
                         : last - step * static_cast<float>(count - 1 - i);
  };
  const size_t in_runs = count / (2 * kRun) * (2 * kRun);
  for (size_t i = 0; i < count; ++i) {
    const bool is_in_run = i < in_runs;
    steps[i] = is_in_run ? at(i / kRun * kRun) + static_cast<float>(i % kRun) * step : at(i);
  }
  return steps;
}

std::vector<float> frequenciesOf(PositionEncoding encoding, size_t count) {
  constexpr float kLastExponent = 10;
  std::vector<float> frequencies(count);
  const std::vector<float> even = evenSteps(count, kLastExponent);
  for (size_t i = 0; i < count; ++i) {
    double exponent = static_cast<double>(even[i]);
    if (encoding == PositionEncoding::kPowers) {
      exponent = i < kWholePowers ? static_cast<double>(i)
                                  : 16.0 * static_cast<double>(i - kWholePowers) /
                                        static_cast<double>(count - kWholePowers);
    }
    frequencies[i] = static_cast<float>(std::exp2(exponent));
  }
  return frequencies;
}

/// The angle in float32, step by step as the released networks were trained with it: high
/// frequencies turn many times, so that the rounding of an angle is part of the encoding.
float angleOf(PositionEncoding encoding, float x, float frequency) {
  constexpr float kPi = std::numbers::pi_v<float>;
  if (encoding == PositionEncoding::kGeometric) return x * frequency * kPi;
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
  // In float32 as the released networks were trained: at t = 1000 the angle's rounding is 6e-5.
  const auto time = static_cast<float>(t);
  const auto decay = static_cast<float>(-std::log(longest));
  for (size_t i = 0; i < count; ++i) {
    const float exponent = decay * static_cast<float>(i) / static_cast<float>(count);
    const auto frequency = static_cast<float>(std::exp(static_cast<double>(exponent)));
    const auto angle = static_cast<double>(time * frequency);
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
