// Based on: the compressed PLY of PlayCanvas (developer.playcanvas.com, Compressed PLY format).
// Differs: a finer Morton grid, and the nearest of the values that a reader makes, at the ends of
// each range too.
#include <algorithm>
#include <array>
#include <atomic>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/little_endian.h"
#include "io/bytes/output_file.h"
#include "io/splats/ply/ply_comments.h"
#include "io/splats/ply/ply_compressed.h"
#include "io/splats/ply/ply_compressed_kernel.h"
#include "io/splats/ply/ply_file.h"
#include "io/splats/splat_check.h"
#include "math/morton.h"
#include "math/radix_order.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 8192;
constexpr double kMortonCells = 2097151.0;
constexpr size_t kVertexBytes = 16;
// Chunks of one task: 125 KB of the file at degree 3.
constexpr size_t kTaskChunks = 8;
constexpr size_t kTaskSplats = kTaskChunks * kPlyChunkSplats;

using Corner = std::array<float, 3>;

/// Lowest and highest position.
std::pair<Corner, Corner> boundsOf(const SplatCloud& cloud) {
  std::vector<std::pair<Corner, Corner>> bounds(rangeCount(cloud.size(), kGrain));
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    Corner low = {cloud.positions[begin * 3], cloud.positions[begin * 3 + 1],
                  cloud.positions[begin * 3 + 2]};
    Corner high = low;
    for (size_t i = begin; i < end; ++i) {
      for (size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], cloud.positions[i * 3 + k]);
        high[k] = std::max(high[k], cloud.positions[i * 3 + k]);
      }
    }
    bounds[begin / kGrain] = {low, high};
  });
  if (bounds.empty()) return {};
  std::pair<Corner, Corner> all = bounds.front();
  for (const auto& [low, high] : bounds) {
    for (size_t k = 0; k < 3; ++k) {
      all.first[k] = std::min(all.first[k], low[k]);
      all.second[k] = std::max(all.second[k], high[k]);
    }
  }
  return all;
}

/// The splats along the Morton curve, ties by index. In: finite positions.
KeyedIndices mortonOrder(const SplatCloud& cloud) {
  const auto [low, high] = boundsOf(cloud);
  std::array<double, 3> from, to_cells;
  for (size_t k = 0; k < 3; ++k) {
    from[k] = static_cast<double>(low[k]);
    const double extent = static_cast<double>(high[k]) - from[k];
    to_cells[k] = extent > 0 ? kMortonCells / extent : 0.0;
  }
  KeyedIndices keys(cloud.size());
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::array<uint32_t, 3> cell;
      for (size_t k = 0; k < 3; ++k) {
        const double at = (static_cast<double>(cloud.positions[i * 3 + k]) - from[k]) * to_cells[k];
        cell[k] = static_cast<uint32_t>(static_cast<int32_t>(std::min(at, kMortonCells)));
      }
      keys[i] = {mortonEncode(cell[0], cell[1], cell[2]), static_cast<uint32_t>(i)};
    }
  });
  sortByKey(keys);
  return keys;
}

/// Chunks of neighbours along the curve, each from splats that are fetched from where they lie.
class Writer {
 public:
  Writer(const SplatCloud& cloud, OutputFile& file, Progress* progress)
      : cloud_(cloud),
        file_(file),
        progress_(progress),
        harmonic_bytes_(cloud.shStride() - 3),
        chunk_count_((cloud.size() + kPlyChunkSplats - 1) / kPlyChunkSplats),
        kernel_(plyChunkKernel()) {
    // The file holds all of red, then all of green, then all of blue.
    for (size_t k = 0; k < harmonic_bytes_; ++k) {
      places_[k] = static_cast<uint8_t>(k % 3 * (harmonic_bytes_ / 3) + k / 3);
    }
  }

  /// Errors: values that are not valid.
  void write() {
    const std::string head = header();
    chunks_at_ = head.size();
    vertices_at_ = chunks_at_ + chunk_count_ * kChunkBytes;
    harmonics_at_ = vertices_at_ + cloud_.size() * uint64_t{kVertexBytes};
    file_.writeAt(0, head.data(), head.size());
    RowCheck check(cloud_, "cloud");
    order_ = mortonOrder(cloud_);
    advance(progress_, 0.25, "Writing splats");
    std::atomic<size_t> done{0};
    parallelFor(chunk_count_, kTaskChunks, [&](size_t begin, size_t end) {
      if (!packChunks(begin, end)) check.doubt();
      const size_t chunks = done.fetch_add(end - begin) + (end - begin);
      advance(progress_,
              0.25 + 0.75 * static_cast<double>(chunks) / static_cast<double>(chunk_count_),
              "Writing splats");
    });
    check.require();
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

  /// Chunks [begin, end) to their three places in the file; false where values are not valid.
  bool packChunks(size_t begin, size_t end) const {
    const size_t first = begin * kPlyChunkSplats;
    const size_t last = std::min(cloud_.size(), end * kPlyChunkSplats);
    std::array<uint8_t, kTaskChunks * kChunkBytes> chunks;
    std::array<uint8_t, kTaskSplats * kVertexBytes> vertices;
    std::array<uint8_t, kTaskSplats * PlyHarmonicRows::kMostBytes + 16> harmonics;
    PlyChunkValues values;
    PlyChunkRange range;
    PlyChunkBits bits;
    for (size_t from = first; from < last; from += kPlyChunkSplats) {
      const size_t count = std::min(kPlyChunkSplats, last - from);
      std::array<const float*, kPlyChunkSplats> rows;
      fetch(from, count, values, rows);
      if (!kernel_.encode(values, range, bits)) return false;
      uint8_t* stored = &chunks[(from - first) / kPlyChunkSplats * kChunkBytes];
      for (size_t k = 0; k < kPlyChunkNumbers; ++k) storeFloat(range[k], stored + k * 4);
      uint8_t* vertex = &vertices[(from - first) * kVertexBytes];
      for (size_t i = 0; i < count; ++i) {
        for (size_t k = 0; k < 4; ++k) storeLittleEndian(bits[k][i], vertex + i * 16 + k * 4);
      }
      if (harmonic_bytes_ == 0) continue;
      if (!kernel_.encodeHarmonics({rows.data(), count, harmonic_bytes_, places_},
                                   &harmonics[(from - first) * harmonic_bytes_])) {
        return false;
      }
    }
    file_.writeAt(chunks_at_ + begin * uint64_t{kChunkBytes}, chunks.data(),
                  (end - begin) * kChunkBytes);
    file_.writeAt(vertices_at_ + first * uint64_t{kVertexBytes}, vertices.data(),
                  (last - first) * kVertexBytes);
    file_.writeAt(harmonics_at_ + first * uint64_t{harmonic_bytes_}, harmonics.data(),
                  (last - first) * harmonic_bytes_);
    return true;
  }

  /// Values of a chunk's splats, and where the harmonics of each begin.
  void fetch(size_t from, size_t count, PlyChunkValues& values,
             std::array<const float*, kPlyChunkSplats>& rows) const {
    constexpr size_t kAhead = 16;
    const size_t stride = cloud_.shStride();
    for (size_t i = 0; i < kPlyChunkSplats; ++i) {
      // Splats lie anywhere in memory: those to come are asked for early.
      const size_t ahead = order_[std::min(from + i + kAhead, order_.size() - 1)].index;
      __builtin_prefetch(&cloud_.positions[ahead * 3]);
      __builtin_prefetch(&cloud_.scales[ahead * 3]);
      __builtin_prefetch(&cloud_.rotations[ahead * 4]);
      __builtin_prefetch(&cloud_.opacities[ahead]);
      __builtin_prefetch(&cloud_.sh[ahead * stride]);
      const size_t splat = order_[from + std::min(i, count - 1)].index;
      rows[i] = &cloud_.sh[splat * stride];
      for (size_t k = 0; k < 3; ++k) {
        values.ranged[k][i] = cloud_.positions[splat * 3 + k];
        values.ranged[3 + k][i] = cloud_.scales[splat * 3 + k];
        values.ranged[6 + k][i] = rows[i][k];
      }
      values.opacity[i] = cloud_.opacities[splat];
      for (size_t k = 0; k < 4; ++k) values.rotation[k][i] = cloud_.rotations[splat * 4 + k];
    }
  }

  const SplatCloud& cloud_;
  OutputFile& file_;
  Progress* progress_;
  size_t harmonic_bytes_;
  size_t chunk_count_;
  const PlyChunkKernel& kernel_;
  std::array<uint8_t, PlyHarmonicRows::kMostBytes> places_{};  ///< in a row of the file
  uint64_t chunks_at_ = 0;
  uint64_t vertices_at_ = 0;
  uint64_t harmonics_at_ = 0;
  KeyedIndices order_;
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

double estimateCompressedPly(uint64_t count, int degree, const SplatWriteOptions&) {
  constexpr double kHeaderBytes = 1000;
  const uint64_t chunks = (count + kPlyChunkSplats - 1) / kPlyChunkSplats;
  const double row = kPackedProperties.size() * sizeof(uint32_t) + higherHarmonics(degree);
  return kHeaderBytes + static_cast<double>(chunks * sizeof(PlyChunkRange)) +
         static_cast<double>(count) * row;
}

}  // namespace stipple
