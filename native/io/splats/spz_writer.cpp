// Based on: the SPZ format, github.com/nianticlabs/spz, README (layout and quantities). Differs:
// the number of fractional bits follows the size of the scene.
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/compression.h"
#include "io/bytes/little_endian.h"
#include "io/bytes/output_file.h"
#include "io/splats/quantize.h"
#include "io/splats/spz_file.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 8192;
// Levels that the format's own writer uses.
constexpr int kGzipLevel = 6;
constexpr int kZstdLevel = 12;
// Harmonics are rounded to steps of 8/128 (degree 1) and 16/128 (above), as other writers of the
// format do: what makes these files small.
constexpr int kFirstDegreeStep = 8;
constexpr int kHigherDegreeStep = 16;
// Positions are 24-bit numbers with a sign.
constexpr double kLargestFixed = 8388607.0;

/// Fractional bits of positions: a step of at most 1/4096 and at most 1/65536 of the largest
/// coordinate, where 24 bits have room for it.
int fractionalBits(const SplatCloud& cloud) {
  float largest = 0;
  for (const float value : cloud.positions) largest = std::max(largest, std::abs(value));
  if (largest == 0.0f) return 12;
  const int wanted = std::clamp(16 - std::ilogb(largest), 12, 30);
  const auto fits = [&](int bits) {
    return std::nearbyint(std::ldexp(static_cast<double>(largest), bits)) <= kLargestFixed;
  };
  for (int bits = wanted; bits >= 0; --bits) {
    if (fits(bits)) return bits;
  }
  fail(ErrorCode::kUnsupported, "a position of the cloud is " + std::to_string(largest) +
                                    "; SPZ holds coordinates up to 8388607");
}

uint8_t harmonicByte(float value, size_t coefficient) {
  const int step = coefficient < 4 ? kFirstDegreeStep : kHigherDegreeStep;
  const double steps = (static_cast<double>(value) * 128.0 + 128.0) / step;
  return static_cast<uint8_t>(std::min(
      nearestStep(steps, 256 / static_cast<uint32_t>(step)) * static_cast<uint32_t>(step), 255u));
}

uint32_t smallestThree(const float* q) {
  // Order of the format: x, y, z, w.
  const std::array<float, 4> xyzw = {q[1], q[2], q[3], q[0]};
  size_t largest = 0;
  for (size_t k = 1; k < 4; ++k) {
    if (std::abs(xyzw[k]) > std::abs(xyzw[largest])) largest = k;
  }
  double squares = 0;
  for (const float value : xyzw) squares += static_cast<double>(value) * static_cast<double>(value);
  const double to_steps = 511.0 * std::sqrt(2.0) / std::sqrt(squares);
  const bool turned = xyzw[largest] < 0;
  uint32_t packed = static_cast<uint32_t>(largest);
  for (size_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    const uint32_t magnitude = nearestStep(std::abs(static_cast<double>(xyzw[k])) * to_steps, 511);
    packed = packed << 10 | ((xyzw[k] < 0) != turned ? 512u : 0u) | magnitude;
  }
  return packed;
}

std::array<ByteVector, kSpzArrayCount> encode(const SplatCloud& cloud, int bits) {
  std::array<ByteVector, kSpzArrayCount> arrays;
  for (size_t a = 0; a < kSpzArrayCount; ++a) {
    arrays[a].resize(cloud.size() * spzBytesPerSplat(a, 3, cloud.sh_degree));
  }
  const size_t stride = cloud.shStride();
  const double to_fixed = std::ldexp(1.0, bits);
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin * 3; i < end * 3; ++i) {
      const double fixed = static_cast<double>(cloud.positions[i]) * to_fixed;
      const auto number =
          static_cast<uint32_t>(static_cast<int32_t>(fixed + (fixed < 0 ? -0.5 : 0.5)));
      for (size_t b = 0; b < 3; ++b) arrays[0][i * 3 + b] = static_cast<uint8_t>(number >> (8 * b));
      const double scale = static_cast<double>(cloud.scales[i]);
      arrays[3][i] = scale > 0 ? nearestByte((std::log(scale) + 10.0) * 16.0) : uint8_t{0};
    }
    for (size_t i = begin; i < end; ++i) {
      arrays[1][i] = nearestByte(static_cast<double>(cloud.opacities[i]) * 255.0);
      const float* sh = &cloud.sh[i * stride];
      for (size_t c = 0; c < 3; ++c) {
        arrays[2][i * 3 + c] =
            nearestByte(static_cast<double>(sh[c]) * (kSpzColourScale * 255.0) + 127.5);
      }
      storeLittleEndian(smallestThree(&cloud.rotations[i * 4]), &arrays[4][i * 4]);
      uint8_t* rest = arrays[5].data() + i * (stride - 3);
      for (size_t k = 3; k < stride; ++k) rest[k - 3] = harmonicByte(sh[k], k / 3);
    }
  });
  return arrays;
}

void writeOldLayout(const std::array<ByteVector, kSpzArrayCount>& arrays, ByteVector header,
                    OutputFile& file, const std::string& path) {
  size_t size = header.size();
  for (const ByteVector& array : arrays) size += array.size();
  header.reserve(size);
  for (const ByteVector& array : arrays) header.insert(header.end(), array.begin(), array.end());
  const ByteVector packed =
      packBytes(Compression::kGzip, header.data(), header.size(), kGzipLevel, path);
  file.write(packed.data(), packed.size());
}

void writeStreams(const std::array<ByteVector, kSpzArrayCount>& arrays, ByteVector header,
                  Frame frame, OutputFile& file, const std::string& path) {
  std::vector<const ByteVector*> filled;
  for (const ByteVector& array : arrays) {
    if (!array.empty()) filled.push_back(&array);
  }
  std::vector<ByteVector> packed(filled.size());
  parallelFor(filled.size(), 1, [&](size_t begin, size_t end) {
    for (size_t s = begin; s < end; ++s) {
      packed[s] =
          packBytes(Compression::kZstd, filled[s]->data(), filled[s]->size(), kZstdLevel, path);
    }
  });
  header.resize(kSpzHeaderBytes, 0);
  std::fill(header.begin() + kSpzOldHeaderBytes, header.end(), uint8_t{0});
  header[15] = static_cast<uint8_t>(filled.size());
  if (frame != Frame::kRUB) {
    header[14] |= kSpzHasExtensions;
    header.resize(kSpzHeaderBytes + 12);
    storeLittleEndian(kSpzCoordinateSystem, &header[kSpzHeaderBytes]);
    storeLittleEndian(uint32_t{4}, &header[kSpzHeaderBytes + 4]);
    storeLittleEndian(static_cast<uint32_t>(frame), &header[kSpzHeaderBytes + 8]);
  }
  const size_t table = header.size();
  storeLittleEndian(static_cast<uint32_t>(table), &header[16]);
  header.resize(table + filled.size() * kSpzStreamEntryBytes);
  for (size_t s = 0; s < filled.size(); ++s) {
    uint8_t* entry = &header[table + s * kSpzStreamEntryBytes];
    storeLittleEndian(uint64_t{packed[s].size()}, entry);
    storeLittleEndian(uint64_t{filled[s]->size()}, entry + 8);
  }
  file.write(header.data(), header.size());
  for (const ByteVector& stream : packed) file.write(stream.data(), stream.size());
}

}  // namespace

void writeSpzSplats(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress) {
  const int version = options.version == 0 ? static_cast<int>(kSpzNewestVersion) : options.version;
  if (version != 3 && version != 4) {
    fail(ErrorCode::kUnsupported, path + " cannot be written as SPZ of version " +
                                      std::to_string(version) + "; 3 and 4 are supported");
  }
  const Frame frame = cloud.frame == Frame::kUnknown ? Frame::kRUB : cloud.frame;
  if (version == 3 && frame != Frame::kRUB) {
    fail(ErrorCode::kUnsupported, path + " cannot be written in the frame " + frameName(frame) +
                                      ": SPZ of version 3 holds RUB only, version 4 any frame");
  }
  if (cloud.size() > 0x7fffffffu) {
    fail(ErrorCode::kUnsupported, path + " cannot be written: " + std::to_string(cloud.size()) +
                                      " splats are more than the 2147483647 of SPZ");
  }
  const int bits = fractionalBits(cloud);
  ByteVector header(kSpzOldHeaderBytes);
  storeLittleEndian(kSpzMagic, header.data());
  storeLittleEndian(static_cast<uint32_t>(version), &header[4]);
  storeLittleEndian(static_cast<uint32_t>(cloud.size()), &header[8]);
  header[12] = static_cast<uint8_t>(cloud.sh_degree);
  header[13] = static_cast<uint8_t>(bits);
  header[14] = cloud.antialias == Antialias::kMip ? kSpzAntialiased : uint8_t{0};
  header[15] = 0;

  OutputFile file(path);
  const std::array<ByteVector, kSpzArrayCount> arrays = encode(cloud, bits);
  advance(progress, 0.3, "Writing splats");
  if (version == 3) {
    writeOldLayout(arrays, header, file, path);
  } else {
    writeStreams(arrays, header, frame, file, path);
  }
  advance(progress, 1.0, "Writing splats");
  file.commit();
}

double estimateSpzSplats(uint64_t count, int degree, const SplatWriteOptions& options) {
  // Most of a splat is noise to the packer; a harmonic is a byte of which five bits (of degree 1)
  // or four are set.
  constexpr double kPlainBytes = 16.5;
  const double harmonic_bytes = options.version == 3 ? 0.48 : 0.43;
  return 200 + static_cast<double>(count) * (kPlainBytes + harmonic_bytes * higherHarmonics(degree));
}

}  // namespace stipple
