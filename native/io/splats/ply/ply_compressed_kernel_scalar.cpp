#include "io/splats/ply/ply_compressed_kernel.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "io/splats/quantize.h"

namespace stipple {

namespace {

void decodeScalar(const PlyChunkBits& bits, const PlyChunkRange& range, const PlyChunkTarget& out) {
  const auto spread = [&range](size_t lowest, uint32_t steps, uint32_t last) {
    const double low = static_cast<double>(range[lowest]);
    const double step = (static_cast<double>(range[lowest + 3]) - low) / last;
    return low + static_cast<double>(steps) * step;
  };
  for (size_t i = 0; i < kPlyChunkSplats; ++i) {
    float* position = out.positions + i * 3;
    position[0] = static_cast<float>(spread(0, bits[0][i] >> 21, 2047));
    position[1] = static_cast<float>(spread(1, bits[0][i] >> 11 & 1023, 1023));
    position[2] = static_cast<float>(spread(2, bits[0][i] & 2047, 2047));
    std::array<double, 3> stored;
    for (unsigned k = 0; k < 3; ++k) {
      const double steps = bits[1][i] >> (20 - 10 * k) & 1023;
      stored[k] = (steps * (1.0 / 1023.0) - 0.5) * 1.4142135623730951;
    }
    const double squares = stored[2] * stored[2] + stored[1] * stored[1] + stored[0] * stored[0];
    const double length = std::sqrt(std::max(1.0, squares));
    float* q = out.rotations + i * 4;
    const size_t largest = bits[1][i] >> 30;
    q[largest] = static_cast<float>(std::sqrt(std::max(0.0, 1.0 - squares)));
    for (size_t k = 0, next = 0; k < 4; ++k) {
      if (k != largest) q[k] = static_cast<float>(stored[next++] / length);
    }
    out.opacities[i] = static_cast<float>(bits[3][i] & 255) / 255.0f;
    for (unsigned k = 0; k < 3; ++k) {
      const double colour = spread(12 + k, bits[3][i] >> (24 - 8 * k) & 255, 255);
      (*out.harmonics)[k][i] = static_cast<float>((colour - 0.5) * (1.0 / kPlyChunkC0));
    }
  }
}

void decodeHarmonicsScalar(const PlyHarmonicRows& rows, float* sh) {
  std::array<float, 256> values;
  for (size_t byte = 0; byte < 256; ++byte) {
    values[byte] = static_cast<float>(plyHarmonicOf(static_cast<uint8_t>(byte)));
  }
  for (size_t i = 0; i < rows.count; ++i) {
    float* out = sh + i * (3 + rows.row_bytes) + 3;
    const uint8_t* row = rows.bytes + i * rows.row_bytes;
    for (size_t k = 0; k < rows.row_bytes; ++k) out[k] = values[row[rows.from[k]]];
  }
}

bool areValid(const PlyChunkValues& values) {
  bool valid = true;
  for (size_t i = 0; i < kPlyChunkSplats; ++i) {
    for (const auto& attribute : values.ranged) valid = valid && std::isfinite(attribute[i]);
    for (size_t k = 3; k < 6; ++k) valid = valid && values.ranged[k][i] >= 0;
    valid = valid && values.opacity[i] >= 0 && values.opacity[i] <= 1;
    bool is_zero = true;
    for (const auto& part : values.rotation) {
      valid = valid && std::isfinite(part[i]);
      is_zero = is_zero && part[i] == 0;
    }
    valid = valid && !is_zero;
  }
  return valid;
}

uint32_t packRotation(const PlyChunkValues& values, size_t i) {
  size_t largest = 0;
  double squares = 0;
  for (size_t k = 0; k < 4; ++k) {
    const auto part = static_cast<double>(values.rotation[k][i]);
    squares += part * part;
    if (std::abs(values.rotation[k][i]) > std::abs(values.rotation[largest][i])) largest = k;
  }
  const double size = 0.7071067811865476 / std::sqrt(squares);
  const double factor = values.rotation[largest][i] < 0 ? -size : size;
  auto packed = static_cast<uint32_t>(largest);
  for (size_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    const double part = static_cast<double>(values.rotation[k][i]) * factor;
    packed = packed << 10 | nearestStep((part + 0.5) * 1023.0, 1023);
  }
  return packed;
}

/// Steps of attribute k, added to the words at their place.
void quantise(const PlyChunkValues& values, size_t k, PlyChunkRange& range, PlyChunkBits& bits) {
  constexpr std::array<unsigned, 9> kShifts = {21, 11, 0, 21, 11, 0, 24, 16, 8};
  constexpr std::array<uint32_t, 3> kWords = {0, 2, 3};
  std::array<double, kPlyChunkSplats> mapped;
  float low = std::numeric_limits<float>::max();
  float high = std::numeric_limits<float>::lowest();
  for (size_t i = 0; i < kPlyChunkSplats; ++i) {
    const auto value = static_cast<double>(values.ranged[k][i]);
    mapped[i] = k < 3   ? value
                : k < 6 ? std::clamp(std::log(std::max(value, 1e-10)), -kPlyLogLimit, kPlyLogLimit)
                        : value * kPlyChunkC0 + 0.5;
    low = std::min(low, static_cast<float>(mapped[i]));
    high = std::max(high, static_cast<float>(mapped[i]));
  }
  const size_t place = k / 3 * 6 + k % 3;
  range[place] = low;
  range[place + 3] = high;
  const uint32_t last = k >= 6 ? 255 : k % 3 == 1 ? 1023 : 2047;
  const double extent = static_cast<double>(high) - static_cast<double>(low);
  const double to_steps = extent > 0 ? last / extent : 0.0;
  for (size_t i = 0; i < kPlyChunkSplats; ++i) {
    const uint32_t steps = nearestStep((mapped[i] - static_cast<double>(low)) * to_steps, last);
    bits[kWords[k / 3]][i] |= steps << kShifts[k];
  }
}

bool encodeScalar(const PlyChunkValues& values, PlyChunkRange& range, PlyChunkBits& bits) {
  if (!areValid(values)) return false;
  bits[0].fill(0);
  bits[2].fill(0);
  for (size_t i = 0; i < kPlyChunkSplats; ++i) {
    bits[1][i] = packRotation(values, i);
    bits[3][i] = nearestStep(static_cast<double>(values.opacity[i]) * 255.0, 255);
  }
  for (size_t k = 0; k < 9; ++k) quantise(values, k, range, bits);
  return true;
}

/// Bytes whose middles or ends (plyHarmonicOf) are nearest to the values. 32 v + 128 counts in
/// parts; taken apart, so that float32 has room for it.
bool encodeHarmonicsScalar(const PlyHarmonicSources& sources, uint8_t* bytes) {
  // Below this a value does not move the sum of a double: it counts as 0.
  constexpr float kNothing = 0x1p-47f;
  for (size_t i = 0; i < sources.count; ++i) {
    for (size_t k = 0; k < 3 + sources.numbers; ++k) {
      const float value = sources.rows[i][k];
      if (!std::isfinite(value)) return false;
      if (k < 3) continue;
      const float parts = std::clamp(value * 32.0f, -128.0f, 128.0f);
      const auto whole = static_cast<int32_t>(parts);  // towards 0
      const bool is_below = parts < static_cast<float>(whole) && parts < -kNothing;
      const int32_t middle = std::clamp(whole - (is_below ? 1 : 0) + 128, 1, 254);
      // The bytes at the ends stand for the ends and not for the middle of their part.
      bytes[i * sources.numbers + sources.to[k - 3]] =
          static_cast<uint8_t>(parts <= -127.25f  ? 0
                               : parts >= 127.25f ? 255
                                                  : middle);
    }
  }
  return true;
}

}  // namespace

PlyChunkKernel plainPlyChunkKernel() {
  return {"scalar", decodeScalar, decodeHarmonicsScalar, encodeScalar, encodeHarmonicsScalar};
}

}  // namespace stipple
