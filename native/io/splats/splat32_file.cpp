// Based on: github.com/antimatter15/splat, the viewer that made the format (its quaternion bytes
// count from 128).
#include "io/splats/splat32_file.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/input_file.h"
#include "io/bytes/little_endian.h"
#include "io/bytes/output_file.h"
#include "io/splats/quantize.h"
#include "io/splats/splat_check.h"

namespace stipple {

namespace {

constexpr size_t kRecordBytes = 32;
// Where in a record what lies: position and scale as 3 floats, colour and opacity, rotation.
constexpr size_t kScaleAt = 12;
constexpr size_t kColourAt = 24;
constexpr size_t kRotationAt = 28;
// Rows of one task: 128 KB.
constexpr size_t kBlockRows = 4096;
constexpr double kC0 = 0.28209479177387814;

void encodeRow(const SplatCloud& cloud, size_t i, uint8_t* record) {
  const float* sh = &cloud.sh[i * cloud.shStride()];
  for (size_t k = 0; k < 3; ++k) {
    storeFloat(cloud.positions[i * 3 + k], record + k * 4);
    storeFloat(cloud.scales[i * 3 + k], record + kScaleAt + k * 4);
    const double colour = kC0 * static_cast<double>(sh[k]) + 0.5;
    record[kColourAt + k] = nearestByte(colour * 255.0);
  }
  record[kColourAt + 3] = nearestByte(static_cast<double>(cloud.opacities[i]) * 255.0);
  const float* q = &cloud.rotations[i * 4];
  double squares = 0;
  for (size_t k = 0; k < 4; ++k) squares += static_cast<double>(q[k]) * static_cast<double>(q[k]);
  const double length = std::sqrt(squares);
  for (size_t k = 0; k < 4; ++k) {
    record[kRotationAt + k] = nearestByte(static_cast<double>(q[k]) / length * 128.0 + 128.0);
  }
}

}  // namespace

SplatCloud readSplat32(const std::string& path, Progress* progress) {
  const InputFile file(path);
  if (file.size() == 0 || file.size() % kRecordBytes != 0) {
    fail(ErrorCode::kFormat, path + " is not a valid .splat file: it holds " +
                                 std::to_string(file.size()) +
                                 " bytes; a multiple of 32, one record or more, is expected");
  }
  SplatCloud cloud;
  cloud.resize(static_cast<size_t>(file.size() / kRecordBytes));
  std::array<float, 256> colour_of, part_of;
  for (size_t byte = 0; byte < 256; ++byte) {
    const double value = static_cast<double>(byte);
    colour_of[byte] = static_cast<float>((value / 255.0 - 0.5) / kC0);
    part_of[byte] = static_cast<float>((value - 128.0) / 128.0);
  }
  parallelFor(cloud.size(), kBlockRows, [&](size_t begin, size_t end) {
    std::array<uint8_t, kBlockRows * kRecordBytes> block;
    file.readAt(begin * uint64_t{kRecordBytes}, block.data(), (end - begin) * kRecordBytes);
    for (size_t i = begin; i < end; ++i) {
      const uint8_t* record = block.data() + (i - begin) * kRecordBytes;
      for (size_t k = 0; k < 3; ++k) {
        cloud.positions[i * 3 + k] = loadFloat(record + k * 4);
        cloud.scales[i * 3 + k] = loadFloat(record + kScaleAt + k * 4);
        cloud.sh[i * 3 + k] = colour_of[record[kColourAt + k]];
      }
      cloud.opacities[i] = static_cast<float>(static_cast<double>(record[kColourAt + 3]) / 255.0);
      float* q = &cloud.rotations[i * 4];
      for (size_t k = 0; k < 4; ++k) q[k] = part_of[record[kRotationAt + k]];
      normaliseRotation(q);
    }
  });
  requireValidSplats(cloud, path);
  advance(progress, 1.0, "Reading splats");
  return cloud;
}

void writeSplat32(const SplatCloud& cloud, const std::string& path, const SplatWriteOptions&,
                  Progress* progress) {
  if (cloud.size() == 0) {
    fail(ErrorCode::kUnsupported,
         path + " cannot be written: the cloud has 0 splats; .splat holds 1 or more");
  }
  OutputFile file(path);
  RowCheck check(cloud, "cloud");
  std::atomic<size_t> rows_done{0};
  parallelFor(cloud.size(), kBlockRows, [&](size_t begin, size_t end) {
    if (!check.look(begin, end)) return;
    std::array<uint8_t, kBlockRows * kRecordBytes> block;
    for (size_t i = begin; i < end; ++i) {
      encodeRow(cloud, i, block.data() + (i - begin) * kRecordBytes);
    }
    file.writeAt(begin * uint64_t{kRecordBytes}, block.data(), (end - begin) * kRecordBytes);
    const size_t done = rows_done.fetch_add(end - begin) + (end - begin);
    advance(progress, static_cast<double>(done) / static_cast<double>(cloud.size()),
            "Writing splats");
  });
  check.require();
  file.commit();
}

double estimateSplat32(uint64_t count, int, const SplatWriteOptions&) {
  return static_cast<double>(count * kRecordBytes);
}

}  // namespace stipple
