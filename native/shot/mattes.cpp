#include "shot/mattes.h"

#include <algorithm>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

/// Samples that are held at a time: 64 MB.
constexpr uint64_t kMaxSamplesHeld = 16000000;

/// The camera of rows first .. first + count of a picture, with side x side pixels for each.
Camera finerRows(const Camera& camera, uint32_t first, uint32_t count, uint32_t side) {
  Camera part = camera;
  part.width = camera.width * side;
  part.height = count * side;
  part.fx = camera.fx * side;
  part.fy = camera.fy * side;
  part.cx = camera.cx * side;
  part.cy = (camera.cy - first) * side;
  return part;
}

uint32_t rowsAtATime(const Camera& camera, uint32_t side) {
  const uint64_t samples = uint64_t{camera.width} * side * side;
  return static_cast<uint32_t>(std::clamp<uint64_t>(kMaxSamplesHeld / samples, 1, camera.height));
}

/// Folds the samples [count * side, width * side] of some rows.
void fold(const std::vector<float>& samples, uint32_t width, uint32_t count, uint32_t side,
          float* depth, float* opacity) {
  const float all = static_cast<float>(side * side);
  parallelFor(count, 16, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      for (size_t x = 0; x < width; ++x) {
        float nearest = kEmptyDepth;
        uint32_t hits = 0;
        for (size_t row = 0; row < side; ++row) {
          const float* sample = &samples[((y * side + row) * width + x) * side];
          for (size_t column = 0; column < side; ++column) {
            nearest = std::min(nearest, sample[column]);
            hits += sample[column] < kEmptyDepth ? 1 : 0;
          }
        }
        depth[y * width + x] = nearest;
        opacity[y * width + x] = static_cast<float>(hits) / all;
      }
    }
  });
}

}  // namespace

void validateMatte(const Camera& camera, uint32_t side) {
  if (side < 1 || side > kMaxMatteSide) {
    fail(ErrorCode::kInvalidArgument,
         "the samples per side of a matte are " + std::to_string(side) + "; 1 to 16 is allowed");
  }
  validate(camera);
  requireImagePlane(camera, "a matte of meshes");
  validate(finerRows(camera, 0, camera.height, side));
}

void drawMatte(std::span<const MeshInstance> instances, const Camera& camera, uint32_t side,
               std::span<float> depth, std::span<float> opacity, Progress* progress) {
  validateMatte(camera, side);
  const size_t pixel_count = size_t{camera.width} * camera.height;
  if (depth.size() != pixel_count || opacity.size() != pixel_count) {
    fail(ErrorCode::kInvalidArgument, "the matte's arrays hold " + std::to_string(depth.size()) +
                                          " and " + std::to_string(opacity.size()) + " values; " +
                                          std::to_string(pixel_count) + " are needed");
  }
  const uint32_t rows = rowsAtATime(camera, side);
  std::vector<float> samples;
  for (uint32_t first = 0; first < camera.height; first += rows) {
    const uint32_t count = std::min(rows, camera.height - first);
    samples.resize(size_t{camera.width} * count * side * side);
    if (progress) {
      progress->enterPart(static_cast<double>(first) / camera.height,
                          static_cast<double>(first + count) / camera.height);
    }
    drawMeshDepth(instances, finerRows(camera, first, count, side), samples, progress);
    const size_t begin = size_t{first} * camera.width;
    fold(samples, camera.width, count, side, &depth[begin], &opacity[begin]);
  }
  if (progress) progress->enterPart(0, 1);
}

uint64_t matteMemoryBound(std::span<const MeshInstance> instances, const Camera& camera,
                          uint32_t side) {
  const uint64_t rows = rowsAtATime(camera, std::clamp<uint32_t>(side, 1, kMaxMatteSide));
  return meshDepthMemoryBound(instances) +
         uint64_t{camera.width} * rows * side * side * sizeof(float);
}

}  // namespace stipple
