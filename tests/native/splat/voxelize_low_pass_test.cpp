#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "splat/volume_probe.h"
#include "splat/voxelize_cases.h"
#include "splat/voxels/voxelize.h"
#include "splat/voxels/voxelize_splat.h"

namespace stipple {
namespace {

double dilogarithm(double z) {
  double sum = 0.0;
  for (int k = 4000; k >= 1; --k) sum = (sum + 1.0 / (static_cast<double>(k) * k)) * z;
  return sum;
}

// One voxel is a metre; the splat's third axis is the thin one.
VoxelizeOptions metreVoxels(double low_pass) {
  VoxelizeOptions options;
  options.voxel_size = 1.0;
  options.low_pass = low_pass;
  options.cut_off_sigma = 0.0;
  options.min_density = 1e-9;
  return options;
}

TEST(VoxelizeLowPass, KeepsTheOpticalDepthThroughTheFaceWhereverAThinSplatLies) {
  std::printf("thin splat (6, 6, 0.001 voxels): optical depth through the face over closed form\n");
  std::printf("%8s %14s %8s %8s\n", "opacity", "normal", "least", "most");
  for (const double opacity : {0.3, 0.8, 0.99}) {
    for (const Vec3d& normal : {Vec3d(0, 0, 1), Vec3d(1, 1, 0), Vec3d(0.3, -0.5, 0.8)}) {
      double least = 1e9;
      double most = 0.0;
      for (int step = 0; step < 8; ++step) {
        OneSplat splat;
        splat.scales = Vec3d(6, 6, 0.001);
        splat.opacity = opacity;
        splat.rotation = Eigen::Quaterniond::FromTwoVectors(Vec3d::UnitZ(), normal);
        splat.position = Vec3d(0.2, 0.4, 0.125 * step);
        const SparseVolume volume = voxelizeOne(splat, metreVoxels(0.5));
        const VolumeProbe probe(volume);
        // At one standard deviation, away from the peak that trilinear interpolation rounds off.
        const Vec3d point = splat.position + splat.rotation * Vec3d(6, 0, 0);
        const double ratio =
            probe.opticalDepth(point, normal.normalized(), 12.0) / closedForm(opacity, 1.0);
        least = std::min(least, ratio);
        most = std::max(most, ratio);
      }
      std::printf("%8.2f (%4.1f %4.1f %4.1f) %8.4f %8.4f\n", opacity, normal[0], normal[1],
                  normal[2], least, most);
      // A surface must not open or close with its place on the grid: samples and interpolation
      // together stay within 4 %. One sample per voxel would be off by a factor of up to 3.
      EXPECT_GT(least, 0.95) << opacity << " " << normal.transpose();
      EXPECT_LT(most, 1.05) << opacity << " " << normal.transpose();
    }
  }
}

TEST(VoxelizeLowPass, ThinsObliqueViewsByTheWidenedAxis) {
  OneSplat splat;
  splat.scales = Vec3d(8, 8, 0.01);
  splat.opacity = 0.6;
  splat.position = Vec3d(0.3, 0.1, 0.45);
  const SparseVolume volume = voxelizeOne(splat, metreVoxels(0.5));
  const VolumeProbe probe(volume);
  for (const double degrees : {0.0, 30.0, 60.0, 75.0}) {
    const double angle = degrees * kPi / 180.0;
    const Vec3d w(std::sin(angle), 0.0, std::cos(angle));
    // l_w / l_ref of the widened splat (8, 8, 0.5); the thin one itself would have 1 / cos.
    const double length = 1.0 / w.cwiseQuotient(Vec3d(8, 8, 0.5)).norm();
    const double expected = length / 0.5 * closedForm(0.6, 0.0);
    const double seen = probe.opticalDepth(splat.position, w, 60.0);
    // Interpolation rounds the profile off: the variance of a box and a hat, h^2/12 + h^2/6, over
    // that of the thin axis seen along w; measured 0.5 % face-on, 6 % at 75 degrees.
    EXPECT_NEAR(seen / expected, 1.0, degrees > 70 ? 0.08 : 0.03) << degrees;
  }
}

TEST(VoxelizeLowPass, KeepsOpacityTimesAreaOfSplatsSmallerThanAVoxel) {
  for (const Vec3d& scales : {Vec3d(0.1, 0.2, 0.01), Vec3d(3, 0.05, 0.05), Vec3d(0.3, 0.3, 0.3)}) {
    OneSplat splat;
    splat.scales = scales;
    splat.opacity = 0.9;
    splat.position = Vec3d(0.31, 0.17, -0.23);
    splat.rotation = Eigen::Quaterniond(0.9, 0.2, -0.3, 0.25).normalized();
    const SparseVolume volume = voxelizeOne(splat, metreVoxels(0.5));
    Vec3d sorted = scales;
    std::sort(sorted.data(), sorted.data() + 3);
    const Vec3d wide = sorted.cwiseMax(0.5);
    const double opacity = 0.9 * sorted[1] * sorted[2] / (wide[1] * wide[2]);
    const double expected = 2 * kPi * wide[1] * wide[2] * dilogarithm(opacity);
    // The samples inside a voxel integrate a splat of half a voxel within 1 % at these opacities.
    EXPECT_NEAR(VolumeProbe(volume).mass() / expected, 1.0, 0.01) << scales.transpose();
  }
}

TEST(VoxelizeLowPass, LeavesSplatsWiderThanAVoxelAlone) {
  OneSplat splat;
  splat.scales = Vec3d(1.5, 2.0, 0.6);
  const SparseVolume with = voxelizeOne(splat, metreVoxels(0.5));
  const SparseVolume without = voxelizeOne(splat, metreVoxels(0.0));
  EXPECT_EQ(with.bricks, without.bricks);
  EXPECT_EQ(with.density, without.density);
}

TEST(VoxelizeLowPass, AcceptsAnAxisOfZeroAndWithoutItRefuses) {
  OneSplat flat;
  flat.scales = Vec3d(3, 3, 0);
  OneSplat thin = flat;
  thin.scales = Vec3d(3, 3, 1e-7);
  const SparseVolume a = voxelizeOne(flat, metreVoxels(0.5));
  const SparseVolume b = voxelizeOne(thin, metreVoxels(0.5));
  ASSERT_GT(a.brickCount(), 0u);
  ASSERT_EQ(a.bricks, b.bricks);
  for (size_t i = 0; i < a.density.size(); ++i) {
    // Both are widened to half a voxel; their axes differ by rounding.
    ASSERT_NEAR(a.density[i], b.density[i], 1e-5f * (1 + b.density[i]));
  }
  std::string message;
  EXPECT_EQ(codeOf(makeCloud({OneSplat(), flat}), metreVoxels(0.0), message),
            ErrorCode::kInvalidArgument);
  EXPECT_NE(message.find("splat 1"), std::string::npos) << message;
  EXPECT_NE(message.find("low_pass"), std::string::npos) << message;
  OneSplat line;  // no area: nothing to see
  line.scales = Vec3d(3, 0, 0);
  EXPECT_EQ(voxelizeOne(line, metreVoxels(0.5)).brickCount(), 0u);
}

TEST(VoxelizeLowPass, KeepsTheAxesOfNeedles) {
  const Mat3d u = Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3).normalized().toRotationMatrix();
  const Mat3d v = Eigen::Quaterniond(0.3, -0.7, 0.2, 0.6).normalized().toRotationMatrix();
  const Vec3d lengths(1.0, 1e-3, 1e-6);
  const SplatCloud cloud = makeCloud({OneSplat()});
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() = u * lengths.asDiagonal() * v.transpose();
  const SplatInstance instance{&cloud, matrix};
  const std::vector<VoxelSplat> splats =
      prepareVoxelSplats({&instance, 1}, metreVoxels(0.0), 1.0, nullptr);
  ASSERT_EQ(splats.size(), 1u);
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3d row = splats[0].to_unit.row(axis);
    const double expected = lengths[2 - axis];
    // 1e6 times the rounding of double, in the matrix as in the rotations.
    EXPECT_NEAR(row.norm() * expected, 1.0, 1e-9);
    EXPECT_NEAR(std::abs(row.normalized().dot(u.col(2 - axis))), 1.0, 1e-9);
  }
}

TEST(VoxelizeLowPass, GivesNeedlesFiniteDensitiesAndTheirMass) {
  OneSplat splat;
  splat.scales = Vec3d(20, 2e-5, 2e-5);  // 1e6 : 1
  splat.rotation = Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3).normalized();
  splat.opacity = 0.99;
  const SparseVolume volume = voxelizeOne(splat, metreVoxels(0.5));
  for (const float value : volume.density) ASSERT_TRUE(std::isfinite(value));
  const double opacity = 0.99 * 2e-5 / 0.5;
  const double expected = 2 * kPi * 20 * 0.5 * dilogarithm(opacity);
  // Float scales; min_density drops the faintest tail.
  EXPECT_NEAR(VolumeProbe(volume).mass() / expected, 1.0, 0.01);
}

}  // namespace
}  // namespace stipple
