#include "bench/plain_unpack.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "base/parallel.h"
#include "math/morton.h"

namespace stipple::bench {

namespace {

constexpr size_t kChunk = 256;
constexpr size_t kChunkBytes = 18 * sizeof(float);
constexpr size_t kVertexBytes = 16;
constexpr size_t kTaskChunks = 32;
constexpr size_t kRecordBytes = 32;
constexpr size_t kBlockRows = 8192;
constexpr float kC0 = 0.28209479f;

float* floats(PlainBytes& bytes) {
  return reinterpret_cast<float*>(bytes.data());
}

/// Where the parts of a compressed PLY begin.
struct Places {
  Places(size_t file_bytes, size_t count, size_t rest)
      : harmonics(file_bytes - count * rest),
        vertices(harmonics - count * kVertexBytes),
        chunks(vertices - (count + kChunk - 1) / kChunk * kChunkBytes) {}
  size_t harmonics, vertices, chunks;
};

void unpackRotation(uint32_t packed, float* q) {
  const float a = (static_cast<float>(packed >> 20 & 1023) / 1023.0f - 0.5f) * 1.41421356f;
  const float b = (static_cast<float>(packed >> 10 & 1023) / 1023.0f - 0.5f) * 1.41421356f;
  const float c = (static_cast<float>(packed & 1023) / 1023.0f - 0.5f) * 1.41421356f;
  const float d = std::sqrt(std::max(0.0f, 1.0f - a * a - b * b - c * c));
  const uint32_t largest = packed >> 30;
  q[0] = largest == 0 ? d : a;
  q[1] = largest == 0 ? a : largest == 1 ? d : b;
  q[2] = largest <= 1 ? b : largest == 2 ? d : c;
  q[3] = largest == 3 ? d : c;
}

uint32_t packRotation(const float* q) {
  uint32_t largest = 0;
  for (uint32_t k = 1; k < 4; ++k) {
    if (std::abs(q[k]) > std::abs(q[largest])) largest = k;
  }
  const float factor = q[largest] < 0 ? -723.37f : 723.37f;  // 1023 / sqrt(2)
  uint32_t packed = largest;
  for (uint32_t k = 0; k < 4; ++k) {
    if (k != largest) packed = packed << 10 | static_cast<uint32_t>(q[k] * factor + 512.0f);
  }
  return packed;
}

uint32_t step(float value, float low, float to_steps) {
  return static_cast<uint32_t>((value - low) * to_steps + 0.5f);
}

uint8_t byteOf(float value) {
  return static_cast<uint8_t>(std::clamp(value, 0.0f, 255.0f) + 0.5f);
}

}  // namespace

PlainArrays::PlainArrays(size_t count, size_t sh_stride)
    : positions(count * 3 * sizeof(float)),
      rotations(count * 4 * sizeof(float)),
      scales(count * 3 * sizeof(float)),
      opacities(count * sizeof(float)),
      sh(count * sh_stride * sizeof(float)) {}

PlainArrays unpackCompressedPly(const PlainBytes& file, size_t count, int degree) {
  const size_t stride = shCoefficientCount(degree) * 3;
  const size_t rest = stride - 3;
  const Places places(file.size(), count, rest);
  PlainArrays out(count, stride);
  parallelFor(count, kTaskChunks * kChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::array<float, 18> range;
      std::memcpy(range.data(), &file[places.chunks + i / kChunk * kChunkBytes], kChunkBytes);
      std::array<uint32_t, 4> packed;
      std::memcpy(packed.data(), &file[places.vertices + i * kVertexBytes], kVertexBytes);
      const auto three = [&range](uint32_t bits, size_t at, float* to) {
        const auto between = [&](size_t k, uint32_t value, float last) {
          to[k] = range[at + k] +
                  (range[at + k + 3] - range[at + k]) * (static_cast<float>(value) * (1.0f / last));
        };
        between(0, bits >> 21, 2047.0f);
        between(1, bits >> 11 & 1023, 1023.0f);
        between(2, bits & 2047, 2047.0f);
      };
      three(packed[0], 0, floats(out.positions) + i * 3);
      three(packed[2], 6, floats(out.scales) + i * 3);
      unpackRotation(packed[1], floats(out.rotations) + i * 4);
      float* sh = floats(out.sh) + i * stride;
      for (size_t k = 0; k < 3; ++k) {
        const float share = static_cast<float>(packed[3] >> (24 - 8 * k) & 255) * (1.0f / 255.0f);
        sh[k] = (range[12 + k] + (range[15 + k] - range[12 + k]) * share - 0.5f) * (1.0f / kC0);
      }
      floats(out.opacities)[i] = static_cast<float>(packed[3] & 255) * (1.0f / 255.0f);
      const auto* bytes = reinterpret_cast<const uint8_t*>(&file[places.harmonics]) + i * rest;
      const size_t per_colour = rest / 3;
      for (size_t k = 0; k < per_colour; ++k) {
        for (size_t c = 0; c < 3; ++c) {
          const float byte = static_cast<float>(bytes[c * per_colour + k]);
          sh[3 + k * 3 + c] = byte * (8.0f / 256.0f) - 3.984375f;
        }
      }
    }
  });
  return out;
}

PlainBytes packCompressedPly(const SplatCloud& cloud, size_t file_bytes) {
  const size_t count = cloud.size();
  const size_t stride = cloud.shStride();
  const size_t rest = stride - 3;
  const Places places(file_bytes, count, rest);
  PlainBytes file(file_bytes);
  std::memset(file.data(), ' ', places.chunks);
  parallelFor(count, kChunk, [&](size_t begin, size_t end) {
    std::array<float, 18> range;
    std::array<float, 9> to_steps;
    const float* from[3] = {&cloud.positions[begin * 3], &cloud.scales[begin * 3],
                            &cloud.sh[begin * stride]};
    const size_t strides[3] = {3, 3, stride};
    for (size_t k = 0; k < 9; ++k) {
      const float* values = from[k / 3] + k % 3;
      float low = values[0], high = values[0];
      for (size_t i = 1; i < end - begin; ++i) {
        low = std::min(low, values[i * strides[k / 3]]);
        high = std::max(high, values[i * strides[k / 3]]);
      }
      range[k / 3 * 6 + k % 3] = low;
      range[k / 3 * 6 + k % 3 + 3] = high;
      const float last = k >= 6 ? 255.0f : k % 3 == 1 ? 1023.0f : 2047.0f;
      to_steps[k] = high > low ? last / (high - low) : 0.0f;
    }
    std::memcpy(file.data() + places.chunks + begin / kChunk * kChunkBytes, range.data(),
                kChunkBytes);
    for (size_t i = begin; i < end; ++i) {
      std::array<uint32_t, 9> steps;
      for (size_t k = 0; k < 9; ++k) {
        steps[k] = step(from[k / 3][(i - begin) * strides[k / 3] + k % 3], range[k / 3 * 6 + k % 3],
                        to_steps[k]);
      }
      const std::array<uint32_t, 4> packed = {
          steps[0] << 21 | steps[1] << 11 | steps[2], packRotation(&cloud.rotations[i * 4]),
          steps[3] << 21 | steps[4] << 11 | steps[5],
          steps[6] << 24 | steps[7] << 16 | steps[8] << 8 | byteOf(cloud.opacities[i] * 255.0f)};
      std::memcpy(file.data() + places.vertices + i * kVertexBytes, packed.data(), kVertexBytes);
      const float* sh = &cloud.sh[i * stride + 3];
      auto* bytes = reinterpret_cast<uint8_t*>(file.data() + places.harmonics) + i * rest;
      const size_t per_colour = rest / 3;
      for (size_t c = 0; c < 3; ++c) {
        for (size_t k = 0; k < per_colour; ++k) {
          bytes[c * per_colour + k] = byteOf(sh[k * 3 + c] * 32.0f + 127.5f);
        }
      }
    }
  });
  return file;
}

std::vector<std::pair<uint64_t, uint32_t>> sortPlainly(const SplatCloud& cloud) {
  const auto [low, high] = std::minmax_element(cloud.positions.begin(), cloud.positions.end());
  const float to_cells = 2097151.0f / std::max(*high - *low, 1e-30f);
  std::vector<std::pair<uint64_t, uint32_t>> keys(cloud.size());
  for (size_t i = 0; i < cloud.size(); ++i) {
    const auto cell = [&](size_t k) {
      return static_cast<uint32_t>((cloud.positions[i * 3 + k] - *low) * to_cells);
    };
    keys[i] = {mortonEncode(cell(0), cell(1), cell(2)), static_cast<uint32_t>(i)};
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

PlainArrays unpackSplat32(const PlainBytes& file) {
  const size_t count = file.size() / kRecordBytes;
  PlainArrays out(count, 3);
  parallelFor(count, kBlockRows, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const char* record = &file[i * kRecordBytes];
      std::memcpy(floats(out.positions) + i * 3, record, 12);
      std::memcpy(floats(out.scales) + i * 3, record + 12, 12);
      const auto* bytes = reinterpret_cast<const uint8_t*>(record + 24);
      for (size_t k = 0; k < 3; ++k) {
        floats(out.sh)[i * 3 + k] = static_cast<float>(bytes[k]) * (1 / (255 * kC0)) - 0.5f / kC0;
      }
      floats(out.opacities)[i] = static_cast<float>(bytes[3]) * (1.0f / 255.0f);
      for (size_t k = 0; k < 4; ++k) {
        floats(out.rotations)[i * 4 + k] = static_cast<float>(bytes[4 + k]) * (1 / 128.0f) - 1.0f;
      }
    }
  });
  return out;
}

PlainBytes packSplat32(const SplatCloud& cloud) {
  const size_t stride = cloud.shStride();
  PlainBytes file(cloud.size() * kRecordBytes);
  parallelFor(cloud.size(), kBlockRows, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      char* record = file.data() + i * kRecordBytes;
      std::memcpy(record, &cloud.positions[i * 3], 12);
      std::memcpy(record + 12, &cloud.scales[i * 3], 12);
      auto* bytes = reinterpret_cast<uint8_t*>(record + 24);
      for (size_t k = 0; k < 3; ++k) {
        bytes[k] = byteOf(cloud.sh[i * stride + k] * (255 * kC0) + 127.5f);
      }
      bytes[3] = byteOf(cloud.opacities[i] * 255.0f);
      for (size_t k = 0; k < 4; ++k) {
        bytes[4 + k] = byteOf(cloud.rotations[i * 4 + k] * 128.0f + 128.0f);
      }
    }
  });
  return file;
}

}  // namespace stipple::bench
