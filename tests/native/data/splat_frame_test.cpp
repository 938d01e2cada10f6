#include "data/clouds/splat_frame.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "math/quaternion.h"
#include "math/spherical_harmonics.h"

namespace stipple {
namespace {

/// The frame's axes in the world (right, up, back), column by column, from the letters of its name.
Mat3d axesOf(Frame frame) {
  Mat3d axes = Mat3d::Zero();
  for (Eigen::Index i = 0; i < 3; ++i) {
    const char letter = frameName(frame)[i];
    const Eigen::Index axis = letter == 'R' || letter == 'L'   ? 0
                              : letter == 'U' || letter == 'D' ? 1
                                                               : 2;
    axes(axis, i) = letter == 'R' || letter == 'U' || letter == 'B' ? 1.0 : -1.0;
  }
  return axes;
}

SplatCloud oneSplat(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  SplatCloud cloud;
  cloud.sh_degree = 4;
  cloud.resize(1);
  for (float& value : cloud.positions) value = normal(random);
  for (float& value : cloud.sh) value = normal(random);
  for (float& value : cloud.scales) value = std::exp(normal(random));
  cloud.opacities[0] = 0.5f;
  double norm = 0;
  for (float& value : cloud.rotations) value = normal(random);
  for (float value : cloud.rotations) norm += double(value) * double(value);
  for (float& value : cloud.rotations) value = float(double(value) / std::sqrt(norm));
  return cloud;
}

Mat3d covarianceOf(const SplatCloud& cloud) {
  const Mat3d r = rotationFromQuaternion<double>(cloud.rotations.data());
  const Vec3d s(double(cloud.scales[0]), double(cloud.scales[1]), double(cloud.scales[2]));
  return r * s.cwiseAbs2().asDiagonal() * r.transpose();
}

double colourAlong(const SplatCloud& cloud, const Vec3d& direction, size_t channel) {
  std::array<double, 25> basis;
  harmonicBasis(4, direction.x(), direction.y(), direction.z(), basis.data());
  double sum = 0;
  for (size_t k = 0; k < 25; ++k) sum += basis[k] * double(cloud.sh[k * 3 + channel]);
  return sum;
}

TEST(SplatFrame, NamesItsAxesByLetters) {
  for (uint32_t i = 0; i <= kLastFrame; ++i) {
    const Frame frame = static_cast<Frame>(i);
    EXPECT_EQ(frameFromName(frameName(frame)), frame);
  }
  EXPECT_EQ(frameFromName("rub"), std::nullopt);
  EXPECT_EQ(frameFromName(""), std::nullopt);
}

TEST(SplatFrame, MovesAPointAsTheLettersSay) {
  const auto moved = [](Frame from, Frame to) {
    SplatCloud cloud = oneSplat(1);
    cloud.positions = {1, 2, 3};
    cloud.frame = from;
    convertFrame(cloud, to);
    EXPECT_EQ(cloud.frame, to);
    return cloud.positions;
  };
  EXPECT_EQ(moved(Frame::kRUB, Frame::kRDF), (std::vector<float>{1, -2, -3}));
  EXPECT_EQ(moved(Frame::kRUB, Frame::kLUF), (std::vector<float>{-1, 2, -3}));
  EXPECT_EQ(moved(Frame::kRUB, Frame::kRFU), (std::vector<float>{1, -3, 2}));
  EXPECT_EQ(moved(Frame::kRUB, Frame::kRUF), (std::vector<float>{1, 2, -3}));
  // Unknown counts as the frame of trained files.
  EXPECT_EQ(moved(Frame::kUnknown, Frame::kRUB), (std::vector<float>{1, -2, -3}));
  EXPECT_EQ(moved(Frame::kUnknown, Frame::kRDF), (std::vector<float>{1, 2, 3}));
}

TEST(SplatFrame, KeepsShapeAndColourInTheWorldForEveryPair) {
  const SplatCloud source = oneSplat(2);
  const Vec3d direction = Vec3d(0.3, -0.8, 0.5).normalized();
  for (uint32_t a = 1; a <= kLastFrame; ++a) {
    for (uint32_t b = 1; b <= kLastFrame; ++b) {
      const Frame from = static_cast<Frame>(a);
      const Frame to = static_cast<Frame>(b);
      SCOPED_TRACE(std::string(frameName(from)) + " to " + frameName(to));
      SplatCloud cloud = source;
      cloud.frame = from;
      convertFrame(cloud, to);
      // Coordinates of the new frame from those of the old one, through the world.
      const Mat3d change = axesOf(to).transpose() * axesOf(from);
      const Mat3d expected = change * covarianceOf(source) * change.transpose();
      // 1e-6 of the largest variance: quaternions are unit up to float32 rounding.
      EXPECT_LT((covarianceOf(cloud) - expected).cwiseAbs().maxCoeff(),
                1e-6 * expected.cwiseAbs().maxCoeff());
      for (size_t channel = 0; channel < 3; ++channel) {
        // 25 coefficients of size 1, each rounded to float32 once.
        EXPECT_NEAR(colourAlong(cloud, change * direction, channel),
                    colourAlong(source, direction, channel), 5e-6);
      }
    }
  }
}

TEST(SplatFrame, IsExactAndUndoneBitForBitWithoutSwappedAxes) {
  const SplatCloud source = oneSplat(3);
  for (uint32_t a = 1; a <= 8; ++a) {
    for (uint32_t b = 1; b <= 8; ++b) {
      SplatCloud cloud = source;
      cloud.frame = static_cast<Frame>(a);
      convertFrame(cloud, static_cast<Frame>(b));
      for (size_t k = 0; k < cloud.sh.size(); ++k) {
        EXPECT_EQ(std::abs(cloud.sh[k]), std::abs(source.sh[k]));
      }
      convertFrame(cloud, static_cast<Frame>(a));
      EXPECT_EQ(cloud.positions, source.positions);
      EXPECT_EQ(cloud.rotations, source.rotations);
      EXPECT_EQ(cloud.scales, source.scales);
      EXPECT_EQ(cloud.sh, source.sh);
    }
  }
}

}  // namespace
}  // namespace stipple
