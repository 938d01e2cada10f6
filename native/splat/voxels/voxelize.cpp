// Based on: the extinction whose line integral is -ln(1 - o exp(-d^2/2)),
// docs/methods/voxelization.md.
#include "splat/voxels/voxelize.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "base/platform/memory.h"
#include "splat/voxels/voxelize_bricks.h"
#include "splat/voxels/voxelize_kernel.h"
#include "splat/voxels/voxelize_splat.h"

namespace stipple {

namespace {

// Some of the splats of a brick. A coarse volume has few bricks with many splats each: parts of
// them, whose bounds do not depend on the number of threads, give every thread something to do.
struct BrickPart {
  size_t brick;
  uint64_t begin;
  uint64_t end;
};

// Of one stored brick: densities, colours, coordinates, key, list offset, cursor, and a part.
constexpr double kBytesPerBrick = kBrickVoxelCount * 4 * sizeof(float) + 2 * sizeof(BrickKey) +
                                  sizeof(uint64_t) + sizeof(uint32_t) + sizeof(BrickPart) +
                                  sizeof(void*);
// A list entry, and a share of the sums of a part.
constexpr size_t kSplatsPerPart = 8192;
constexpr double kBytesPerPair =
    sizeof(uint32_t) + sizeof(BrickSums) / static_cast<double>(kSplatsPerPart);
// While bricks are found, each range of splats holds a list of its own.
constexpr double kBytesPerFoundPair = 2 * sizeof(BrickKey);

std::string mebibytes(double bytes) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.0f MiB", std::ceil(bytes / 1048576.0));
  return text;
}

// No limit still means the memory of this machine: beyond it the system ends the process.
uint64_t effectiveLimit(uint64_t memory_limit_bytes) {
  return std::min(memory_limit_bytes, platform::machineMemory());
}

void requireMemory(double bytes, const char* qualifier, uint64_t limit, double voxel_size) {
  if (bytes <= static_cast<double>(limit)) return;
  fail(ErrorCode::kMemoryLimit, std::string("voxelize needs ") + qualifier + mebibytes(bytes) +
                                    " at a voxel size of " + numberText(voxel_size) + " m; " +
                                    mebibytes(static_cast<double>(limit)) +
                                    " are allowed: use a larger voxel size or fewer splats");
}

uint64_t splatCount(std::span<const SplatInstance> instances) {
  uint64_t count = 0;
  for (const SplatInstance& instance : instances) count += instance.cloud->size();
  return count;
}

// Of the splat, whether it is kept, and its share of the counters of fillBricks.
double splatBytes(uint64_t count) {
  return static_cast<double>(count) * (sizeof(VoxelSplat) + 1 + sizeof(uint32_t));
}

double tableBytes(double bricks, double pairs) {
  return bricks * kBytesPerBrick + pairs * kBytesPerPair;
}

// Removes densities below the threshold, and bricks that have nothing left. Colours stay where
// there was any density, so that interpolation at the rim does not mix with black.
void dropThinBricks(SparseVolume& volume, double min_density) {
  size_t kept = 0;
  for (size_t brick = 0; brick < volume.bricks.size(); ++brick) {
    float* density = &volume.density[brick * kBrickVoxelCount];
    bool any = false;
    for (size_t i = 0; i < kBrickVoxelCount; ++i) {
      if (static_cast<double>(density[i]) < min_density) density[i] = 0.0f;
      any = any || density[i] > 0.0f;
    }
    if (!any) continue;
    if (kept != brick) {
      volume.bricks[kept] = volume.bricks[brick];
      std::copy_n(density, kBrickVoxelCount, &volume.density[kept * kBrickVoxelCount]);
      std::copy_n(&volume.colour[brick * kBrickVoxelCount * 3], kBrickVoxelCount * 3,
                  &volume.colour[kept * kBrickVoxelCount * 3]);
    }
    ++kept;
  }
  volume.bricks.resize(kept);
  volume.density.resize(kept * kBrickVoxelCount);
  volume.colour.resize(kept * kBrickVoxelCount * 3);
}

std::vector<BrickPart> makeParts(const BrickTable& table) {
  std::vector<BrickPart> parts;
  for (size_t brick = 0; brick < table.keys.size(); ++brick) {
    uint64_t begin = table.offsets[brick];
    const uint64_t end = table.offsets[brick + 1];
    for (; end - begin > kSplatsPerPart; begin += kSplatsPerPart) {
      parts.push_back({brick, begin, begin + kSplatsPerPart});
    }
    parts.push_back({brick, begin, end});
  }
  return parts;
}

void storeBrick(const BrickSums& sums, float* density, float* colour) {
  for (size_t i = 0; i < kBrickVoxelCount; ++i) {
    const double total = sums[0][i];
    density[i] = static_cast<float>(total);
    for (size_t channel = 0; channel < 3; ++channel) {
      colour[i * 3 + channel] = total > 0 ? static_cast<float>(sums[channel + 1][i] / total) : 0.0f;
    }
  }
}

// Fills all bricks; the sums of parts are added in their order.
void sumBricks(const BrickTable& table, const std::vector<VoxelSplat>& splats, SparseVolume& volume,
               Progress* progress) {
  const std::vector<BrickPart> parts = makeParts(table);
  const auto is_whole = [&](size_t i) {
    return parts[i].end - parts[i].begin ==
           table.offsets[parts[i].brick + 1] - table.offsets[parts[i].brick];
  };
  const auto store = [&](size_t brick, const BrickSums& sums) {
    storeBrick(sums, &volume.density[brick * kBrickVoxelCount],
               &volume.colour[brick * kBrickVoxelCount * 3]);
  };
  std::vector<std::unique_ptr<BrickSums>> partial(parts.size());
  const BrickKernel add_splats = chosenBrickKernel();
  const auto pair_count = static_cast<double>(table.splats.size());
  std::atomic<uint64_t> pairs_done{0};
  // Few parts are worth a range each; more would only be more calls.
  const size_t grain = parts.size() < 256 ? 1 : 4;
  parallelFor(parts.size(), grain, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    for (size_t i = begin; i < end; ++i) {
      const BrickPart& part = parts[i];
      BrickSums own;
      BrickSums* sums = &own;
      if (is_whole(i)) {
        own = {};
      } else {
        partial[i] = std::make_unique<BrickSums>();
        sums = partial[i].get();
      }
      add_splats(table.keys[part.brick], splats.data(), table.splats.data() + part.begin,
                 part.end - part.begin, *sums);
      if (is_whole(i)) store(part.brick, own);
    }
    const uint64_t step = parts[end - 1].end - parts[begin].begin;
    const uint64_t done = pairs_done.fetch_add(step, std::memory_order_relaxed) + step;
    advance(progress, 0.2 + 0.79 * static_cast<double>(done) / pair_count, "Filling bricks");
  });
  for (size_t i = 0; i < parts.size(); ++i) {
    if (!partial[i]) continue;
    BrickSums& sums = *partial[i];
    for (; i + 1 < parts.size() && parts[i + 1].brick == parts[i].brick; ++i) {
      for (size_t channel = 0; channel < sums.size(); ++channel) {
        for (size_t voxel = 0; voxel < kBrickVoxelCount; ++voxel) {
          sums[channel][voxel] += (*partial[i + 1])[channel][voxel];
        }
      }
    }
    store(parts[i].brick, sums);
  }
}

}  // namespace

SparseVolume voxelize(std::span<const SplatInstance> instances, const VoxelizeOptions& options,
                      uint64_t memory_limit_bytes, Progress* progress) {
  advance(progress, 0.0, "Reading splats");
  SparseVolume volume;
  volume.voxel_size = chooseVoxelSize(instances, options);
  const uint64_t limit = effectiveLimit(memory_limit_bytes);
  double need = splatBytes(splatCount(instances));
  requireMemory(need, "", limit, volume.voxel_size);
  const std::vector<VoxelSplat> splats =
      prepareVoxelSplats(instances, options, volume.voxel_size, progress);

  double least_bricks = 0.0;
  const double least_pairs = leastPairCount(splats, least_bricks);
  requireMemory(need + tableBytes(least_bricks, least_pairs), "at least ", limit,
                volume.voxel_size);
  uint64_t pair_count = 0;
  std::vector<BrickKey> keys =
      findBricks(splats, limit - static_cast<uint64_t>(need), pair_count, progress);
  need += tableBytes(static_cast<double>(keys.size()), static_cast<double>(pair_count));
  requireMemory(need, "", limit, volume.voxel_size);

  advance(progress, 0.15, "Sorting splats into bricks");
  const BrickTable table = fillBricks(splats, std::move(keys), progress);
  const size_t brick_count = table.keys.size();
  volume.bricks.resize(brick_count);
  volume.density.resize(brick_count * kBrickVoxelCount);
  volume.colour.resize(brick_count * kBrickVoxelCount * 3);
  for (size_t i = 0; i < brick_count; ++i) {
    const BrickKey& key = table.keys[i];
    volume.bricks[i] = {key[0] * kBrickSide, key[1] * kBrickSide, key[2] * kBrickSide};
  }
  sumBricks(table, splats, volume, progress);
  dropThinBricks(volume, options.min_density);
  advance(progress, 1.0, "Done");
  return volume;
}

uint64_t voxelizeMemoryBound(std::span<const SplatInstance> instances,
                             const VoxelizeOptions& options) {
  const double voxel_size = chooseVoxelSize(instances, options);
  const std::vector<VoxelSplat> splats =
      prepareVoxelSplats(instances, options, voxel_size, nullptr);
  double need = splatBytes(splatCount(instances));
  double least_bricks = 0.0;
  const double least_pairs = leastPairCount(splats, least_bricks);
  const double least = need + tableBytes(least_bricks, least_pairs);
  const uint64_t physical = effectiveLimit(UINT64_MAX);
  if (least > static_cast<double>(physical)) {
    return least < 1.8e19 ? static_cast<uint64_t>(least) : UINT64_MAX;
  }
  uint64_t pair_count = 0;
  const std::vector<BrickKey> keys = findBricks(splats, physical, pair_count, nullptr);
  need += std::max(tableBytes(static_cast<double>(keys.size()), static_cast<double>(pair_count)),
                   static_cast<double>(pair_count) * kBytesPerFoundPair);
  return static_cast<uint64_t>(std::ceil(need));
}

}  // namespace stipple
