#include "densify/strategies/volumetric.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "base/error.h"
#include "densify/control_cases.h"
#include "math/covariance.h"

namespace stipple {
namespace {

using namespace stipple::testing;
using ::testing::Each;

constexpr double kPi = 3.141592653589793;

RawSplats splatsOfScales(const std::vector<std::array<double, 3>>& scales) {
  RawSplats splats = mixedSplats(scales.size(), 3, 0, 1);
  for (size_t i = 0; i < scales.size(); ++i) {
    for (size_t a = 0; a < 3; ++a) {
      splats.log_scales[i * 3 + a] = static_cast<float>(std::log(scales[i][a]));
    }
  }
  return splats;
}

/// Before sizes are judged, and without any pull: only volumes count.
Edited afterVolumes(const RawSplats& splats, const std::string& settings = "",
                    FitMoment moment = publishedMoment(600)) {
  const auto strategy = makeStrategy("volumetric" + settings);
  return moved(*editAt(*strategy, moment, splats), splats);
}

double volumeOf(const std::array<double, 3>& s) {
  return 4.0 / 3 * kPi * s[0] * s[1] * s[2];
}

TEST(Volumetric, SplitsByVolumeAsWorkedOutByHand) {
  EXPECT_NEAR(volumeOf({0.2, 0.2, 0.2}), 0.03351, 1e-5);
  // The first two fill 0.0335, the last two 0.0287.
  const RawSplats splats =
      splatsOfScales({{0.2, 0.2, 0.2}, {0.4, 0.2, 0.1}, {0.19, 0.19, 0.19}, {0.38, 0.19, 0.095}});
  const Edited now = afterVolumes(splats, "(least_shrink=1)");
  ASSERT_EQ(now.splats.size(), 6u);
  EXPECT_EQ(now.splats.positions[0], splats.positions[6]);  // those that are small stay
  EXPECT_EQ(now.splats.positions[3], splats.positions[9]);
  for (const size_t child : {2u, 3u}) {  // m = 0
    for (size_t a = 0; a < 3; ++a) {
      EXPECT_EQ(now.splats.log_scales[child * 3 + a], splats.log_scales[a]);
    }
  }
  const double expected[] = {0.1, 0.05, 0.025};  // m = ln 4
  for (const size_t child : {4u, 5u}) {
    for (size_t a = 0; a < 3; ++a) {
      EXPECT_NEAR(std::exp(now.splats.log_scales[child * 3 + a]), expected[a], 1e-7);
    }
    EXPECT_EQ(now.splats.logits[child], splats.logits[1]);
    EXPECT_EQ(now.splats.rotations[child * 4 + 2], splats.rotations[4 + 2]);
    EXPECT_EQ(now.splats.sh[child * 12 + 7], splats.sh[12 + 7]);
  }
  EXPECT_NE(now.splats.positions[12], now.splats.positions[15]);
  EXPECT_THAT(std::vector<float>(now.moments.logits.begin() + 2, now.moments.logits.end()),
              Each(0.0f));
}

TEST(Volumetric, GuardsHoldRoundOnesAndNeedles) {
  const RawSplats splats = splatsOfScales({{0.3, 0.3, 0.3}, {100, 1, 0.1}});
  const Edited now = afterVolumes(splats);
  ASSERT_EQ(now.splats.size(), 4u);
  EXPECT_NEAR(std::exp(now.splats.log_scales[0]), 0.3 / 1.6, 1e-6);
  EXPECT_NEAR(std::exp(now.splats.log_scales[6]), 100 / 10.0, 1e-4);
  EXPECT_NEAR(std::exp(now.splats.log_scales[8]), 0.1 / 10.0, 1e-7);
}

TEST(Volumetric, TheExponentIsOneOfTwo) {
  const RawSplats splats = splatsOfScales({{0.4, 0.2, 0.2}});
  EXPECT_NEAR(std::exp(afterVolumes(splats).splats.log_scales[0]), 0.2, 1e-7);
  EXPECT_NEAR(std::exp(afterVolumes(splats, "(exponent=1)").splats.log_scales[0]), 0.1, 1e-7);
  EXPECT_THROW(makeStrategy("volumetric(exponent=0.7)"), Error);
  EXPECT_THROW(makeStrategy("volumetric(least_shrink=20,largest_shrink=10)"), Error);
}

TEST(Volumetric, RoundSplatsComeToRest) {
  // 1.6 smaller each time: two events and no more for a volume of ten thresholds.
  RawSplats splats = splatsOfScales({{0.42, 0.42, 0.42}});
  const auto strategy = makeStrategy("volumetric");
  for (uint64_t iteration = 600; iteration <= 2000; iteration += 100) {
    splats = moved(*editAt(*strategy, publishedMoment(iteration), splats), splats).splats;
  }
  EXPECT_EQ(splats.size(), 4u);
}

TEST(Volumetric, TheThresholdGrowsWithTheScene) {
  FitMoment moment = publishedMoment(600);
  moment.extent = 50;
  EXPECT_EQ(afterVolumes(splatsOfScales({{1.9, 1.9, 1.9}, {2, 2, 2}}), "", moment).splats.size(),
            3u);
  moment.extent = 0;  // one camera: nothing is large
  EXPECT_EQ(afterVolumes(splatsOfScales({{100, 100, 100}}), "", moment).splats.size(), 1u);
}

TEST(Volumetric, TheLargestComeFirstWhereRoomIsShort) {
  const RawSplats splats = splatsOfScales({{0.3, 0.3, 0.3}, {0.4, 0.4, 0.4}, {0.35, 0.35, 0.35}});
  const Edited now = afterVolumes(splats, "", publishedMoment(600, 5));
  ASSERT_EQ(now.splats.size(), 5u);
  EXPECT_EQ(now.splats.positions[0], splats.positions[0]);
  EXPECT_EQ(afterVolumes(splats, "(cap=4)").splats.size(), 4u);
  EXPECT_EQ(afterVolumes(splats, "(cap=2)").splats.size(), 3u);
  EXPECT_EQ(afterVolumes(splats, "", publishedMoment(600, 2)).splats.size(), 3u);
}

TEST(Volumetric, ChildrenOfAdaptiveControlAreLookedAtToo) {
  // Pulled at, of scale 0.5: split by 1.6 to 0.31, which is still too large.
  const RawSplats splats = splatsOfScales({{0.5, 0.5, 0.5}});
  const auto strategy = makeStrategy("volumetric");
  const std::vector<float> gradients = {1, 0};
  const std::vector<uint8_t> visible = {1};
  ViewStatistics view;
  view.width = view.height = 100;
  view.visible = visible;
  view.arrays[static_cast<size_t>(Statistic::kScreenGradients)] = gradients;
  strategy->observe(publishedMoment(1), view);
  const Edited now = moved(*editAt(*strategy, publishedMoment(600), splats), splats);
  ASSERT_EQ(now.splats.size(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(std::exp(now.splats.log_scales[i * 3]), 0.5 / 1.6 / 1.6, 1e-6);
    for (size_t k = 0; k < i; ++k) {
      EXPECT_NE(now.splats.positions[i * 3], now.splats.positions[k * 3]);
    }
  }
}

TEST(Volumetric, ScalesAtTheEndsOfFloats) {
  RawSplats splats = mixedSplats(3, 1, 0, 1);
  splats.log_scales = {80, 80, 80, 88, -88, 20, -80, -80, -80};
  const Edited now = afterVolumes(splats);
  EXPECT_EQ(now.splats.size(), 5u);  // the last is small, and the needle fills e^20
}

TEST(Volumetric, ChildrenAreSpreadAsTheirParentIs) {
  // One parent many times: the covariance of the children's places is the parent's.
  constexpr size_t kCount = 10000;
  RawSplats one = splatsOfScales({{0.6, 0.3, 0.2}});
  std::fill(one.positions.begin(), one.positions.end(), 0.0f);
  const Edited now = afterVolumes(rowsOf(one, std::vector<uint32_t>(kCount, 0)));
  ASSERT_EQ(now.splats.size(), 2 * kCount);
  Mat3d seen = Mat3d::Zero();
  for (size_t i = 0; i < 2 * kCount; ++i) {
    const float* p = &now.splats.positions[i * 3];
    const Vec3d place(static_cast<double>(p[0]), static_cast<double>(p[1]),
                      static_cast<double>(p[2]));
    seen += place * place.transpose() / (2.0 * kCount);
  }
  const SplatCloud cloud = activated(one);
  const Mat3d expected = covariance<double>(cloud.rotations.data(), cloud.scales.data());
  // Five standard errors: 5 sqrt(2 / 20000).
  EXPECT_LT((seen - expected).norm() / expected.norm(), 0.05);
}

TEST(VolumeSplit, GoesWithOtherStrategies) {
  const RawSplats splats = splatsOfScales({{0.4, 0.4, 0.4}});
  const auto strategy = makeStrategy("absolute+volume_split(volume=0.2)");
  EXPECT_EQ(editAt(*strategy, publishedMoment(600), splats)->countAfter(1), 2u);
}

}  // namespace
}  // namespace stipple
