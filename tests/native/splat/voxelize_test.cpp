#include "splat/voxels/voxelize.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "math/colour.h"
#include "splat/volume_probe.h"
#include "splat/voxelize_cases.h"
#include "splat/voxels/voxelize_polylog.h"

namespace stipple {
namespace {

// ---- the polylogarithm -----------------------------------------------------------------------

double polylogBySeries(double z) {
  // 4096 terms at z = 0.99 leave 0.99^4096 / sqrt(4096) / 0.01 = 2e-18.
  long double sum = 0.0L;
  for (int k = 4096; k >= 1; --k) {
    sum = sum * static_cast<long double>(z) + 1.0L / std::sqrt(static_cast<long double>(k));
  }
  return static_cast<double>(sum * static_cast<long double>(z));
}

TEST(PolylogHalf, EqualsItsPowerSeries) {
  for (int i = 1; i <= 990; ++i) {
    const double z = i * 1e-3;
    const double expected = polylogBySeries(z);
    // Rounding of the double sum; at 0.99, 1/sqrt(-ln z) magnifies the last bit of ln z by 50.
    EXPECT_NEAR(polylogHalf(z) / expected, 1.0, 1e-14) << z;
  }
  EXPECT_EQ(polylogHalf(0.0), 0.0);
  EXPECT_DOUBLE_EQ(polylogHalf(1e-30), 1e-30);
}

TEST(PolylogHalf, IsMatchedByThePolynomialOfTheKernel) {
  double worst = 0.0;
  for (int i = 1; i <= 9900; ++i) {
    const double z = i * 1e-4;
    const double s = std::sqrt(1.0 - z);
    double p = 0.0;
    for (int k = kPolylogDegree; k >= 0; --k) {
      p = p * s + static_cast<double>(kPolylogCoefficients[k]);
    }
    worst = std::max(worst, std::abs(z * p / s / polylogHalf(z) - 1.0));
  }
  // 4.4e-8 of the polynomial and half a unit in the last place of nine float coefficients whose
  // sizes add up to 8: at most 8 * 3e-8.
  EXPECT_LT(worst, 3e-7);
}

// ---- the formula -----------------------------------------------------------------------------

TEST(Voxelize, GivesTheExtinctionOfTheFormulaAtVoxelCentres) {
  OneSplat splat;
  splat.position = Vec3d(0.37, -1.21, 2.55);
  splat.rotation = Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3).normalized();
  splat.scales = Vec3d(0.9, 0.55, 0.7);
  splat.opacity = 0.9;
  // The thinnest axis has 5.5 voxels, so one sample per voxel is enough.
  const SparseVolume volume = voxelizeOne(splat, exactOptions(0.1));
  ASSERT_GT(volume.brickCount(), 0u);
  const SplatCloud cloud = makeCloud({splat});
  const Eigen::Quaterniond q(cloud.rotations[0], cloud.rotations[1], cloud.rotations[2],
                             cloud.rotations[3]);
  const Mat3d turn = q.normalized().toRotationMatrix().transpose();
  const Vec3d centre(cloud.positions[0], cloud.positions[1], cloud.positions[2]);
  const Vec3d scales(cloud.scales[0], cloud.scales[1], cloud.scales[2]);
  for (size_t brick = 0; brick < volume.brickCount(); ++brick) {
    for (int i = 0; i < kBrickVoxelCount; ++i) {
      const Vec3d point =
          0.1 * Vec3d(volume.bricks[brick][0] + i / 64, volume.bricks[brick][1] + i / 8 % 8,
                      volume.bricks[brick][2] + i % 8);
      const Vec3d unit = (turn * (point - centre)).cwiseQuotient(scales);
      const double z = usedOpacity(0.9) * std::exp(-0.5 * unit.squaredNorm());
      const double expected = polylogHalf(z) / (std::sqrt(2 * kPi) * scales.minCoeff());
      const double seen =
          static_cast<double>(volume.density[brick * kBrickVoxelCount + static_cast<size_t>(i)]);
      // Float coordinates inside a brick: m^2/2 carries 1e-6 of its size, up to 86 in the tail.
      ASSERT_NEAR(seen, expected, expected * 1e-4 + 1e-36) << point.transpose();
      if (unit.norm() < 3) {
        ASSERT_NEAR(seen, expected, expected * 1e-5) << point.transpose();
      }
    }
  }
}

TEST(Voxelize, GivesRoundSplatsTheClosedFormOfOpticalDepthAsVoxelsShrink) {
  const std::vector<Vec3d> directions = fibonacciSphere(16);
  std::printf("round splat: error of the optical depth, 16 directions x 6 distances\n");
  std::printf("%8s %10s %12s %12s %12s\n", "opacity", "h/sigma", "mean |error|", "max |error|",
              "mean in alpha");
  for (const double opacity : {0.1, 0.5, 0.9, 0.99}) {
    double previous = 0.0;
    for (const double h : {1.0, 0.5, 0.25, 0.125}) {
      OneSplat splat;
      splat.position = Vec3d(0.31, 0.17, -0.23);  // no symmetry with the grid
      splat.opacity = opacity;
      const SparseVolume volume = voxelizeOne(splat, exactOptions(h));
      const VolumeProbe probe(volume);
      double worst = 0.0;
      double sum = 0.0;
      double alpha_sum = 0.0;
      int count = 0;
      for (const Vec3d& w : directions) {
        const Vec3d side = w.unitOrthogonal();
        for (const double d : {0.0, 0.3, 0.8, 1.5, 2.2, 3.0}) {
          const double seen = probe.opticalDepth(splat.position + side * d, w, 9.0);
          const double expected = closedForm(opacity, d);
          const double error = std::abs(seen - expected);
          alpha_sum += std::abs(std::exp(-seen) - std::exp(-expected));
          worst = std::max(worst, error);
          sum += error;
          ++count;
        }
      }
      const double mean = sum / count;
      std::printf("%8.2f %10.3f %12.2e %12.2e %12.2e\n", opacity, h, mean, worst,
                  alpha_sum / count);
      // Trilinear interpolation is of second order: a quarter per halving once the voxels resolve
      // the core of the splat (0.14 sigma wide at opacity 0.99), somewhat less before.
      const double allowed = h < 0.2 ? 0.4 : 0.65;
      if (previous > 0) {
        EXPECT_LT(mean, previous * allowed) << opacity << " " << h;
      }
      previous = mean;
    }
    // Measured 0.12 % to 0.9 % of the depth through the centre; the last at opacity 0.99.
    EXPECT_LT(previous, 0.01 * closedForm(opacity, 0.0)) << opacity;
  }
}

TEST(Voxelize, FollowsTheLengthRatioLawForStretchedSplats) {
  const std::vector<Vec3d> directions = fibonacciSphere(64);
  std::printf("stretched splats: largest relative error at the centre over 64 directions\n");
  std::printf("%18s %10s %12s %12s\n", "scales", "h/l_ref", "mean", "max");
  for (const Vec3d& scales : {Vec3d(1, 1, 4), Vec3d(1, 3, 4), Vec3d(1, 1.5, 2.5)}) {
    double previous = 0.0;
    for (const double h : {1.0, 0.5, 0.25}) {
      OneSplat splat;
      splat.position = Vec3d(0.31, 0.17, -0.23);
      splat.rotation = Eigen::Quaterniond(0.9, 0.2, -0.3, 0.25).normalized();
      splat.scales = scales;
      splat.opacity = 0.7;
      const SparseVolume volume = voxelizeOne(splat, exactOptions(h));
      const VolumeProbe probe(volume);
      const Mat3d turn = splat.rotation.toRotationMatrix().transpose();
      double worst = 0.0;
      double sum = 0.0;
      for (const Vec3d& w : directions) {
        const double length = 1.0 / (turn * w).cwiseQuotient(scales).norm();
        const double expected = length / scales.minCoeff() * closedForm(0.7, 0.0);
        const double seen = probe.opticalDepth(splat.position, w, 8.0 * length);
        const double error = std::abs(seen / expected - 1.0);
        worst = std::max(worst, error);
        sum += error;
      }
      const double mean = sum / static_cast<double>(directions.size());
      std::printf("  (%3.1f %3.1f %3.1f)    %10.3f %12.2e %12.2e\n", scales[0], scales[1],
                  scales[2], h, mean, worst);
      // Second order; 0.35 leaves room for the two coarsest sizes.
      if (previous > 0) {
        EXPECT_LT(mean, previous * 0.35);
      }
      previous = mean;
    }
    // At the centre, where the depth is most curved: h^2/12 of its Laplacian is 1.2 % for 0.7.
    EXPECT_LT(previous, 0.015);
  }
}

TEST(Voxelize, AddsDensitiesAndMeansColoursByDensity) {
  OneSplat a;
  a.scales = Vec3d::Constant(0.5);
  a.dc = Vec3d(1, 0, -3);
  OneSplat b = a;
  b.position = Vec3d(0.6, 0.1, 0);
  b.opacity = 0.8;
  b.dc = Vec3d(-1, 2, 0.5);
  const VoxelizeOptions options = exactOptions(0.1);
  const SplatCloud both = makeCloud({a, b}, ColourSpace::kDisplay);
  const SplatInstance instance{&both, Mat4d::Identity()};
  const SparseVolume sum = voxelize({&instance, 1}, options);
  const SparseVolume only_a = voxelizeOne(a, options);
  const SparseVolume only_b = voxelizeOne(b, options);
  const VolumeProbe probe_a(only_a);
  const VolumeProbe probe_b(only_b);
  const double c0 = static_cast<double>(kShC0);
  for (size_t brick = 0; brick < sum.brickCount(); ++brick) {
    for (int i = 0; i < kBrickVoxelCount; ++i) {
      const size_t at = brick * kBrickVoxelCount + static_cast<size_t>(i);
      const int32_t x = sum.bricks[brick][0] + i / 64;
      const int32_t y = sum.bricks[brick][1] + i / 8 % 8;
      const int32_t z = sum.bricks[brick][2] + i % 8;
      const double density_a = probe_a.voxel(x, y, z);
      const double density_b = probe_b.voxel(x, y, z);
      if (density_a + density_b < 1e-6) continue;
      // One float rounding of each part and of the sum.
      ASSERT_NEAR(static_cast<double>(sum.density[at]), density_a + density_b,
                  1e-6 * (density_a + density_b));
      for (int channel = 0; channel < 3; ++channel) {
        const double colour_a = srgbToLinear(std::max(0.0, 0.5 + c0 * a.dc[channel]));
        const double colour_b = srgbToLinear(std::max(0.0, 0.5 + c0 * b.dc[channel]));
        const double expected =
            (density_a * colour_a + density_b * colour_b) / (density_a + density_b);
        // Float powers of the transfer function.
        ASSERT_NEAR(static_cast<double>(sum.colour[at * 3 + static_cast<size_t>(channel)]),
                    expected, 2e-6);
      }
    }
  }
}

TEST(Voxelize, AppliesTheMatrixOfTheInstance) {
  OneSplat splat;
  splat.scales = Vec3d(0.2, 0.3, 0.4);
  splat.position = Vec3d(0.5, 0.25, -0.125);
  const SplatCloud cloud = makeCloud({splat});
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() << 2, 0.5, 0, 0, 1.5, 0.25, -0.5, 0, 3;  // scale and shear
  matrix.topRightCorner<3, 1>() << 10, -20, 30;
  const SplatInstance instance{&cloud, matrix};
  const SparseVolume volume = voxelize({&instance, 1}, exactOptions(0.05));
  const VolumeProbe probe(volume);
  const Mat3d axes = matrix.topLeftCorner<3, 3>() *
                     Vec3d(cloud.scales[0], cloud.scales[1], cloud.scales[2]).asDiagonal();
  const double shortest = axes.jacobiSvd().singularValues()[2];
  const Vec3d centre = (matrix * Vec4d(0.5, 0.25, -0.125, 1)).head<3>();
  const Mat3d inverse = axes.inverse();
  for (const Vec3d& w : fibonacciSphere(12)) {
    const Vec3d point = ((centre + w * 0.4) / 0.05).array().round() * 0.05;
    const double m2 = (inverse * (point - centre)).squaredNorm();
    const double expected =
        polylogHalf(0.5 * std::exp(-0.5 * m2)) / (std::sqrt(2 * kPi) * shortest);
    // The point is a voxel centre up to rounding; float coordinates in a brick give 1e-5.
    EXPECT_NEAR(probe.density(point), expected, expected * 1e-5);
  }
}

// ---- threads, cancel, memory -------------------------------------------------------------------

TEST(Voxelize, GivesTheSameBitsForAnyNumberOfThreads) {
  const SplatCloud cloud = randomCloud(3000, 7);
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  VoxelizeOptions options;
  options.resolution = 96;
  SparseVolume one;
  SparseVolume two;
  withThreads(1, [&] { one = voxelize({&instance, 1}, options); });
  withThreads(2, [&] { two = voxelize({&instance, 1}, options); });
  ASSERT_GT(one.brickCount(), 100u);
  EXPECT_EQ(one.bricks, two.bricks);
  EXPECT_EQ(one.density, two.density);
  EXPECT_EQ(one.colour, two.colour);
  EXPECT_TRUE(std::is_sorted(one.bricks.begin(), one.bricks.end()));
}

TEST(Voxelize, SumsBricksOfManySplatsInParts) {
  // Three times 6,000 splats in few bricks: lists of up to 18,000, which are cut at 8,192.
  const SplatCloud cloud = randomCloud(6000, 9);
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  const std::vector<SplatInstance> three(3, instance);
  VoxelizeOptions options;
  options.voxel_size = 0.15;
  options.min_density = 0.0;
  const SparseVolume single = voxelize({&instance, 1}, options);
  SparseVolume one;
  SparseVolume two;
  withThreads(1, [&] { one = voxelize(three, options); });
  withThreads(2, [&] { two = voxelize(three, options); });
  ASSERT_EQ(one.bricks, single.bricks);
  for (size_t i = 0; i < one.density.size(); ++i) {
    // Sums of 64 splats in float: 64 roundings of 6e-8 at most.
    ASSERT_NEAR(one.density[i], 3.0f * single.density[i], 4e-6f * one.density[i]) << i;
    for (size_t channel = 0; channel < 3 && one.density[i] > 0; ++channel) {
      ASSERT_NEAR(one.colour[i * 3 + channel], single.colour[i * 3 + channel], 1e-5f) << i;
    }
  }
  EXPECT_EQ(one.bricks, two.bricks);
  EXPECT_EQ(one.density, two.density);
  EXPECT_EQ(one.colour, two.colour);
}

TEST(Voxelize, StopsWhenCancelled) {
  const SplatCloud cloud = randomCloud(20000, 3);
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  VoxelizeOptions options;
  options.resolution = 256;
  Progress progress;
  std::thread canceller([&] {
    while (progress.fraction() < 0.2) std::this_thread::sleep_for(std::chrono::microseconds(50));
    progress.cancel();
  });
  ErrorCode code = ErrorCode::kInternal;
  try {
    voxelize({&instance, 1}, options, UINT64_MAX, &progress);
  } catch (const Error& error) {
    code = error.code();
  }
  canceller.join();
  EXPECT_EQ(code, ErrorCode::kCancelled);
  EXPECT_LT(progress.fraction(), 1.0);
}

TEST(Voxelize, ReportsProgressToTheEnd) {
  const SplatCloud cloud = randomCloud(100, 3);
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  Progress progress;
  VoxelizeOptions options;
  options.resolution = 32;
  voxelize({&instance, 1}, options, UINT64_MAX, &progress);
  EXPECT_EQ(progress.fraction(), 1.0);
}

TEST(Voxelize, StaysWithinItsMemoryBoundAndRefusesBelow) {
  const SplatCloud cloud = randomCloud(500, 11);
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  VoxelizeOptions options;
  options.resolution = 64;
  const uint64_t bound = voxelizeMemoryBound({&instance, 1}, options);
  const SparseVolume volume = voxelize({&instance, 1}, options, bound);
  const uint64_t held =
      volume.density.size() * 4 + volume.colour.size() * 4 + volume.bricks.size() * 12;
  EXPECT_LE(held, bound);
  EXPECT_LT(bound, held * 2);  // the bound is of use: not far above what is needed
  std::string message;
  EXPECT_EQ(codeOf(cloud, options, message, held / 2), ErrorCode::kMemoryLimit);
  EXPECT_NE(message.find("MiB"), std::string::npos) << message;
  EXPECT_NE(message.find("larger voxel size"), std::string::npos) << message;
}

TEST(Voxelize, RefusesAHugeSplatOnATinyGridAtOnce) {
  OneSplat splat;
  splat.scales = Vec3d(1000, 1000, 1000);
  std::string message;
  VoxelizeOptions options;
  options.voxel_size = 1e-4;
  const SplatCloud cloud = makeCloud({splat});
  // 8e7 voxels along a side are inside int32 and far beyond any memory.
  EXPECT_EQ(codeOf(cloud, options, message), ErrorCode::kMemoryLimit);
  EXPECT_NE(message.find("at least"), std::string::npos) << message;
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  EXPECT_GT(voxelizeMemoryBound({&instance, 1}, options), uint64_t{1} << 50);
}

TEST(Voxelize, DoesNotFillTheBoxBetweenDistantSplats) {
  OneSplat a;
  a.scales = Vec3d::Constant(0.05);
  OneSplat b = a;
  b.position = Vec3d(1e5, 1e5, 1e5);
  const SplatCloud cloud = makeCloud({a, b});
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  VoxelizeOptions options;
  options.voxel_size = 0.02;
  const SparseVolume volume = voxelize({&instance, 1}, options, 64 << 20);
  EXPECT_GT(volume.brickCount(), 8u);
  EXPECT_LT(volume.brickCount(), 500u);
}

// ---- bad input ---------------------------------------------------------------------------------

TEST(Voxelize, RefusesBadSettingsWithTheValueSeenAndAllowed) {
  const SplatCloud cloud = makeCloud({OneSplat()});
  std::string message;
  for (const double size : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    VoxelizeOptions options;
    options.voxel_size = size;
    EXPECT_EQ(codeOf(cloud, options, message), ErrorCode::kInvalidArgument) << size;
    EXPECT_NE(message.find("voxel size"), std::string::npos) << message;
  }
  VoxelizeOptions none;
  none.resolution = 0;
  EXPECT_EQ(codeOf(cloud, none, message), ErrorCode::kInvalidArgument);
  EXPECT_NE(message.find("resolution 0"), std::string::npos) << message;
  VoxelizeOptions low_pass;
  low_pass.low_pass = -0.5;
  EXPECT_EQ(codeOf(cloud, low_pass, message), ErrorCode::kInvalidArgument);
  VoxelizeOptions cut_off;
  cut_off.cut_off_sigma = std::nan("");
  EXPECT_EQ(codeOf(cloud, cut_off, message), ErrorCode::kInvalidArgument);
  VoxelizeOptions min_density;
  min_density.min_density = -1;
  EXPECT_EQ(codeOf(cloud, min_density, message), ErrorCode::kInvalidArgument);
}

TEST(Voxelize, RefusesVoxelsTooSmallForTheirIndices) {
  OneSplat splat;
  splat.position = Vec3d(1000, 0, 0);
  splat.scales = Vec3d::Constant(1e-6);
  VoxelizeOptions options;
  options.voxel_size = 1e-7;
  std::string message;
  EXPECT_EQ(codeOf(makeCloud({splat}), options, message), ErrorCode::kInvalidArgument);
  EXPECT_NE(message.find("2.14748e+09 is allowed"), std::string::npos) << message;
  options.voxel_size = 1e-200;
  EXPECT_EQ(codeOf(makeCloud({splat}), options, message), ErrorCode::kInvalidArgument);
  EXPECT_NE(message.find("1e-12"), std::string::npos) << message;
}

TEST(Voxelize, RefusesNothing) {
  std::string message;
  EXPECT_EQ(codeOf(makeCloud({}), VoxelizeOptions(), message), ErrorCode::kInvalidArgument);
  EXPECT_EQ(message.find("nothing to voxelize"), 0u) << message;
  EXPECT_THROW(voxelize({}, VoxelizeOptions()), Error);
  const SplatInstance empty;
  EXPECT_THROW(voxelize({&empty, 1}, VoxelizeOptions()), Error);
}

TEST(Voxelize, RefusesBadMatricesAndClouds) {
  const SplatCloud cloud = makeCloud({OneSplat()});
  std::string message;
  Mat4d singular = Mat4d::Identity();
  singular(2, 2) = 0;
  EXPECT_EQ(codeOf(cloud, VoxelizeOptions(), message, UINT64_MAX, singular),
            ErrorCode::kInvalidArgument);
  EXPECT_NE(message.find("singular"), std::string::npos) << message;
  Mat4d projective = Mat4d::Identity();
  projective(3, 0) = 0.5;
  EXPECT_EQ(codeOf(cloud, VoxelizeOptions(), message, UINT64_MAX, projective),
            ErrorCode::kInvalidArgument);
  Mat4d not_finite = Mat4d::Identity();
  not_finite(0, 3) = std::nan("");
  EXPECT_EQ(codeOf(cloud, VoxelizeOptions(), message, UINT64_MAX, not_finite),
            ErrorCode::kInvalidArgument);
  SplatCloud bad = cloud;
  bad.positions[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(codeOf(bad, VoxelizeOptions(), message), ErrorCode::kInvalidArgument);
}

TEST(Voxelize, GivesAnEmptyVolumeForTransparentSplats) {
  OneSplat splat;
  splat.opacity = 0.0;
  VoxelizeOptions options;
  options.voxel_size = 0.1;
  EXPECT_EQ(voxelizeOne(splat, options).brickCount(), 0u);
  options.voxel_size = 0.0;  // and there are no bounds to take a voxel size from
  std::string message;
  EXPECT_EQ(codeOf(makeCloud({splat}), options, message), ErrorCode::kInvalidArgument);
}

TEST(Voxelize, TakesOpacityOneAsNinetyNinePercent) {
  OneSplat opaque;
  opaque.opacity = 1.0;
  OneSplat clamped = opaque;
  clamped.opacity = 0.99;
  const SparseVolume a = voxelizeOne(opaque, exactOptions(0.25));
  const SparseVolume b = voxelizeOne(clamped, exactOptions(0.25));
  ASSERT_EQ(a.bricks, b.bricks);
  for (size_t i = 0; i < a.density.size(); ++i) {
    ASSERT_TRUE(std::isfinite(a.density[i]));
    // 0.99 and 0.99f differ by 1e-8, which 1/sqrt(-ln o) magnifies by 50.
    ASSERT_NEAR(static_cast<double>(a.density[i]), static_cast<double>(b.density[i]),
                2e-6 * static_cast<double>(b.density[i]) + 1e-30);
  }
}

TEST(Voxelize, EndsSplatsAtTheCutOffAndStoresNothingBelowTheThreshold) {
  OneSplat splat;
  VoxelizeOptions options = exactOptions(0.125);
  options.cut_off_sigma = 2.0;
  options.min_density = 0.05;
  const SparseVolume volume = voxelizeOne(splat, options);
  ASSERT_GT(volume.brickCount(), 0u);
  const VolumeProbe probe(volume);
  const double edge = polylogHalf(0.5 * std::exp(-2.0)) / std::sqrt(2 * kPi);
  EXPECT_NEAR(probe.voxel(16, 0, 0), edge > 0.05 ? edge : 0.0, 1e-5);
  EXPECT_EQ(probe.voxel(17, 0, 0), 0.0);
  for (const float value : volume.density) ASSERT_TRUE(value == 0.0f || value >= 0.05f) << value;
}

TEST(Voxelize, SumsTenThousandSplatsInOnePlace) {
  OneSplat splat;
  splat.scales = Vec3d::Constant(0.5);
  splat.opacity = 0.3;
  const SplatCloud many = makeCloud(std::vector<OneSplat>(10000, splat));
  const SplatInstance instance{&many, Mat4d::Identity()};
  VoxelizeOptions options = exactOptions(0.25);
  options.cut_off_sigma = 4.0;
  const SparseVolume sum = voxelize({&instance, 1}, options);
  const SparseVolume one = voxelizeOne(splat, options);
  ASSERT_EQ(sum.bricks, one.bricks);
  for (size_t i = 0; i < sum.density.size(); ++i) {
    // 64 splats at a time in float: at most 32 roundings of 6e-8, and mostly far fewer.
    ASSERT_NEAR(static_cast<double>(sum.density[i]), 1e4 * static_cast<double>(one.density[i]),
                2e-6 * 1e4 * static_cast<double>(one.density[i]));
  }
}

TEST(Voxelize, IsAsExactAMillionUnitsFromTheOrigin) {
  OneSplat splat;
  splat.scales = Vec3d(0.6, 0.8, 0.9);
  splat.rotation = Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3).normalized();
  const SplatCloud cloud = makeCloud({splat});
  Mat4d matrix = Mat4d::Identity();
  matrix.topRightCorner<3, 1>().setConstant(1048576.0);  // a whole number of bricks
  const SplatInstance near{&cloud, Mat4d::Identity()};
  const SplatInstance far{&cloud, matrix};
  const VoxelizeOptions options = exactOptions(0.125);
  const SparseVolume a = voxelize({&near, 1}, options);
  const SparseVolume b = voxelize({&far, 1}, options);
  ASSERT_EQ(a.brickCount(), b.brickCount());
  EXPECT_EQ(b.bricks[0][0] - a.bricks[0][0], 1048576 * 8);
  // All differences are taken in double, where both places are exact.
  EXPECT_EQ(a.density, b.density);
}

TEST(Voxelize, TakesTheVoxelSizeFromTheResolution) {
  OneSplat splat;
  splat.scales = Vec3d(1, 2, 0.5);
  VoxelizeOptions options;
  options.resolution = 64;
  // Bounds end at the cut-off: 2 * 4 * 2 m on the longest side.
  EXPECT_NEAR(voxelizeOne(splat, options).voxel_size, 16.0 / 64, 1e-12);
}

}  // namespace
}  // namespace stipple
