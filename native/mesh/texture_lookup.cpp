#include "mesh/texture_lookup.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "math/colour.h"

namespace stipple {

namespace {

constexpr int kTableSize = 4096;

/// srgbToLinear at i / kTableSize, i = 0..kTableSize. Read with linear interpolation its error is
/// below max|f''| / (8 kTableSize^2) = 1e-8 (f'' <= 1.4 on the power segment).
const std::vector<float>& linearTable() {
  static const std::vector<float> table = [] {
    std::vector<float> values(kTableSize + 1);
    for (int i = 0; i <= kTableSize; ++i) {
      values[static_cast<size_t>(i)] =
          static_cast<float>(srgbToLinear(static_cast<double>(i) / kTableSize));
    }
    return values;
  }();
  return table;
}

float toLinear(const std::vector<float>& table, float value) {
  if (value < 0 || value >= 1) return srgbToLinear(value);
  const float scaled = value * kTableSize;
  const int cell = static_cast<int>(scaled);
  const float fraction = scaled - static_cast<float>(cell);
  const float low = table[static_cast<size_t>(cell)];
  return low + fraction * (table[static_cast<size_t>(cell) + 1] - low);
}

/// Texel pair and weight of a coordinate in periods of the picture.
struct Tap {
  uint32_t low;
  uint32_t high;
  float weight;  ///< of `high`
};

Tap wrappedTap(float coordinate, uint32_t size) {
  // In double: the fraction of a large coordinate keeps its texel.
  const double wrapped =
      static_cast<double>(coordinate) - std::floor(static_cast<double>(coordinate));
  const double texel = wrapped * size - 0.5;
  const double base = std::floor(texel);
  const auto low = static_cast<int64_t>(base);
  const auto period = static_cast<int64_t>(size);
  return {static_cast<uint32_t>((low + period) % period), static_cast<uint32_t>((low + 1) % period),
          static_cast<float>(texel - base)};
}

}  // namespace

TextureLookup::TextureLookup(const Image& image) : image_(&image) {}

std::array<float, 4> TextureLookup::at(float u, float v) const {
  const Tap x = wrappedTap(u, image_->width);
  const Tap y = wrappedTap(1.0f - v, image_->height);
  const std::vector<float>& table = linearTable();
  const size_t channels = image_->channels;
  const size_t columns[2] = {x.low, x.high};
  const size_t rows[2] = {y.low, y.high};
  const float weights[4] = {(1 - x.weight) * (1 - y.weight), x.weight * (1 - y.weight),
                            (1 - x.weight) * y.weight, x.weight * y.weight};
  std::array<float, 4> sum = {0, 0, 0, 0};
  for (size_t tap = 0; tap < 4; ++tap) {
    const float* texel =
        &image_->pixels[(rows[tap / 2] * image_->width + columns[tap % 2]) * channels];
    for (size_t c = 0; c < 3; ++c) {
      const float value = texel[channels == 1 ? 0 : c];
      sum[c] +=
          weights[tap] * (image_->transfer == Transfer::kSrgb ? toLinear(table, value) : value);
    }
    sum[3] += weights[tap] * (channels == 4 ? texel[3] : 1.0f);
  }
  return sum;
}

}  // namespace stipple
