// What strategies that look at views are made of.

#include <gtest/gtest.h>

#include <cmath>

#include "base/parallel.h"
#include "densify/control_cases.h"
#include "densify/known_views.h"
#include "densify/quantities/error_maps.h"
#include "densify/quantities/splat_footprint.h"
#include "densify/quantities/voxel_counts.h"
#include "math/covariance.h"

namespace stipple {
namespace {

using namespace stipple::testing;

/// 1 - SSIM of one pixel and channel, as the equation stands.
double dissimilarityAt(const std::vector<float>& a, const std::vector<float>& b, int width,
                       int height, int x, int y, int channel) {
  double norm = 0;
  for (int k = -5; k <= 5; ++k) norm += std::exp(-k * k / 4.5);
  double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
  for (int v = std::max(0, y - 5); v <= std::min(height - 1, y + 5); ++v) {
    for (int u = std::max(0, x - 5); u <= std::min(width - 1, x + 5); ++u) {
      const double d2 = (u - x) * (u - x) + (v - y) * (v - y);
      const double w = std::exp(-d2 / 4.5) / (norm * norm);
      const size_t index = static_cast<size_t>((v * width + u) * 3 + channel);
      const double p = static_cast<double>(a[index]), q = static_cast<double>(b[index]);
      ma += w * p;
      mb += w * q;
      aa += w * p * p;
      bb += w * q * q;
      ab += w * p * q;
    }
  }
  const double c1 = 1e-4, c2 = 9e-4;
  return 1 - (2 * ma * mb + c1) * (2 * (ab - ma * mb) + c2) /
                 ((ma * ma + mb * mb + c1) * (aa - ma * ma + bb - mb * mb + c2));
}

TEST(ErrorMaps, AreThoseOfTheEquation) {
  constexpr int kWidth = 19, kHeight = 13;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<float> a(kWidth * kHeight * 3), b(a.size());
  for (float& value : a) value = unit(random);
  for (size_t i = 0; i < b.size(); ++i) b[i] = 0.7f * a[i] + 0.3f * unit(random);
  const ErrorMaps maps = errorMaps(kWidth, kHeight, a, b);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      double expected = 0, difference = 0;
      for (int c = 0; c < 3; ++c) {
        const size_t index = static_cast<size_t>((y * kWidth + x) * 3 + c);
        expected += dissimilarityAt(a, b, kWidth, kHeight, x, y, c) / 3;
        difference += std::abs(static_cast<double>(a[index]) - static_cast<double>(b[index])) / 3;
      }
      const size_t pixel = static_cast<size_t>(y * kWidth + x);
      // Variances of about 0.1 from float32 sums of about 1: 1e-6 relative to 0.1.
      EXPECT_NEAR(maps.dissimilarity[pixel], expected, 2e-5);
      EXPECT_NEAR(maps.difference[pixel], difference, 1e-6);
    }
  }
}

TEST(ErrorMaps, EqualAndFlatPicturesAndThreads) {
  const std::vector<float> flat(40 * 30 * 3, 0.25f), black(flat.size(), 0.0f);
  const ErrorMaps equal = errorMaps(40, 30, flat, flat);
  for (const float value : equal.dissimilarity) EXPECT_NEAR(value, 0, 1e-6);
  ErrorMaps one, two;
  withThreads(1, [&] { one = errorMaps(40, 30, flat, black); });
  withThreads(2, [&] { two = errorMaps(40, 30, flat, black); });
  EXPECT_EQ(one.dissimilarity, two.dissimilarity);
  EXPECT_FLOAT_EQ(one.difference[77], 0.25f);
  EXPECT_EQ(
      errorMaps(1, 1, std::vector<float>{1, 1, 1}, std::vector<float>{0, 0, 0}).difference.size(),
      1u);
}

TEST(SplatFootprint, PlacesAreWhereTheCameraSeesThem) {
  const Camera camera = forwardCamera(200, 100, 100);
  const auto place = placeInPicture(camera, {0.5, -0.25, 2});
  ASSERT_TRUE(place);
  EXPECT_DOUBLE_EQ(place->x, 125);
  EXPECT_DOUBLE_EQ(place->y, 37.5);
  EXPECT_EQ(place->pixel, 37u * 200 + 125);
  EXPECT_FALSE(placeInPicture(camera, {0.5, -0.25, -2}));
  EXPECT_FALSE(placeInPicture(camera, {0, 0, 0}));
  EXPECT_FALSE(placeInPicture(camera, {2.1, 0, 2}));
  EXPECT_FALSE(placeInPicture(camera, {0, 0, 1e20}));
  Camera flat = camera;
  flat.model = CameraModel::kOrthographic;
  EXPECT_DOUBLE_EQ(placeInPicture(flat, {0.5, -0.25, 7})->x, 150);
}

TEST(SplatFootprint, FactorsTheProjectedCovariance) {
  const Camera camera = forwardCamera(200, 100, 120);
  const RawSplats raw = mixedSplats(50, 4);
  const SplatCloud cloud = activated(raw);
  for (size_t i = 0; i < 50; ++i) {
    const Vec3d centre(0.3, -0.2, 1.5 + 0.1 * static_cast<double>(i));
    const Mat3d axes = scaledAxes<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]);
    const auto place = placeInPicture(camera, centre);
    ASSERT_TRUE(place);
    const FootprintFactor l = footprintFactor(camera, *place, axes);
    Eigen::Matrix<double, 2, 3> j;
    const double z = centre.z();
    j << 120 / z, 0, -120 * centre.x() / (z * z), 0, 120 / z, -120 * centre.y() / (z * z);
    const Eigen::Matrix2d sigma =
        j * axes * axes.transpose() * j.transpose() + 0.3 * Eigen::Matrix2d::Identity();
    EXPECT_NEAR(l.l00 * l.l00, sigma(0, 0), 1e-12 * sigma.norm());
    EXPECT_NEAR(l.l00 * l.l10, sigma(1, 0), 1e-12 * sigma.norm());
    EXPECT_NEAR(l.l10 * l.l10 + l.l11 * l.l11, sigma(1, 1), 1e-12 * sigma.norm());
  }
}

TEST(SplatFootprint, NeedlesKeepTheirWidth) {
  // Along the diagonal of the picture, 1e8 px long: what is across is the low-pass alone.
  const Camera camera = forwardCamera(200, 200, 100);
  const auto place = placeInPicture(camera, {0, 0, 1});
  Mat3d axes = Mat3d::Zero();
  axes.col(0) = Vec3d(1e6, 1e6, 0);
  const FootprintFactor l = footprintFactor(camera, *place, axes);
  // det = 0.3 (0.3 + 2 * 1e16), l11^2 = det / l00^2.
  EXPECT_NEAR(l.l11 * l.l11, 0.3 * 2e16 / 1e16, 1e-9);
}

TEST(VoxelCounts, CountByCell) {
  VoxelCounts voxels(0.5);
  for (const double x : {0.1, 0.4, 0.6, -0.1, 1e30, -1e30}) voxels.add({x, 0.2, -3});
  voxels.finish();
  EXPECT_EQ(voxels.at({0.2, 0.49, -2.6}), 2u);
  EXPECT_EQ(voxels.at({0.5, 0.2, -3}), 1u);
  EXPECT_EQ(voxels.at({-0.4, 0.2, -3}), 1u);
  EXPECT_EQ(voxels.at({0.2, 0.5, -3}), 0u);
  EXPECT_EQ(voxels.at({1e30, 0.2, -3}), 1u);
}

}  // namespace
}  // namespace stipple
