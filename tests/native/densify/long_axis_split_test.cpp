#include "densify/parts/long_axis_split.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <random>

#include "densify/control_scene.h"
#include "densify/quantities/opacity_forms.h"
#include "densify/strategies.h"
#include "math/quaternion.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;
using namespace stipple::testing;

struct Parent {
  Vec3d place = Vec3d::Zero();
  float rotation[4] = {1, 0, 0, 0};
  float scales[3] = {1, 1, 1};
  float opacity = 0.5f;
};

RawSplats rawOf(const Parent& parent) {
  SplatCloud cloud;
  cloud.resize(1);
  for (Eigen::Index a = 0; a < 3; ++a) {
    cloud.positions[static_cast<size_t>(a)] = static_cast<float>(parent.place[a]);
  }
  std::copy_n(parent.rotation, 4, cloud.rotations.begin());
  std::copy_n(parent.scales, 3, cloud.scales.begin());
  cloud.opacities = {parent.opacity};
  return rawSplats(cloud);
}

RawSplats childrenOf(const RawSplats& splats, const LongAxisSplitOptions& options = {}) {
  std::vector<Candidate> all;
  for (uint32_t i = 0; i < splats.size(); ++i) all.push_back({i, 1.0f, i % 2 == 0});
  const RawSplats children = makeLongAxisSplit(options)->children({}, splats, all);
  for (const Candidate& one : all) EXPECT_TRUE(one.replaces);
  return children;
}

Vec3d placeOf(const RawSplats& splats, size_t row) {
  const float* p = &splats.positions[row * 3];
  return {double{p[0]}, double{p[1]}, double{p[2]}};
}
Vec3d scalesOf(const RawSplats& splats, size_t row) {
  const float* l = &splats.log_scales[row * 3];
  return {std::exp(double{l[0]}), std::exp(double{l[1]}), std::exp(double{l[2]})};
}
Mat3d turnOf(const RawSplats& splats, size_t row) {
  return rotationFromQuaternion<double>(&splats.rotations[row * 4]);
}
/// Distance from the centre of a splat in its standard deviations.
double deviations(const RawSplats& splats, size_t row, const Vec3d& point) {
  const Vec3d local = turnOf(splats, row).transpose() * (point - placeOf(splats, row));
  return local.cwiseQuotient(scalesOf(splats, row)).norm();
}

TEST(LongAxisSplit, SplitsARoundSplatAlongItsFirstAxis) {
  const RawSplats children = childrenOf(rawOf({}));
  ASSERT_EQ(children.size(), 2u);
  for (size_t k = 0; k < 2; ++k) {
    // Numbers near 1 in float32.
    EXPECT_NEAR(children.positions[k * 3], k == 0 ? 1.35f : -1.35f, 1.2e-7f);
    EXPECT_EQ(children.positions[k * 3 + 1], 0.0f);
    EXPECT_NEAR(activatedScale(children.log_scales[k * 3]), 0.55f, 1e-7f);
    EXPECT_NEAR(activatedScale(children.log_scales[k * 3 + 1]), 0.8930286f, 1.2e-7f);
    EXPECT_NEAR(activatedScale(children.log_scales[k * 3 + 2]), 0.8930286f, 1.2e-7f);
    EXPECT_NEAR(activatedOpacity(children.logits[k]), 0.3f, 6e-8f);
    // The tip: 1.35 + 3 * 0.55 = 3.
    EXPECT_NEAR(1.35 + 3 * scalesOf(children, k)[0], 3.0, 5e-7);
  }
}

/// Needles, discs and all between, up to 1e6 from the longest to the shortest, in any direction.
TEST(LongAxisSplit, ChildrenEndOnTheirParentsShell) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int trial = 0; trial < 500; ++trial) {
    Parent parent;
    for (float& q : parent.rotation) q = normal(random);
    const double ratio = std::pow(10.0, 6 * uniform(random));
    const int longest = trial % 3;
    for (int a = 0; a < 3; ++a) {
      const double share =
          a == longest ? 1 : std::pow(ratio, -(a == (longest + 1) % 3 ? 1 : uniform(random)));
      parent.scales[a] = static_cast<float>(0.3 * share);
    }
    const RawSplats splats = rawOf(parent);
    const RawSplats children = childrenOf(splats);
    const Vec3d parent_scales = scalesOf(splats, 0);
    // Half a last digit of each coordinate, of at most 1.35 * 0.3, across the shortest axis; and of
    // log-scales, of at most 15.
    const double tolerance = 0x1p-26 * std::sqrt(3.0) / parent_scales.minCoeff() + 3 * 0x1p-21;
    EXPECT_NEAR((placeOf(children, 0) + placeOf(children, 1)).norm(), 0, 0);
    for (size_t k = 0; k < 2; ++k) {
      const Mat3d turn = turnOf(children, k);
      const Vec3d scales = scalesOf(children, k);
      const Vec3d outward = (k == 0 ? 1.0 : -1.0) * turn.col(longest);
      const Vec3d tip = placeOf(children, k) + 3 * scales[longest] * outward;
      EXPECT_NEAR(deviations(splats, 0, tip), 3, tolerance);
      for (int step = 1; step < 3; ++step) {
        const Eigen::Index across = (longest + step) % 3;
        for (const double side : {-3.0, 3.0}) {
          const Vec3d end = placeOf(children, k) + side * scales[across] * turn.col(across);
          EXPECT_NEAR(deviations(splats, 0, end), 3, tolerance);
        }
      }
      // Where the outward share of the direction is c, 9 + 4.455 (c - c^2): at most 3.18021^2.
      const double largest = std::sqrt(9 + 4.455 / 4);
      for (int sample = 0; sample < 50; ++sample) {
        Vec3d direction(double{normal(random)}, double{normal(random)}, double{normal(random)});
        direction.normalize();
        const Vec3d point = placeOf(children, k) + 3 * (turn * scales.cwiseProduct(direction));
        EXPECT_LT(deviations(splats, 0, point), largest + tolerance);
      }
      Vec3d local = Vec3d::Zero();
      local[longest] = k == 0 ? 0.5 : -0.5;
      local[(longest + 1) % 3] = std::sqrt(0.75);
      const Vec3d farthest = placeOf(children, k) + 3 * (turn * scales.cwiseProduct(local));
      EXPECT_NEAR(deviations(splats, 0, farthest), largest, tolerance);
      const Mat3d half = turn * scales.asDiagonal();
      const Mat3d covariance = half * half.transpose();
      const Eigen::LLT<Mat3d> factor(covariance);
      EXPECT_EQ(factor.info(), Eigen::Success);
      EXPECT_GT(scales.minCoeff(), 0);
    }
  }
}

TEST(LongAxisSplit, QuaternionsMayHaveAnyLength) {
  Parent parent;
  parent.place = {0.5, -2, 1};
  std::copy_n(std::begin({0.3f, -0.2f, 0.8f, 0.45f}), 4, parent.rotation);
  parent.scales[2] = 3;
  const RawSplats children = childrenOf(rawOf(parent));
  for (const int exponent : {-120, -60, -1, 1, 60, 120}) {
    Parent longer = parent;
    for (float& q : longer.rotation) q = std::ldexp(q, exponent);
    // A power of two changes no digit.
    EXPECT_EQ(childrenOf(rawOf(longer)).positions, children.positions) << exponent;
  }
  const Vec3d along = placeOf(children, 0) - placeOf(children, 1);
  EXPECT_NEAR(along.normalized().dot(turnOf(children, 0).col(2)), 1, 1e-7);
  EXPECT_NEAR(along.norm(), 2 * 1.35 * 3, 1e-6);
  const Vec3d middle = 0.5 * (placeOf(children, 0) + placeOf(children, 1));
  EXPECT_NEAR((middle - parent.place).norm(), 0, 3e-7);
}

TEST(LongAxisSplit, ColoursRotationsAndExtrasAreTheParents) {
  RawSplats splats = splatsOf({{1, 0.5f}, {2, 0.5f}});
  splats.extra_lengths = {2};
  splats.extras = {{1, 2, 3, 4}};
  const RawSplats children = childrenOf(splats);
  ASSERT_EQ(children.size(), 4u);
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(children.sh[k * 12 + 3], splats.sh[k / 2 * 12 + 3]);
    EXPECT_EQ(children.rotations[k * 4], 1.0f);
    EXPECT_EQ(children.extras[0][k * 2 + 1], splats.extras[0][k / 2 * 2 + 1]);
  }
}

TEST(LongAxisSplit, ItsNumbersCanBeSet) {
  const RawSplats children =
      childrenOf(rawOf({}), {.offset = 0.8, .long_scale = 0.6, .minor_scale = 1, .opacity = 1});
  EXPECT_NEAR(children.positions[0], 0.8f, 1e-7f);
  EXPECT_NEAR(activatedScale(children.log_scales[0]), 0.6f, 1e-7f);
  EXPECT_EQ(children.log_scales[1], 0.0f);
  EXPECT_EQ(children.logits[0], 0.0f);
  const auto strategy = makeStrategy("adaptive+long_axis_split(offset=0.5,long=0.5,minor=0.85)");
  strategy->observe(at(1), Seen({1}).statistics());
  const auto edit = editAt(*strategy, at(600), splatsOf({{1, 0.5f}}));
  ASSERT_EQ(edit->append.size(), 2u);
  EXPECT_EQ(edit->append.positions[0], 0.5f);
}

TEST(LongAxisSplit, OpacitiesKeepTheirDigitsNearBothEnds) {
  for (const double logit : {-80.0, -30.0, -5.0, -1.0, 0.0, 1.0, 5.0, 12.0, 30.0, 80.0, 1e30}) {
    for (const double factor : {1e-3, 0.6, 0.999, 1.0}) {
      const long double x = static_cast<long double>(static_cast<float>(logit));
      // f o / (1 - f o) in long double, without the opacity itself.
      const long double odds_down =
          (1 + std::exp(-x)) / static_cast<long double>(factor) - 1;  // (1 - f o) / (f o)
      const double expected =
          factor == 1 ? static_cast<double>(x) : static_cast<double>(-std::log(odds_down));
      // Half a last digit of float32.
      EXPECT_NEAR(scaledOpacityLogit(static_cast<float>(logit), factor), expected,
                  6e-8 * std::max(1.0, std::abs(expected)))
          << logit << " " << factor;
    }
  }
  EXPECT_NEAR(scaledOpacityLogit(std::numeric_limits<float>::max(), 0.6), 0.405465f, 1e-6f);
  EXPECT_EQ(scaledOpacityLogit(-3e38f, 0.6), -3e38f);
}

TEST(LongAxisSplit, ScalesNeverVanish) {
  RawSplats splats = rawOf({});
  splats.log_scales = {-68.9f, -200.0f, -69.0f};
  for (int k = 0; k < 3; ++k) {
    const RawSplats children = childrenOf(splats);
    for (const float l : children.log_scales) EXPECT_GE(l, rawScale(0.0f));
    splats = rowsOf(children, {0});
  }
  EXPECT_GT(activatedScale(splats.log_scales[0]), 0.0f);
}

TEST(LongAxisSplit, SplatsAtTheEndOfNumbersStayFinite) {
  RawSplats splats = rawOf({});
  splats.positions = {3.4e38f, 0, -3.4e38f};
  splats.log_scales = {500.0f, 500.0f, -500.0f};
  const RawSplats children = childrenOf(splats);
  EXPECT_EQ(children.positions[2], -3.4e38f);
  for (const float p : children.positions) EXPECT_TRUE(std::isfinite(p));
}

TEST(LongAxisSplit, DecidesOpacitiesToo) {
  EXPECT_EQ(messageOf([] { makeStrategy("adaptive+long_axis_split(offset=11)"); }),
            "long_axis_split.offset is 11.000000; 0.000000 to 10.000000 is allowed");
  EXPECT_THAT(messageOf([] { makeStrategy("adaptive+long_axis_split(d=1)"); }),
              HasSubstr("there is offset, long, minor, opacity"));
}

}  // namespace
}  // namespace stipple
