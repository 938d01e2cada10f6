#include "io/volume_surface.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "io/media_library.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 64;
// OpenVDB's copy of a brick with the signs, flags and point indices of its cells.
constexpr uint64_t kBytesPerBrick = kBrickVoxelCount * (4 + 2 + 4 + 4);
// A crossed edge becomes a quad (16 bytes, there and here); of its four cells each has at least
// three such edges, so there are at most 4/3 points (12 bytes, there and here). Then two triangles,
// and 4/3 times 13 bytes to find pieces.
constexpr uint64_t kBytesPerCrossing = 2 * 16 + 2 * 16 + 2 * 12 + 20;

/// Edges of the grid that pass the threshold: exact inside a brick; of those that leave it, counted
/// at their dense end, as many as there may be.
uint64_t mostCrossings(const SparseVolume& volume, float threshold) {
  std::atomic<uint64_t> total{0};
  parallelFor(volume.brickCount(), kGrain, [&](size_t begin, size_t end) {
    uint64_t count = 0;
    for (size_t b = begin; b < end; ++b) {
      const float* density = &volume.density[b * kBrickVoxelCount];
      for (size_t v = 0; v < kBrickVoxelCount; ++v) {
        const bool dense = density[v] > threshold;
        for (const size_t step : {size_t{64}, size_t{8}, size_t{1}}) {
          const size_t place = v / step % 8;
          if (place < 7) count += dense != (density[v + step] > threshold) ? 1 : 0;
          if (dense) count += (place == 0 ? 1 : 0) + (place == 7 ? 1 : 0);
        }
      }
    }
    total.fetch_add(count, std::memory_order_relaxed);
  });
  return total.load();
}

void require(const SparseVolume& volume, double threshold, double adaptivity) {
  if (!(threshold > 0) || !std::isfinite(threshold)) {
    fail(ErrorCode::kInvalidArgument,
         "threshold is " + numberText(threshold, 4) + " per metre; a number above 0 is allowed");
  }
  if (!(adaptivity >= 0 && adaptivity <= 1)) {
    fail(ErrorCode::kInvalidArgument,
         "adaptivity is " + numberText(adaptivity, 4) + "; 0 to 1 is allowed");
  }
  if (volume.density.empty()) {
    fail(ErrorCode::kInvalidArgument,
         "the volume is empty, so it has no surface; at least one voxel with a density is needed");
  }
  const double largest =
      static_cast<double>(*std::max_element(volume.density.begin(), volume.density.end()));
  if (largest <= threshold) {
    // The opacity of one voxel, as artists choose it, beside the density.
    const double opacity = -std::expm1(-largest * volume.voxel_size);
    fail(ErrorCode::kInvalidArgument, "no voxel is as dense as the threshold, " +
                                          numberText(threshold, 4) +
                                          " per metre; the densest has " + numberText(largest, 4) +
                                          " per metre, an opacity of " + numberText(opacity, 4) +
                                          ": choose a threshold below that");
  }
}

}  // namespace

PolygonSurface surfaceOfVolume(const SparseVolume& volume, double threshold, double adaptivity) {
  require(volume, threshold, adaptivity);
  StippleMediaVolume view{};
  view.voxel_size = volume.voxel_size;
  for (size_t axis = 0; axis < 3; ++axis) view.origin[axis] = volume.origin[axis];
  view.brick_count = volume.brickCount();
  view.bricks = volume.bricks.front().data();
  view.density = volume.density.data();
  PolygonSurface surface;
  const MediaSink sink([&surface](uint32_t array, uint64_t bytes) -> void* {
    if (array == kMediaSurfacePoints) {
      surface.points.resize(static_cast<size_t>(bytes / sizeof(float)));
      return surface.points.data();
    }
    static_assert(kNoCorner == kMediaNoCorner);
    surface.faces.resize(static_cast<size_t>(bytes / sizeof(surface.faces[0])));
    return surface.faces.data();
  });
  const StippleMediaTable& media = mediaTable();
  callMedia([&](StippleMediaStatus* status) {
    media.volume_surface(&view, threshold, adaptivity, sink.get(), status);
  });
  return surface;
}

uint64_t surfaceMemoryBound(const SparseVolume& volume, double threshold) {
  return volume.brickCount() * kBytesPerBrick +
         mostCrossings(volume, static_cast<float>(threshold)) * kBytesPerCrossing;
}

}  // namespace stipple
