#include "splat/voxels/volume_sides.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "math/colour.h"
#include "splat/random_scene.h"
#include "splat/voxels/voxelize.h"

// Sides of volumes against closed forms, and how they fall with the voxel size.

namespace stipple {
namespace {

/// One brick of density 0 in the middle of negative places.
SparseVolume emptyBrick() {
  SparseVolume volume;
  volume.voxel_size = 0.5;
  volume.origin = {10, 20, 30};
  volume.bricks = {{-8, 0, 8}};
  volume.density.assign(kBrickVoxelCount, 0.0f);
  volume.colour.assign(kBrickVoxelCount * 3, 0.0f);
  return volume;
}

size_t voxel(size_t x, size_t y, size_t z) {
  return (x * kBrickSide + y) * kBrickSide + z;
}

TEST(VolumeSides, AColumnIsWhatLightOfItsVoxelsIsLeftFrontToBack) {
  SparseVolume volume = emptyBrick();
  const float densities[2] = {3.0f, 0.7f};
  const float reds[2] = {0.25f, 0.8f};
  for (size_t i = 0; i < 2; ++i) {
    const size_t at = voxel(2 + 3 * i, 4, 6);  // one behind the other along x
    volume.density[at] = densities[i];
    volume.colour[at * 3] = reds[i];
  }
  const auto sides = sidesOf(volume);
  const double first = std::exp(-3.0 * 0.5), second = std::exp(-double{0.7f} * 0.5);
  double value[4];
  // Along x: across is y, up is z. Voxel (., 4, 6) of the brick is lattice (., 4, 14).
  sides[0].at(20 + 0.5 * 4, 30 + 0.5 * 14, value);
  EXPECT_NEAR(value[3], 1 - first * second, 1e-6);  // float32 of the pixel
  EXPECT_NEAR(value[0], (1 - first) * 0.25 + first * (1 - second) * double{0.8f}, 1e-6);
  EXPECT_EQ(value[1], 0.0);
  // Along z: across is x, up is y. The first alone, at lattice x = -6.
  sides[2].at(10 + 0.5 * -6, 20 + 0.5 * 4, value);
  EXPECT_NEAR(value[3], 1 - first, 1e-6);
  // Halfway to the empty neighbour it is half.
  sides[2].at(10 + 0.5 * -6.5, 20 + 0.5 * 4, value);
  EXPECT_NEAR(value[3], (1 - first) / 2, 1e-6);
  // Along y: across is z, up is x.
  sides[1].at(30 + 0.5 * 14, 10 + 0.5 * -3, value);
  EXPECT_NEAR(value[3], 1 - second, 1e-6);
  sides[1].at(0, 0, value);
  EXPECT_EQ(value[3], 0.0);
}

TEST(VolumeSides, BricksBlendInTheOrderOfTheAxis) {
  SparseVolume volume = emptyBrick();
  volume.bricks = {{-8, 0, 8}, {0, 0, 8}};
  volume.density.assign(2 * kBrickVoxelCount, 0.0f);
  volume.colour.assign(2 * kBrickVoxelCount * 3, 0.0f);
  for (size_t b = 0; b < 2; ++b) {
    const size_t at = b * kBrickVoxelCount + voxel(0, 0, 0);
    volume.density[at] = 100.0f;  // opaque
    volume.colour[at * 3 + b] = 1.0f;
  }
  double value[4];
  sidesOf(volume)[0].at(20, 30 + 0.5 * 8, value);
  EXPECT_NEAR(value[0], 1, 1e-6) << "the brick of smaller x hides the other";
  EXPECT_NEAR(value[1], 0, 1e-6);
}

TEST(VolumeSides, DifferencesAreInDisplayValuesAndSeeWhatOnlyOneHas) {
  SparseVolume volume = emptyBrick();
  volume.density[voxel(0, 0, 0)] = 1.0f;
  volume.colour[voxel(0, 0, 0) * 3 + 2] = 0.5f;
  const auto sides = sidesOf(volume), nothing = sidesOf(emptyBrick());
  const double alpha = 1 - std::exp(-0.5);
  const std::vector<float> same = sideDifferences(sides, sides);
  EXPECT_EQ(std::count(same.begin(), same.end(), 0.0f), static_cast<ptrdiff_t>(same.size()));
  EXPECT_EQ(same.size(), 3u * 9 * 64 * 4) << "three sides, the block and eight around it";
  const std::vector<float> less = sideDifferences(nothing, sides);
  double alphas = 0, blues = 0;
  for (size_t i = 0; i < less.size(); i += 4) {
    blues += static_cast<double>(less[i + 2]);
    alphas += static_cast<double>(less[i + 3]);
  }
  EXPECT_NEAR(alphas, -3 * alpha, 1e-5);
  EXPECT_NEAR(blues, -3 * linearToSrgb(0.5 * alpha), 1e-5);
}

TEST(VolumeSides, ErrorsFallWithTheVoxelSize) {
  const SplatCloud cloud = testing::randomCloud({}, 3);
  const SplatInstance instance = testing::instanceOf(cloud);
  const auto sidesAt = [&](double size) {
    VoxelizeOptions options;
    options.voxel_size = size;
    return sidesOf(voxelize({&instance, 1}, options));
  };
  const auto finest = sidesAt(0.02);
  double last = 1e9;
  for (const double size : {0.16, 0.08, 0.04}) {
    const std::vector<float> differences = sideDifferences(sidesAt(size), finest);
    double squares = 0;
    for (const float d : differences) squares += static_cast<double>(d) * static_cast<double>(d);
    EXPECT_LT(squares, 0.7 * last) << "half the size leaves less of the error";
    EXPECT_GT(squares, 0);
    last = squares;
  }
}

TEST(VolumeSides, NothingHasNoBlocks) {
  SparseVolume volume;
  volume.voxel_size = 1;
  EXPECT_TRUE(sideDifferences(sidesOf(volume), sidesOf(volume)).empty());
}

}  // namespace
}  // namespace stipple
