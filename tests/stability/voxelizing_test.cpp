#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "splat/voxelize_cases.h"
#include "splat/voxels/voxelize.h"
#include "splat/voxels/voxelize_polylog.h"

// Splats that are hard to put on a grid, with traps on; the values are judged by the formula in
// double.

namespace stipple {
namespace {

// Compares every voxel with the formula. One sample per voxel is asked for: each axis of the splat
// has at least eight voxels where the formula is to hold.
void expectFormula(const OneSplat& splat, const VoxelizeOptions& options) {
  const SplatCloud cloud = makeCloud({splat});
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  const SparseVolume volume = voxelize({&instance, 1}, options);
  ASSERT_GT(volume.brickCount(), 0u);
  const Mat3d turn = splat.rotation.toRotationMatrix().transpose();
  const Vec3d centre(cloud.positions[0], cloud.positions[1], cloud.positions[2]);
  const Vec3d scales(cloud.scales[0], cloud.scales[1], cloud.scales[2]);
  for (size_t i = 0; i < volume.density.size(); ++i) {
    const auto& brick = volume.bricks[i / kBrickVoxelCount];
    const int at = static_cast<int>(i % kBrickVoxelCount);
    const Vec3d point =
        volume.voxel_size * Vec3d(brick[0] + at / 64, brick[1] + at / 8 % 8, brick[2] + at % 8);
    const Vec3d unit = (turn * (point - centre)).cwiseQuotient(scales);
    const double seen = static_cast<double>(volume.density[i]);
    ASSERT_TRUE(std::isfinite(seen));
    if (unit.norm() > 3.9) continue;  // the cut-off is at 4
    const double z = usedOpacity(splat.opacity) * std::exp(-0.5 * unit.squaredNorm());
    const double expected = polylogHalf(z) / (std::sqrt(2 * kPi) * scales.minCoeff());
    // Float coordinates inside the brick, magnified by 1/sqrt(1 - z) where z nears 0.99; below
    // 1e-38 floats lose digits.
    ASSERT_NEAR(seen, expected, expected * 2e-5 + 1e-38) << point.transpose();
  }
}

VoxelizeOptions unfiltered(double voxel_size) {
  VoxelizeOptions options = exactOptions(voxel_size);
  options.cut_off_sigma = 4.0;
  return options;
}

TEST(Voxelizing, HoldsTheFormulaFromTheSmallestToTheLargestVoxel) {
  for (const double size : {1e-12, 1e-6, 1.0, 1e6, 1e12}) {
    SCOPED_TRACE(size);
    OneSplat splat;
    splat.scales = size * Vec3d(8, 9, 12);
    splat.position = size * Vec3d(0.3, -2.2, 5.1);
    for (const double opacity : {1e-30, 0.5, 1.0}) {
      splat.opacity = opacity;
      expectFormula(splat, unfiltered(size));
    }
  }
}

TEST(Voxelizing, StaysFiniteForEveryMixOfExtremeScales) {
  constexpr float kLeast = std::numeric_limits<float>::denorm_min();
  for (const double a : {0.0, static_cast<double>(kLeast), 1e-6, 1.0, 300.0}) {
    for (const double b : {0.0, static_cast<double>(kLeast), 1e-6, 1.0}) {
      for (const double c : {0.0, 1e-30, 1e-6, 1.0}) {
        OneSplat splat;
        splat.scales = Vec3d(a, b, c);
        splat.rotation = Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3).normalized();
        splat.opacity = 0.99;
        VoxelizeOptions options;
        options.voxel_size = 1.0;
        const SparseVolume volume = voxelizeOne(splat, options);
        for (const float value : volume.density) ASSERT_TRUE(std::isfinite(value));
        for (const float value : volume.colour) ASSERT_TRUE(std::isfinite(value));
        // A disc wider than a voxel is there, however thin.
        const int wide = (a >= 1) + (b >= 1) + (c >= 1);
        if (wide >= 2) {
          EXPECT_GT(volume.brickCount(), 0u) << splat.scales.transpose();
        }
      }
    }
  }
}

TEST(Voxelizing, RefusesOrDrawsHugeSplatsWithoutATrap) {
  for (const double scale : {1e9, 1e30, 3e38}) {
    for (const double size : {1e-12, 1.0, 1e12}) {
      OneSplat splat;
      splat.scales = Vec3d(scale, 1.0, scale);
      VoxelizeOptions options;
      options.voxel_size = size;
      options.min_density = 1e-300;
      options.cut_off_sigma = 1e300;
      std::string message;
      const ErrorCode code = codeOf(makeCloud({splat}), options, message, 256 << 20);
      // 1e9 m on voxels of 1e12 m is a single dot; everything else leaves the grid or the memory.
      if (scale == 1e9 && size == 1e12) {
        EXPECT_EQ(message, "no error");
      } else {
        EXPECT_TRUE(code == ErrorCode::kInvalidArgument || code == ErrorCode::kMemoryLimit)
            << scale << " " << size << ": " << message;
      }
    }
  }
}

TEST(Voxelizing, HoldsTheFormulaForADiscOfOneToAMillion) {
  OneSplat splat;
  splat.scales = Vec3d(8e6, 8.0, 8e6);
  splat.opacity = 0.9;
  // Only the face fits in memory: the splat is seen through a cut-off of a few voxels.
  VoxelizeOptions options = unfiltered(1.0);
  options.cut_off_sigma = 1e-5;
  const SplatCloud cloud = makeCloud({splat});
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  const SparseVolume volume = voxelize({&instance, 1}, options);
  const double expected = polylogHalf(usedOpacity(0.9)) / (std::sqrt(2 * kPi) * 8.0);
  size_t count = 0;
  for (const float value : volume.density) {
    if (value == 0.0f) continue;
    ++count;
    ASSERT_NEAR(static_cast<double>(value), expected, expected * 1e-5);
  }
  // A disc of radius 80 voxels in the one layer y = 0.
  EXPECT_NEAR(static_cast<double>(count), kPi * 80 * 80, 0.02 * kPi * 80 * 80);
}

}  // namespace
}  // namespace stipple
