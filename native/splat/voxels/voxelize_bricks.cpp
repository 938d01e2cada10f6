#include "splat/voxels/voxelize_bricks.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;
constexpr double kSide = kBrickSide;
constexpr double kHalfSide = (kBrickSide - 1) / 2.0;  // centre to outermost voxel centre

int32_t brickOf(double voxel) {
  return static_cast<int32_t>(std::floor(voxel / kSide));
}

// Calls visit(x, y, z) for the bricks that the splat may reach, by x, then y, then z. A brick is
// left out only where the box around it in Mahalanobis space, samples included, is outside the
// reach; so a flat splat meets a layer of bricks, not its bounding box.
template <typename Visit>
void visitBricks(const VoxelSplat& splat, Visit&& visit) {
  // Whole voxels inside the bounding box; none where the splat falls between voxel centres.
  const Vec3d low = (splat.centre - splat.half_extent).array().ceil();
  const Vec3d high = (splat.centre + splat.half_extent).array().floor();
  if ((low.array() > high.array()).any()) return;
  int32_t first[3];
  int32_t last[3];
  for (int axis = 0; axis < 3; ++axis) {
    first[axis] = brickOf(low[axis]);
    last[axis] = brickOf(high[axis]);
  }
  // Half the width of a brick, with its samples, along each unit axis.
  Vec3d half = splat.to_unit.cwiseAbs().rowwise().sum() * kHalfSide;
  for (int axis = 0; axis < 3; ++axis) {
    const double count = splat.samples[axis];
    half[axis] += splat.to_unit.row(axis).norm() * (0.5 * (count - 1.0) / count);
  }
  const double reach2 = splat.reach * splat.reach;
  for (int32_t x = first[0]; x <= last[0]; ++x) {
    for (int32_t y = first[1]; y <= last[1]; ++y) {
      const Vec3d start(x * kSide + kHalfSide, y * kSide + kHalfSide, kHalfSide);
      const Vec3d base = splat.to_unit * (start - splat.centre);
      // Where along z every unit axis is within reach: |base + z step| <= reach + half.
      double from = first[2];
      double to = last[2];
      for (int axis = 0; axis < 3; ++axis) {
        const double step = splat.to_unit(axis, 2) * kSide;
        const double bound = splat.reach + half[axis];
        // Dividing by less could overflow; over 2^29 bricks it moves nothing.
        if (std::abs(step) < 1e-100) {
          if (std::abs(base[axis]) > bound) to = from - 1.0;
          continue;
        }
        const double a = (-bound - base[axis]) / step;
        const double b = (bound - base[axis]) / step;
        from = std::max(from, std::min(a, b));
        to = std::min(to, std::max(a, b));
      }
      if (from > to) continue;
      // One more on each side: the bounds are rounded, the test below decides.
      const auto z_first = std::max(first[2], static_cast<int32_t>(std::floor(from)));
      const auto z_last = std::min(last[2], static_cast<int32_t>(std::ceil(to)));
      for (int32_t z = z_first; z <= z_last; ++z) {
        const Vec3d middle = base + splat.to_unit.col(2) * (z * kSide);
        const Vec3d nearest = (middle.cwiseAbs() - half).cwiseMax(0.0);
        if (nearest.squaredNorm() <= reach2) visit(x, y, z);
      }
    }
  }
}

// Walks a sorted list of keys along with visitBricks: neighbours in z are neighbours in the list.
class KeyCursor {
 public:
  explicit KeyCursor(const std::vector<BrickKey>& keys) : keys_(keys) {}
  size_t find(const BrickKey& key) {
    if (at_ + 1 < keys_.size() && keys_[at_ + 1] == key) return ++at_;
    at_ = static_cast<size_t>(std::lower_bound(keys_.begin(), keys_.end(), key) - keys_.begin());
    return at_;
  }

 private:
  const std::vector<BrickKey>& keys_;
  size_t at_ = 0;
};

void sortUnique(std::vector<BrickKey>& keys) {
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
}

}  // namespace

double leastPairCount(std::span<const VoxelSplat> splats, double& bricks) {
  double total = 0.0;
  bricks = 0.0;
  for (const VoxelSplat& splat : splats) {
    // Lengths of the reach along the principal axes, in bricks.
    const Vec3d reach = splat.to_unit.rowwise().norm().cwiseInverse() * (splat.reach / kSide);
    // The volume, and a line of bricks along the longest side, are covered in any case.
    double least = 4.0 / 3.0 * std::numbers::pi * reach.prod();
    // So is the shadow on each plane; the largest of the three is at least 1/sqrt(3) of the
    // greatest section, whose area is pi times the two longer half axes.
    least = std::max(least, std::numbers::pi / std::numbers::sqrt3 * reach[1] * reach[2]);
    least = std::max(least, 2.0 / std::numbers::sqrt3 * reach[2]);
    // Voxels count by their centres, so up to one voxel of every side can be empty; half is safe
    // for everything larger than a few bricks, and smaller splats are counted one by one.
    least = least < 64.0 ? 0.0 : 0.5 * least;
    total += least;
    bricks = std::max(bricks, least);
  }
  return total;
}

std::vector<BrickKey> findBricks(std::span<const VoxelSplat> splats, uint64_t limit_bytes,
                                 uint64_t& pair_count, Progress* progress) {
  const size_t ranges = rangeCount(splats.size(), kGrain);
  std::vector<std::vector<BrickKey>> found(ranges);
  std::vector<uint64_t> pairs(ranges, 0);
  std::atomic<uint64_t> key_count{0};
  std::atomic<size_t> done{0};
  const auto guard = [&](uint64_t keys) {
    if (keys > limit_bytes / sizeof(BrickKey)) {
      fail(ErrorCode::kMemoryLimit, "voxelize needs more than the limit of " +
                                        std::to_string(limit_bytes >> 20) +
                                        " MiB to list its bricks; use a larger voxel size");
    }
  };
  parallelFor(splats.size(), kGrain, [&](size_t begin, size_t end) {
    std::vector<BrickKey>& keys = found[begin / kGrain];
    uint64_t count = 0;
    size_t compact_at = 1 << 16;
    for (size_t i = begin; i < end; ++i) {
      visitBricks(splats[i], [&](int32_t x, int32_t y, int32_t z) {
        ++count;
        keys.push_back({x, y, z});
        if (keys.size() >= compact_at) {
          // Neighbouring splats share bricks: keep the list near the number of distinct ones.
          if (progress) progress->throwIfCancelled();
          sortUnique(keys);
          guard(key_count.load(std::memory_order_relaxed) + keys.size());
          compact_at = std::max(compact_at, keys.size() * 2);
        }
      });
    }
    sortUnique(keys);
    keys.shrink_to_fit();
    pairs[begin / kGrain] = count;
    guard(key_count += keys.size());
    const size_t ready = ++done;
    if (progress) {
      progress->advance(0.05 + 0.1 * static_cast<double>(ready) / static_cast<double>(ranges),
                        "Finding bricks");
    }
  });
  pair_count = 0;
  for (const uint64_t count : pairs) pair_count += count;
  // Merge pairs of lists, half as many each time, so that the merging runs in parallel too.
  for (size_t stride = 1; stride < ranges; stride *= 2) {
    parallelFor(rangeCount(ranges, stride * 2), 1, [&](size_t begin, size_t) {
      if (progress) progress->throwIfCancelled();
      const size_t left = begin * stride * 2;
      const size_t right = left + stride;
      if (right >= ranges) return;
      std::vector<BrickKey> merged;
      merged.reserve(found[left].size() + found[right].size());
      std::set_union(found[left].begin(), found[left].end(), found[right].begin(),
                     found[right].end(), std::back_inserter(merged));
      found[left] = std::move(merged);
      found[right] = {};
    });
  }
  return ranges == 0 ? std::vector<BrickKey>() : std::move(found[0]);
}

namespace {

// Each range of splats counts and fills on its own, range by range in a brick's list: lists grow by
// themselves, and no two threads write to one counter. Counters take 4 bytes a range and brick.
void fillByRanges(std::span<const VoxelSplat> splats, BrickTable& table, Progress* progress) {
  const size_t brick_count = table.keys.size();
  const size_t ranges = rangeCount(splats.size(), kGrain);
  std::vector<uint32_t> counts(ranges * brick_count, 0);  // [range, brick]; then places
  const auto visit_range = [&](size_t begin, size_t end, auto&& visit) {
    if (progress) progress->throwIfCancelled();
    KeyCursor cursor(table.keys);
    uint32_t* own = counts.data() + begin / kGrain * brick_count;
    for (size_t i = begin; i < end; ++i) {
      visitBricks(splats[i], [&](int32_t x, int32_t y, int32_t z) {
        const size_t brick = cursor.find({x, y, z});
        visit(i, brick, own[brick]);
      });
    }
  };
  parallelFor(splats.size(), kGrain, [&](size_t begin, size_t end) {
    visit_range(begin, end, [](size_t, size_t, uint32_t& count) { ++count; });
  });
  for (size_t brick = 0; brick < brick_count; ++brick) {
    uint32_t place = 0;  // in the brick's list; a splat is in it once, so 32 bits are enough
    for (size_t range = 0; range < ranges; ++range) {
      place += std::exchange(counts[range * brick_count + brick], place);
    }
    table.offsets[brick + 1] = table.offsets[brick] + place;
  }
  table.splats.resize(table.offsets[brick_count]);
  parallelFor(splats.size(), kGrain, [&](size_t begin, size_t end) {
    visit_range(begin, end, [&](size_t i, size_t brick, uint32_t& place) {
      table.splats[table.offsets[brick] + place++] = static_cast<uint32_t>(i);
    });
  });
}

}  // namespace

BrickTable fillBricks(std::span<const VoxelSplat> splats, std::vector<BrickKey> keys,
                      Progress* progress) {
  BrickTable table;
  table.keys = std::move(keys);
  const size_t brick_count = table.keys.size();
  table.offsets.assign(brick_count + 1, 0);
  if (brick_count <= kFewBricks) {
    fillByRanges(splats, table, progress);
    return table;
  }
  std::vector<std::atomic<uint32_t>> cursors(brick_count);
  parallelFor(splats.size(), kGrain, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    KeyCursor cursor(table.keys);
    for (size_t i = begin; i < end; ++i) {
      visitBricks(splats[i], [&](int32_t x, int32_t y, int32_t z) {
        cursors[cursor.find({x, y, z})].fetch_add(1, std::memory_order_relaxed);
      });
    }
  });
  for (size_t i = 0; i < brick_count; ++i) {
    table.offsets[i + 1] = table.offsets[i] + cursors[i].exchange(0, std::memory_order_relaxed);
  }
  table.splats.resize(table.offsets[brick_count]);
  parallelFor(splats.size(), kGrain, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    KeyCursor cursor(table.keys);
    for (size_t i = begin; i < end; ++i) {
      visitBricks(splats[i], [&](int32_t x, int32_t y, int32_t z) {
        const size_t brick = cursor.find({x, y, z});
        const uint32_t at = cursors[brick].fetch_add(1, std::memory_order_relaxed);
        table.splats[table.offsets[brick] + at] = static_cast<uint32_t>(i);
      });
    }
  });
  // Threads fill a brick in any order; sorted, its sum has one order.
  parallelFor(brick_count, 256, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::sort(table.splats.begin() + static_cast<ptrdiff_t>(table.offsets[i]),
                table.splats.begin() + static_cast<ptrdiff_t>(table.offsets[i + 1]));
    }
  });
  return table;
}

}  // namespace stipple
