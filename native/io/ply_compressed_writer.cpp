// Based on: the compressed PLY of PlayCanvas (developer.playcanvas.com, Compressed PLY format).
// Differs: a finer Morton grid, and the nearest of the values that a reader makes, at the ends of
// each range too.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/compression.h"
#include "io/little_endian.h"
#include "io/output_file.h"
#include "io/ply_comments.h"
#include "io/ply_compressed.h"
#include "io/ply_file.h"
#include "io/quantize.h"
#include "io/radix_order.h"
#include "io/splat_check.h"
#include "math/morton.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 8192;
// Logarithms of scales beyond this are moved here: 2 nm and 485,165 km.
constexpr double kLogLimit = 20.0;
constexpr double kMortonCells = 2097151.0;
constexpr size_t kVertexBytes = 16;
// Chunks of one task: 250 KB of the file at degree 3.
constexpr size_t kTaskChunks = 16;

/// Where along the Morton curve each splat comes, ties by index.
DefaultInitVector<uint32_t> mortonPlaces(const SplatCloud& cloud) {
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
  KeyedIndices keys(count);
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
  sortByKey(keys);
  DefaultInitVector<uint32_t> places(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t k = begin; k < end; ++k) places[keys[k].index] = static_cast<uint32_t>(k);
  });
  return places;
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

/// Numbers whose middles or ends (plyHarmonicOf) are nearest to the values. 32 v + 128 counts in
/// parts; taken apart, so that float32 has room for it.
void packHarmonics(const float* values, size_t count, uint8_t* bytes) {
  // Below this a value does not move the sum of a double: it counts as 0.
  constexpr float kNothing = 0x1p-47f;
  for (size_t k = 0; k < count; ++k) {
    const float parts = std::clamp(values[k] * 32.0f, -128.0f, 128.0f);
    const auto whole = static_cast<int32_t>(parts);  // towards 0
    const int32_t below = whole - (parts < static_cast<float>(whole) && parts < -kNothing ? 1 : 0);
    const int32_t middle = std::clamp(below + 128, 1, 254);
    // The bytes at the ends stand for the ends and not for the middle of their part.
    bytes[k] = static_cast<uint8_t>(parts <= -127.25f ? 0 : parts >= 127.25f ? 255 : middle);
  }
}

/// What a chunk needs of a splat before its ranges are known.
struct Part {
  std::array<float, 3> position, scale, colour;  ///< colour: coefficient 0
  uint32_t opacity, rotation;                    ///< packed
};

/// Position, logarithm of the scale, and colour of a chunk's splats, and the same in steps:
/// attribute by attribute, so that the loops over them become vector code.
struct Chunk {
  std::array<std::array<double, kPlyChunkSplats>, 9> values;
  std::array<std::array<uint32_t, kPlyChunkSplats>, 9> steps;
};

/// Two passes: splats in the order of the cloud to their places along the curve, where chunks are
/// made of neighbours. Rows of the cloud take four times the bytes of what goes to the places, so
/// that memory is read from front to back, and only the small writes jump.
class Writer {
 public:
  Writer(const SplatCloud& cloud, OutputFile& file, Progress* progress)
      : cloud_(cloud),
        file_(file),
        progress_(progress),
        harmonic_bytes_(cloud.shStride() - 3),
        chunk_count_((cloud.size() + kPlyChunkSplats - 1) / kPlyChunkSplats),
        parts_(cloud.size()),
        harmonics_(cloud.size() * harmonic_bytes_) {}

  void write() {
    const std::string head = header();
    chunks_at_ = head.size();
    vertices_at_ = chunks_at_ + chunk_count_ * kChunkBytes;
    harmonics_at_ = vertices_at_ + cloud_.size() * uint64_t{kVertexBytes};
    file_.writeAt(0, head.data(), head.size());
    takeApart();
    std::atomic<size_t> done{0};
    parallelFor(chunk_count_, kTaskChunks, [&](size_t begin, size_t end) {
      packChunks(begin, end);
      const size_t chunks = done.fetch_add(end - begin) + (end - begin);
      advance(progress_,
              0.5 + 0.5 * static_cast<double>(chunks) / static_cast<double>(chunk_count_),
              "Writing splats");
    });
  }

 private:
  static constexpr size_t kChunkBytes = kPlyChunkNumbers * sizeof(float);

  std::string header() const {
    const std::string count = std::to_string(cloud_.size());
    std::string text = "ply\nformat binary_little_endian 1.0\n" + plyComments(cloud_) +
                       "element chunk " + std::to_string(chunk_count_) + "\n";
    for (const char* name : kChunkProperties) text += std::string("property float ") + name + "\n";
    text += "element vertex " + count + "\n";
    for (const char* name : kPackedProperties) text += std::string("property uint ") + name + "\n";
    if (harmonic_bytes_ > 0) text += "element sh " + count + "\n";
    for (size_t k = 0; k < harmonic_bytes_; ++k) {
      text += "property uchar f_rest_" + std::to_string(k) + "\n";
    }
    return text + "end_header\n";
  }

  /// Every splat to its place. Errors: values that are not valid.
  void takeApart() {
    RowCheck check(cloud_, "cloud");
    const DefaultInitVector<uint32_t> places = mortonPlaces(cloud_);
    parallelFor(cloud_.size(), kGrain, [&](size_t begin, size_t end) {
      if (!check.look(begin, end)) return;
      for (size_t i = begin; i < end; ++i) {
        const size_t place = places[i];
        const float* sh = &cloud_.sh[i * cloud_.shStride()];
        Part& part = parts_[place];
        std::copy_n(&cloud_.positions[i * 3], 3, part.position.begin());
        std::copy_n(&cloud_.scales[i * 3], 3, part.scale.begin());
        std::copy_n(sh, 3, part.colour.begin());
        part.opacity = nearestByte(static_cast<double>(cloud_.opacities[i]) * 255.0);
        part.rotation = packRotation(&cloud_.rotations[i * 4]);
        if (harmonic_bytes_ > 0) packRest(sh + 3, &harmonics_[place * harmonic_bytes_]);
      }
    });
    check.require();
    advance(progress_, 0.5, "Writing splats");
  }

  /// The file holds all of red, then all of green, then all of blue.
  void packRest(const float* values, uint8_t* out) const {
    std::array<uint8_t, 48> bytes;
    packHarmonics(values, harmonic_bytes_, bytes.data());
    const size_t rest = harmonic_bytes_ / 3;
    for (size_t channel = 0; channel < 3; ++channel) {
      for (size_t k = 0; k < rest; ++k) *out++ = bytes[k * 3 + channel];
    }
  }

  /// Chunks [begin, end) to their three places in the file.
  void packChunks(size_t begin, size_t end) const {
    const size_t first = begin * kPlyChunkSplats;
    const size_t last = std::min(cloud_.size(), end * kPlyChunkSplats);
    std::array<uint8_t, kTaskChunks * kChunkBytes> chunks;
    std::array<uint8_t, kTaskChunks * kPlyChunkSplats * kVertexBytes> vertices;
    Chunk chunk;
    for (size_t c = begin; c < end; ++c) {
      const size_t from = c * kPlyChunkSplats;
      const size_t to = std::min(cloud_.size(), from + kPlyChunkSplats);
      fill(from, to, chunk);
      quantise(to - from, chunk, &chunks[(c - begin) * kChunkBytes]);
      for (size_t i = from; i < to; ++i) {
        packVertex(parts_[i], chunk, i - from, &vertices[(i - first) * kVertexBytes]);
      }
    }
    file_.writeAt(chunks_at_ + begin * uint64_t{kChunkBytes}, chunks.data(),
                  (end - begin) * kChunkBytes);
    file_.writeAt(vertices_at_ + first * uint64_t{kVertexBytes}, vertices.data(),
                  (last - first) * kVertexBytes);
    file_.writeAt(harmonics_at_ + first * uint64_t{harmonic_bytes_},
                  harmonics_.data() + first * harmonic_bytes_, (last - first) * harmonic_bytes_);
  }

  void fill(size_t from, size_t to, Chunk& chunk) const {
    for (size_t i = from; i < to; ++i) {
      const Part& part = parts_[i];
      for (size_t k = 0; k < 3; ++k) {
        chunk.values[k][i - from] = static_cast<double>(part.position[k]);
        const double scale = static_cast<double>(part.scale[k]);
        chunk.values[3 + k][i - from] =
            scale > 0 ? std::clamp(std::log(scale), -kLogLimit, kLogLimit) : -kLogLimit;
        chunk.values[6 + k][i - from] = static_cast<double>(part.colour[k]) * kPlyChunkC0 + 0.5;
      }
    }
  }

  /// Ranges of a chunk of `count` splats, stored too, and the nearest of the even numbers between
  /// their ends.
  static void quantise(size_t count, Chunk& chunk, uint8_t* stored) {
    constexpr std::array<uint32_t, 3> kSteps = {2047, 1023, 2047};
    for (size_t k = 0; k < 9; ++k) {
      const double* values = chunk.values[k].data();
      uint32_t* steps = chunk.steps[k].data();
      float low = std::numeric_limits<float>::max();
      float high = std::numeric_limits<float>::lowest();
      for (size_t i = 0; i < count; ++i) {
        low = std::min(low, static_cast<float>(values[i]));
        high = std::max(high, static_cast<float>(values[i]));
      }
      const size_t place = k / 3 * 6 + k % 3;
      storeFloat(low, stored + place * sizeof(float));
      storeFloat(high, stored + (place + 3) * sizeof(float));
      const uint32_t last = k < 6 ? kSteps[k % 3] : 255;
      const double from = static_cast<double>(low);
      const double extent = static_cast<double>(high) - from;
      if (!(extent > 0)) {
        std::fill_n(steps, count, 0u);
        continue;
      }
      for (size_t i = 0; i < count; ++i) {
        steps[i] = nearestStep((values[i] - from) / extent * last, last);
      }
    }
  }

  static void packVertex(const Part& part, const Chunk& chunk, size_t at, uint8_t* row) {
    const auto step = [&](size_t k) { return chunk.steps[k][at]; };
    storeLittleEndian(step(0) << 21 | step(1) << 11 | step(2), row);
    storeLittleEndian(part.rotation, row + 4);
    storeLittleEndian(step(3) << 21 | step(4) << 11 | step(5), row + 8);
    storeLittleEndian(step(6) << 24 | step(7) << 16 | step(8) << 8 | part.opacity, row + 12);
  }

  const SplatCloud& cloud_;
  OutputFile& file_;
  Progress* progress_;
  size_t harmonic_bytes_;
  size_t chunk_count_;
  uint64_t chunks_at_ = 0;
  uint64_t vertices_at_ = 0;
  uint64_t harmonics_at_ = 0;
  DefaultInitVector<Part> parts_;  ///< along the curve
  ByteVector harmonics_;           ///< the same
};

}  // namespace

void writeCompressedPly(const SplatCloud& cloud, const std::string& path, const SplatWriteOptions&,
                        Progress* progress) {
  // The order needs positions that are numbers; the rest is looked at chunk by chunk.
  requireFinite(cloud.positions.data(), cloud.positions.size(), 3, "cloud: position of splat");
  OutputFile file(path);
  Writer(cloud, file, progress).write();
  file.commit();
}

}  // namespace stipple
