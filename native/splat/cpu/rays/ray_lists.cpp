#include "splat/cpu/rays/ray_lists.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "math/cross_product.h"
#include "splat/cpu/tiles/tile_spans.h"

namespace stipple {

namespace {

constexpr size_t kChunks = 16;  ///< of splats, counted apart and listed in order
constexpr uint64_t kMostPairs = uint64_t{1} << 25;  ///< of a band of more than one row

/// A cone around the rays of a tile in a perspective view.
struct TileCone {
  Vec3d axis;
  double sine = 0, cosine = 1;

  TileCone(const View<double>& view, uint32_t x0, uint32_t y0) {
    const auto through = [&](double x, double y) {
      return Vec3d((x - view.cx) / view.fx, (y - view.cy) / view.fy, 1).normalized();
    };
    const double side = kTileSide;
    axis = through(x0 + 0.5 * side, y0 + 0.5 * side);
    for (int corner = 0; corner < 4; ++corner) {
      const Vec3d ray = through(x0 + (corner & 1 ? side : 0), y0 + (corner >> 1 ? side : 0));
      sine = std::max(sine, crossProduct(axis, ray).norm());
    }
    sine = std::min(1.0, sine * (1 + 1e-9));
    cosine = std::sqrt(std::max(0.0, 1 - sine * sine));
  }

  bool touches(const Vec3d& centre, double radius) const {
    if (centre.squaredNorm() <= radius * radius) return true;
    const double along = centre.dot(axis);
    const double across = (centre - along * axis).norm();
    return across * cosine - along * sine <= radius;
  }
};

class Lister {
 public:
  Lister(const std::vector<RayReach>& reaches, const View<double>& view, const TileGrid& grid)
      : reaches_(reaches), grid_(grid), chunk_size_((reaches.size() + kChunks - 1) / kChunks) {
    const bool any_around = std::any_of(reaches.begin(), reaches.end(),
                                        [](const RayReach& reach) { return reach.is_around; });
    if (!any_around) return;
    cones_.reserve(grid.tileCount());
    for (size_t i = 0; i < grid.tileCount(); ++i) {
      cones_.emplace_back(view, static_cast<uint32_t>(i % grid.columns) * kTileSide,
                          static_cast<uint32_t>(i / grid.columns) * kTileSide);
    }
  }

  /// Pairs of each row of tiles.
  std::vector<uint64_t> countRows() const {
    std::vector<std::vector<uint64_t>> counts(kChunks, std::vector<uint64_t>(grid_.rows));
    parallelFor(kChunks, 1, [&](size_t begin, size_t end) {
      for (size_t chunk = begin; chunk < end; ++chunk) {
        forEachTile(chunk, 0, grid_.rows,
                    [&](size_t tile, uint32_t) { ++counts[chunk][tile / grid_.columns]; });
      }
    });
    std::vector<uint64_t> sums(grid_.rows);
    for (const std::vector<uint64_t>& chunk : counts) {
      for (size_t row = 0; row < sums.size(); ++row) sums[row] += chunk[row];
    }
    return sums;
  }

  void list(uint32_t first_row, uint32_t end_row, RayTileBand& band) const {
    band.first_tile = size_t{first_row} * grid_.columns;
    band.end_tile = size_t{end_row} * grid_.columns;
    const size_t tiles = band.end_tile - band.first_tile;
    std::vector<uint64_t> cursors(kChunks * tiles);
    parallelFor(kChunks, 1, [&](size_t begin, size_t end) {
      for (size_t chunk = begin; chunk < end; ++chunk) {
        forEachTile(chunk, first_row, end_row, [&](size_t tile, uint32_t) {
          ++cursors[chunk * tiles + tile - band.first_tile];
        });
      }
    });
    band.offsets.assign(tiles + 1, 0);
    uint64_t sum = 0;
    for (size_t tile = 0; tile < tiles; ++tile) {
      band.offsets[tile] = sum;
      for (size_t chunk = 0; chunk < kChunks; ++chunk) {
        const uint64_t count = cursors[chunk * tiles + tile];
        cursors[chunk * tiles + tile] = sum;
        sum += count;
      }
    }
    band.offsets[tiles] = sum;
    band.entries.resize(sum);
    parallelFor(kChunks, 1, [&](size_t begin, size_t end) {
      for (size_t chunk = begin; chunk < end; ++chunk) {
        forEachTile(chunk, first_row, end_row, [&](size_t tile, uint32_t splat) {
          band.entries[cursors[chunk * tiles + tile - band.first_tile]++] = splat;
        });
      }
    });
  }

 private:
  /// visit(tile, splat) of a chunk's splats and the tiles of some rows.
  template <typename Visit>
  void forEachTile(size_t chunk, uint32_t first_row, uint32_t end_row, Visit visit) const {
    const size_t first = std::min(chunk * chunk_size_, reaches_.size());
    const size_t end = std::min(first + chunk_size_, reaches_.size());
    for (size_t i = first; i < end; ++i) {
      const RayReach& reach = reaches_[i];
      const auto splat = static_cast<uint32_t>(i);
      if (reach.is_around) {
        for (size_t tile = size_t{first_row} * grid_.columns;
             tile < size_t{end_row} * grid_.columns; ++tile) {
          if (cones_[tile].touches(reach.centre, reach.radius)) visit(tile, splat);
        }
        continue;
      }
      forEachTileSpan(reach.ellipse, reach.half_x, reach.half_y, grid_,
                      [&](int64_t row, int64_t left, int64_t right) {
                        if (row < first_row || row >= end_row) return;
                        const size_t start = static_cast<size_t>(row) * grid_.columns;
                        for (int64_t column = left; column <= right; ++column) {
                          visit(start + static_cast<size_t>(column), splat);
                        }
                      });
    }
  }

  const std::vector<RayReach>& reaches_;
  const TileGrid& grid_;
  size_t chunk_size_;
  std::vector<TileCone> cones_;
};

}  // namespace

void forEachRayTileBand(const std::vector<RayReach>& reaches, const View<double>& view,
                        const TileGrid& grid, const std::function<void(const RayTileBand&)>& use) {
  const Lister lister(reaches, view, grid);
  const std::vector<uint64_t> counts = lister.countRows();
  RayTileBand band;
  for (uint32_t first = 0; first < grid.rows;) {
    uint32_t end = first + 1;
    uint64_t pairs = counts[first];
    while (end < grid.rows && pairs + counts[end] <= kMostPairs) pairs += counts[end++];
    lister.list(first, end, band);
    use(band);
    first = end;
  }
}

RayListsBound rayListsBound(uint64_t splat_count, const TileGrid& grid) {
  const uint64_t row = splat_count * grid.columns;
  const uint64_t pairs = std::min(splat_count * grid.tileCount(), std::max(kMostPairs, row));
  return {pairs * sizeof(uint32_t) * 2,  // the array may double while it grows
          grid.tileCount() * (sizeof(TileCone) + (kChunks + 1) * sizeof(uint64_t)) +
              kChunks * grid.rows * sizeof(uint64_t)};
}

}  // namespace stipple
