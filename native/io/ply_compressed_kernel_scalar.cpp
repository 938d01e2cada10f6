#include <algorithm>
#include <cmath>

#include "io/ply_compressed_kernel.h"

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

}  // namespace

PlyChunkKernel plainPlyChunkKernel() {
  return {"scalar", decodeScalar, decodeHarmonicsScalar};
}

}  // namespace stipple
