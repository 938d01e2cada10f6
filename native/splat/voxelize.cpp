// Based on: the extinction whose line integral is -ln(1 - o exp(-d^2/2)),
// docs/methods/voxelization.md.
#include "splat/voxelize.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/voxelize_bricks.h"
#include "splat/voxelize_kernel.h"
#include "splat/voxelize_splat.h"

namespace stipple {

namespace {

// Of one stored brick: densities, colours, coordinates, key, list offset and cursor.
constexpr double kBytesPerBrick = kBrickVoxelCount * 4 * sizeof(float) + 2 * sizeof(BrickKey) +
                                  sizeof(uint64_t) + sizeof(uint32_t);
constexpr double kBytesPerPair = sizeof(uint32_t);
// While bricks are found, each range of splats holds a list of its own.
constexpr double kBytesPerFoundPair = 2 * sizeof(BrickKey);

std::string mebibytes(double bytes) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.0f MiB", std::ceil(bytes / 1048576.0));
  return text;
}

// No limit still means the memory of this machine: beyond it the system ends the process.
uint64_t effectiveLimit(uint64_t memory_limit_bytes) {
  const long pages = sysconf(_SC_PHYS_PAGES);
  const long page_size = sysconf(_SC_PAGE_SIZE);
  if (pages <= 0 || page_size <= 0) return memory_limit_bytes;
  return std::min(memory_limit_bytes,
                  static_cast<uint64_t>(pages) * static_cast<uint64_t>(page_size));
}

void requireMemory(double bytes, const char* qualifier, uint64_t limit, double voxel_size) {
  if (bytes <= static_cast<double>(limit)) return;
  char size[32];
  std::snprintf(size, sizeof(size), "%g", voxel_size);
  fail(ErrorCode::kMemoryLimit, std::string("voxelize needs ") + qualifier + mebibytes(bytes) +
                                    " at a voxel size of " + size + " m; " +
                                    mebibytes(static_cast<double>(limit)) +
                                    " are allowed: use a larger voxel size or fewer splats");
}

uint64_t splatCount(std::span<const SplatInstance> instances) {
  uint64_t count = 0;
  for (const SplatInstance& instance : instances) count += instance.cloud->size();
  return count;
}

double splatBytes(uint64_t count) {
  return static_cast<double>(count) * (sizeof(VoxelSplat) + 1);
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
  const BrickKernel sum_brick = chosenBrickKernel();
  std::atomic<uint64_t> pairs_done{0};
  parallelFor(brick_count, 4, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    for (size_t i = begin; i < end; ++i) {
      const BrickKey& key = table.keys[i];
      volume.bricks[i] = {key[0] * kBrickSide, key[1] * kBrickSide, key[2] * kBrickSide};
      sum_brick(key, splats.data(), table.splats.data() + table.offsets[i],
                table.offsets[i + 1] - table.offsets[i], &volume.density[i * kBrickVoxelCount],
                &volume.colour[i * kBrickVoxelCount * 3]);
    }
    const uint64_t step = table.offsets[end] - table.offsets[begin];
    const uint64_t done = pairs_done.fetch_add(step, std::memory_order_relaxed) + step;
    advance(progress, 0.2 + 0.79 * static_cast<double>(done) / static_cast<double>(pair_count),
            "Filling bricks");
  });
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
