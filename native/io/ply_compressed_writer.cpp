// Based on: the compressed PLY of PlayCanvas (developer.playcanvas.com, Compressed PLY format).
// Differs: a finer Morton grid, and the nearest of the values that a reader makes, at the ends of
// each range too.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "io/compression.h"
#include "io/little_endian.h"
#include "io/output_file.h"
#include "io/ply_comments.h"
#include "io/ply_compressed.h"
#include "io/ply_file.h"
#include "io/quantize.h"
#include "math/morton.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 8192;
// Logarithms of scales beyond this are moved here: 2 nm and 485,165 km.
constexpr double kLogLimit = 20.0;
constexpr double kMortonCells = 2097151.0;
constexpr size_t kVertexBytes = 16;

/// Indices of the splats along the Morton curve, ties by index.
std::vector<uint32_t> mortonOrder(const SplatCloud& cloud) {
  const size_t count = cloud.size();
  std::array<double, 3> low, to_cells;
  for (size_t k = 0; k < 3; ++k) {
    float least = count > 0 ? cloud.positions[k] : 0.0f;
    float most = least;
    for (size_t i = 0; i < count; ++i) {
      least = std::min(least, cloud.positions[i * 3 + k]);
      most = std::max(most, cloud.positions[i * 3 + k]);
    }
    low[k] = static_cast<double>(least);
    const double extent = static_cast<double>(most) - low[k];
    to_cells[k] = extent > 0 ? kMortonCells / extent : 0.0;
  }
  std::vector<std::pair<uint64_t, uint32_t>> keys(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::array<uint32_t, 3> cell;
      for (size_t k = 0; k < 3; ++k) {
        const double at = (static_cast<double>(cloud.positions[i * 3 + k]) - low[k]) * to_cells[k];
        cell[k] = static_cast<uint32_t>(std::min(at, kMortonCells));
      }
      keys[i] = {mortonEncode(cell[0], cell[1], cell[2]), static_cast<uint32_t>(i)};
    }
  });
  std::sort(keys.begin(), keys.end());
  std::vector<uint32_t> order(count);
  for (size_t i = 0; i < count; ++i) order[i] = keys[i].second;
  return order;
}

/// Position, logarithm of the scale, and colour of a splat.
std::array<double, 9> valuesOf(const SplatCloud& cloud, size_t i) {
  std::array<double, 9> values;
  const float* sh = &cloud.sh[i * cloud.shStride()];
  for (size_t k = 0; k < 3; ++k) {
    values[k] = static_cast<double>(cloud.positions[i * 3 + k]);
    const double scale = static_cast<double>(cloud.scales[i * 3 + k]);
    values[3 + k] = scale > 0 ? std::clamp(std::log(scale), -kLogLimit, kLogLimit) : -kLogLimit;
    values[6 + k] = static_cast<double>(sh[k]) * kPlyChunkC0 + 0.5;
  }
  return values;
}

/// The nearest of `steps` + 1 even numbers between the ends of a range, as its index.
uint32_t stepOf(double value, float low, float high, uint32_t steps) {
  const double extent = static_cast<double>(high) - static_cast<double>(low);
  if (!(extent > 0)) return 0;
  return nearestStep((value - static_cast<double>(low)) / extent * steps, steps);
}

uint32_t packRotation(const float* q) {
  size_t largest = 0;
  double squares = 0;
  for (size_t k = 0; k < 4; ++k) {
    squares += static_cast<double>(q[k]) * static_cast<double>(q[k]);
    if (std::abs(q[k]) > std::abs(q[largest])) largest = k;
  }
  const double factor = std::sqrt(0.5) / std::sqrt(squares) * (q[largest] < 0 ? -1.0 : 1.0);
  uint32_t packed = static_cast<uint32_t>(largest);
  for (size_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    packed = packed << 10 | nearestStep((static_cast<double>(q[k]) * factor + 0.5) * 1023.0, 1023);
  }
  return packed;
}

uint8_t harmonicByte(float value) {
  const double share = std::clamp(static_cast<double>(value) / 8.0 + 0.5, 0.0, 1.0);
  const auto byte = static_cast<uint8_t>(std::min(share * 256.0, 255.0));
  // The bytes at the ends stand for the ends and not for the middle of their part.
  if (byte == 0 && share * 256.0 > 0.75) return 1;
  if (byte == 255 && share * 256.0 < 255.25) return 254;
  return byte;
}

class Writer {
 public:
  explicit Writer(const SplatCloud& cloud)
      : cloud_(cloud),
        order_(mortonOrder(cloud)),
        harmonic_bytes_(cloud.shStride() - 3),
        chunks_((cloud.size() + kPlyChunkSplats - 1) / kPlyChunkSplats * kPlyChunkNumbers * 4),
        vertices_(cloud.size() * kVertexBytes),
        harmonics_(cloud.size() * harmonic_bytes_) {
    const size_t chunk_count = (cloud.size() + kPlyChunkSplats - 1) / kPlyChunkSplats;
    parallelFor(chunk_count, 16, [&](size_t begin, size_t end) {
      for (size_t chunk = begin; chunk < end; ++chunk) pack(chunk);
    });
  }

  std::string header() const {
    const std::string count = std::to_string(cloud_.size());
    std::string text = "ply\nformat binary_little_endian 1.0\n" + plyComments(cloud_) +
                       "element chunk " + std::to_string(chunks_.size() / kPlyChunkNumbers / 4) +
                       "\n";
    for (const char* name : kChunkProperties) text += std::string("property float ") + name + "\n";
    text += "element vertex " + count + "\n";
    for (const char* name : kPackedProperties) text += std::string("property uint ") + name + "\n";
    if (harmonic_bytes_ > 0) text += "element sh " + count + "\n";
    for (size_t k = 0; k < harmonic_bytes_; ++k) {
      text += "property uchar f_rest_" + std::to_string(k) + "\n";
    }
    return text + "end_header\n";
  }

  const ByteVector& chunks() const { return chunks_; }
  const ByteVector& vertices() const { return vertices_; }
  const ByteVector& harmonics() const { return harmonics_; }

 private:
  void pack(size_t chunk) {
    const size_t begin = chunk * kPlyChunkSplats;
    const size_t end = std::min(cloud_.size(), begin + kPlyChunkSplats);
    std::array<std::array<double, 9>, kPlyChunkSplats> values;
    PlyChunkRange range;
    for (size_t k = 0; k < 9; ++k) {
      range[k / 3 * 6 + k % 3] = std::numeric_limits<float>::max();
      range[k / 3 * 6 + k % 3 + 3] = std::numeric_limits<float>::lowest();
    }
    for (size_t i = begin; i < end; ++i) {
      values[i - begin] = valuesOf(cloud_, order_[i]);
      for (size_t k = 0; k < 9; ++k) {
        float& low = range[k / 3 * 6 + k % 3];
        float& high = range[k / 3 * 6 + k % 3 + 3];
        low = std::min(low, static_cast<float>(values[i - begin][k]));
        high = std::max(high, static_cast<float>(values[i - begin][k]));
      }
    }
    for (size_t k = 0; k < kPlyChunkNumbers; ++k) {
      storeFloat(range[k], &chunks_[(chunk * kPlyChunkNumbers + k) * 4]);
    }
    for (size_t i = begin; i < end; ++i) packSplat(i, values[i - begin], range);
  }

  void packSplat(size_t i, const std::array<double, 9>& values, const PlyChunkRange& range) {
    const size_t from = order_[i];
    const auto step = [&](size_t k, uint32_t steps) {
      const size_t low = k / 3 * 6 + k % 3;
      return stepOf(values[k], range[low], range[low + 3], steps);
    };
    uint8_t* row = &vertices_[i * kVertexBytes];
    storeLittleEndian(step(0, 2047) << 21 | step(1, 1023) << 11 | step(2, 2047), row);
    storeLittleEndian(packRotation(&cloud_.rotations[from * 4]), row + 4);
    storeLittleEndian(step(3, 2047) << 21 | step(4, 1023) << 11 | step(5, 2047), row + 8);
    const uint32_t opacity = nearestByte(static_cast<double>(cloud_.opacities[from]) * 255.0);
    storeLittleEndian(step(6, 255) << 24 | step(7, 255) << 16 | step(8, 255) << 8 | opacity,
                      row + 12);
    const float* sh = &cloud_.sh[from * cloud_.shStride()];
    const size_t rest = harmonic_bytes_ / 3;
    uint8_t* bytes = harmonics_.data() + i * harmonic_bytes_;
    for (size_t channel = 0; channel < 3; ++channel) {
      for (size_t k = 1; k <= rest; ++k) *bytes++ = harmonicByte(sh[k * 3 + channel]);
    }
  }

  const SplatCloud& cloud_;
  std::vector<uint32_t> order_;
  size_t harmonic_bytes_;
  ByteVector chunks_, vertices_, harmonics_;
};

}  // namespace

void writeCompressedPly(const SplatCloud& cloud, const std::string& path, const SplatWriteOptions&,
                        Progress* progress) {
  OutputFile file(path);
  const Writer writer(cloud);
  advance(progress, 0.7, "Writing splats");
  const std::string head = writer.header();
  file.write(head.data(), head.size());
  for (const ByteVector* part : {&writer.chunks(), &writer.vertices(), &writer.harmonics()}) {
    file.write(part->data(), part->size());
  }
  advance(progress, 1.0, "Writing splats");
  file.commit();
}

}  // namespace stipple
