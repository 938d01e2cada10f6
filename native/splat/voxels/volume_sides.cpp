#include "splat/voxels/volume_sides.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "base/parallel.h"
#include "math/colour.h"

namespace stipple {

namespace {

constexpr size_t kSide = kBrickSide;
constexpr size_t kBlockValues = kSide * kSide * 4;

using Block = std::array<int32_t, 2>;

/// Index of a voxel of a brick from its place along an axis and across it.
size_t voxelOf(size_t axis, size_t along, size_t across, size_t up) {
  size_t place[3];
  place[axis] = along;
  place[(axis + 1) % 3] = across;
  place[(axis + 2) % 3] = up;
  return (place[0] * kSide + place[1]) * kSide + place[2];
}

Block blockOf(const std::array<int32_t, 3>& brick, size_t axis) {
  return {brick[(axis + 1) % 3] / kBrickSide, brick[(axis + 2) % 3] / kBrickSide};
}

/// Columns of a brick behind what its block has so far. In and out: pixels [8,8,4], light [8,8]
/// that comes through.
void blendBrick(const SparseVolume& volume, size_t brick, size_t axis, float* pixels,
                double* light) {
  const float* density = &volume.density[brick * kBrickVoxelCount];
  const float* colour = &volume.colour[brick * kBrickVoxelCount * 3];
  for (size_t up = 0; up < kSide; ++up) {
    for (size_t across = 0; across < kSide; ++across) {
      double& through = light[up * kSide + across];
      float* pixel = pixels + (up * kSide + across) * 4;
      for (size_t along = 0; along < kSide; ++along) {
        const size_t voxel = voxelOf(axis, along, across, up);
        const double depth = static_cast<double>(density[voxel]) * volume.voxel_size;
        if (!(depth > 0)) continue;
        const double weight = through * -std::expm1(-depth);
        for (size_t c = 0; c < 3; ++c) {
          pixel[c] += static_cast<float>(weight * static_cast<double>(colour[voxel * 3 + c]));
        }
        through *= std::exp(-depth);
      }
      pixel[3] = static_cast<float>(1 - through);
    }
  }
}

VolumeSide sideOf(const SparseVolume& volume, size_t axis) {
  VolumeSide side;
  side.pixel_size = volume.voxel_size;
  side.origin[0] = volume.origin[(axis + 1) % 3];
  side.origin[1] = volume.origin[(axis + 2) % 3];
  std::vector<size_t> order(volume.brickCount());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    const Block first = blockOf(volume.bricks[a], axis), second = blockOf(volume.bricks[b], axis);
    return first != second ? first < second : volume.bricks[a][axis] < volume.bricks[b][axis];
  });
  std::vector<size_t> starts;  // of blocks, in `order`
  for (size_t i = 0; i < order.size(); ++i) {
    const Block block = blockOf(volume.bricks[order[i]], axis);
    if (!side.blocks.empty() && side.blocks.back() == block) continue;
    side.blocks.push_back(block);
    starts.push_back(i);
  }
  starts.push_back(order.size());
  side.pixels.assign(side.blocks.size() * kBlockValues, 0.0f);
  parallelFor(side.blocks.size(), 16, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) {
      double light[kSide * kSide];
      std::fill(std::begin(light), std::end(light), 1.0);
      for (size_t i = starts[b]; i < starts[b + 1]; ++i) {
        blendBrick(volume, order[i], axis, &side.pixels[b * kBlockValues], light);
      }
    }
  });
  return side;
}

/// Channel of a pixel as it is shown.
double shown(double value, size_t channel) {
  return channel == 3 ? value : linearToSrgb(value);
}

/// The blocks of a side and all around them.
std::vector<Block> withNeighbours(const std::vector<Block>& blocks) {
  std::vector<Block> all;
  all.reserve(blocks.size() * 9);
  for (const Block& block : blocks) {
    for (int32_t x = -1; x <= 1; ++x) {
      for (int32_t y = -1; y <= 1; ++y) all.push_back({block[0] + x, block[1] + y});
    }
  }
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

}  // namespace

void VolumeSide::at(double across, double up, double* value) const {
  std::fill(value, value + 4, 0.0);
  const double x = (across - origin[0]) / pixel_size, y = (up - origin[1]) / pixel_size;
  const double x0 = std::floor(x), y0 = std::floor(y);
  for (int corner = 0; corner < 4; ++corner) {
    const auto column = static_cast<int64_t>(x0) + corner % 2;
    const auto row = static_cast<int64_t>(y0) + corner / 2;
    const double weight =
        (corner % 2 == 0 ? 1 - (x - x0) : x - x0) * (corner / 2 == 0 ? 1 - (y - y0) : y - y0);
    if (weight == 0) continue;
    // Blocks begin at multiples of 8, below 0 too.
    const Block block = {static_cast<int32_t>(column >> 3), static_cast<int32_t>(row >> 3)};
    const auto found = std::lower_bound(blocks.begin(), blocks.end(), block);
    if (found == blocks.end() || *found != block) continue;
    const size_t pixel = static_cast<size_t>(row & 7) * kSide + static_cast<size_t>(column & 7);
    const float* values =
        &pixels[static_cast<size_t>(found - blocks.begin()) * kBlockValues + pixel * 4];
    for (size_t c = 0; c < 4; ++c) value[c] += weight * static_cast<double>(values[c]);
  }
}

std::array<VolumeSide, 3> sidesOf(const SparseVolume& volume) {
  return {sideOf(volume, 0), sideOf(volume, 1), sideOf(volume, 2)};
}

std::vector<float> sideDifferences(const std::array<VolumeSide, 3>& sides,
                                   const std::array<VolumeSide, 3>& finer) {
  std::vector<float> differences;
  for (size_t axis = 0; axis < 3; ++axis) {
    const VolumeSide& judge = finer[axis];
    const std::vector<Block> blocks = withNeighbours(judge.blocks);
    const size_t first = differences.size();
    differences.resize(first + blocks.size() * kBlockValues);
    parallelFor(blocks.size(), 16, [&](size_t begin, size_t end) {
      for (size_t b = begin; b < end; ++b) {
        for (size_t i = 0; i < kSide * kSide; ++i) {
          const double across =
              judge.origin[0] +
              judge.pixel_size * (blocks[b][0] * kBrickSide + static_cast<double>(i % kSide));
          const double up = judge.origin[1] + judge.pixel_size * (blocks[b][1] * kBrickSide +
                                                                  static_cast<double>(i / kSide));
          double value[4], wanted[4];
          sides[axis].at(across, up, value);
          judge.at(across, up, wanted);
          for (size_t c = 0; c < 4; ++c) {
            differences[first + (b * kSide * kSide + i) * 4 + c] =
                static_cast<float>(shown(value[c], c) - shown(wanted[c], c));
          }
        }
      }
    });
  }
  return differences;
}

}  // namespace stipple
