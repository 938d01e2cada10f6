#include "densify/parts/filter_3d.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/parallel.h"
#include "control_scene.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using testing::at;
using testing::editAt;
using ::testing::HasSubstr;
using testing::Kind;
using testing::messageOf;
using testing::splatsOf;

/// At the origin, looking along z, 100 x 100 pixels, 90 degrees and a little more.
Camera camera(double fx = 50) {
  Camera made;
  made.width = made.height = 100;
  made.fx = made.fy = fx;
  made.cx = made.cy = 50;
  return made;
}

std::vector<float> sizesOf(const std::vector<float>& positions, const std::vector<Camera>& cameras,
                           double variance = 0.2) {
  std::vector<const Camera*> pointers;
  for (const Camera& one : cameras) pointers.push_back(&one);
  return filterSizes(positions, pointers, variance);
}

/// Shows fixed splats to cameras, and draws nothing.
class Cameras final : public ViewEvaluator {
 public:
  Cameras(const RawSplats& splats, std::vector<Camera> cameras)
      : cloud_(activated(splats)), cameras_(std::move(cameras)) {}
  size_t viewCount() const override { return cameras_.size(); }
  const SplatCloud& splats() override { return cloud_; }
  const Camera& camera(size_t view) const override { return cameras_[view]; }
  std::vector<float> target(size_t) override { return {}; }
  std::vector<float> picture(size_t) override { return {}; }
  const ViewStatistics& evaluate(size_t, const StatisticRequest&) override { return nothing_; }

 private:
  SplatCloud cloud_;
  std::vector<Camera> cameras_;
  ViewStatistics nothing_;
};

/// A strategy whose filter has looked at these splats.
std::unique_ptr<Strategy> looked(const RawSplats& splats, const std::string& name = "filter_3d") {
  auto strategy = makeStrategy("adaptive+" + name);
  EXPECT_TRUE(strategy->wantsSweep(at(1)));
  Cameras cameras(splats, {camera()});
  strategy->sweep(at(1), cameras);
  return strategy;
}

SplatCloud drawn(const Strategy& strategy, const RawSplats& splats) {
  SplatCloud cloud = activated(splats);
  strategy.parameterisation()->activate(splats, cloud);
  return cloud;
}

TEST(Filter3d, IsAFifthOfASquaredPixelAtTheBestView) {
  // Of two views at a depth of 2, the one whose focal length is 200 resolves 0.01 m.
  EXPECT_NEAR(sizesOf({0, 0, 2}, {camera(50), camera(200)})[0], 0.01 * std::sqrt(0.2), 1e-9);
  EXPECT_NEAR(sizesOf({0, 0, 2}, {camera(50)}, 0.8)[0], 0.04 * std::sqrt(0.8), 1e-8);
  Camera parallel = camera(50);
  parallel.model = CameraModel::kOrthographic;
  EXPECT_NEAR(sizesOf({0, 0, 7}, {parallel})[0], 0.02 * std::sqrt(0.2), 1e-9);
}

TEST(Filter3d, LooksFifteenPercentBeyondThePictureAndNotBehindTheCamera) {
  // x = 1.3 z leaves at pixel 50 + 65 = 115: the end of the margin.
  const std::vector<float> sizes =
      sizesOf({1.299f, 0, 1, 1.301f, 0, 1, 0, 0, -1, 0, 0, 3}, {camera()});
  EXPECT_NEAR(sizes[0], 0.02 * std::sqrt(0.2), 1e-8);
  // Those that are not seen get the largest of those that are.
  EXPECT_EQ(sizes[1], sizes[3]);
  EXPECT_EQ(sizes[2], sizes[3]);
  EXPECT_NEAR(sizes[3], 0.06 * std::sqrt(0.2), 1e-8);
}

TEST(Filter3d, IsNothingWhereNobodyLooks) {
  EXPECT_EQ(sizesOf({0, 0, -1}, {camera()})[0], 0.0f);
  EXPECT_EQ(sizesOf({0, 0, 1}, {})[0], 0.0f);
  EXPECT_TRUE(sizesOf({}, {camera()}).empty());
}

TEST(Filter3d, KeepsOpacityTimesVolume) {
  RawSplats splats = splatsOf({{0.01f, 0.8f}, {0.5f, 0.3f}, {1e-5f, 0.9f}});
  splats.log_scales[0] = std::log(0.003f);
  for (size_t i = 0; i < 3; ++i) splats.positions[i * 3] = 0, splats.positions[i * 3 + 2] = 1;
  const auto strategy = looked(splats);
  const SplatCloud before = activated(splats), now = drawn(*strategy, splats);
  for (size_t i = 0; i < 3; ++i) {
    double volume[2] = {1, 1};
    for (size_t a = 0; a < 3; ++a) {
      const double scale = static_cast<double>(before.scales[i * 3 + a]);
      const double widened = static_cast<double>(now.scales[i * 3 + a]);
      EXPECT_NEAR(widened, std::sqrt(scale * scale + 0.2 * 0.02 * 0.02), 1e-7 * (1 + widened));
      volume[0] *= scale;
      volume[1] *= widened;
    }
    const double mass = static_cast<double>(before.opacities[i]) * volume[0];
    // Four numbers of float32.
    EXPECT_NEAR(static_cast<double>(now.opacities[i]) * volume[1], mass, 4e-7 * mass);
  }
}

TEST(Filter3d, ChangesNothingBeforeTheFirstLookNorWithoutVariance) {
  const RawSplats splats = splatsOf({{0.01f, 0.8f}});
  const SplatCloud before = activated(splats);
  EXPECT_EQ(drawn(*makeStrategy("adaptive+filter_3d"), splats).scales, before.scales);
  const auto none = looked(splats, "filter_3d(variance=0)");
  EXPECT_EQ(drawn(*none, splats).opacities, before.opacities);
}

/// Holds the adjoint of drawing to central differences, with random weights of what is drawn.
/// Steps of 2^-7: the value is of float32 numbers of about 1 (off by 6e-8, over the step 8e-6); the
/// second-order error is the step squared over 6, 1e-5, of derivatives of at most 1.
void judge(const Parameterisation& how, const RawSplats& splats) {
  constexpr float kStep = 0.0078125f;
  constexpr double kTolerance = 3e-5;
  const size_t count = splats.size();
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<float> by_scales(3 * count), by_opacities(count);
  for (float& weight : by_scales) weight = uniform(random);
  for (float& weight : by_opacities) weight = uniform(random);
  const std::vector<float> scale_weights = by_scales, opacity_weights = by_opacities;
  const auto value = [&](const RawSplats& at) {
    SplatCloud cloud = activated(at);
    how.activate(at, cloud);
    double sum = 0;
    for (size_t k = 0; k < 3 * count; ++k) {
      sum += static_cast<double>(scale_weights[k]) * static_cast<double>(cloud.scales[k]);
    }
    for (size_t i = 0; i < count; ++i) {
      sum += static_cast<double>(opacity_weights[i]) * static_cast<double>(cloud.opacities[i]);
    }
    return sum;
  };
  SplatCloud cloud = activated(splats);
  how.activate(splats, cloud);
  RawSplats by_raw = zerosLike(splats);
  CloudGradient gradient;
  gradient.scales = by_scales;
  gradient.opacities = by_opacities;
  how.adjoint(splats, cloud, gradient, by_raw);
  const auto difference = [&](std::vector<float> RawSplats::*array, size_t k) {
    RawSplats up = splats, down = splats;
    (up.*array)[k] += kStep;
    (down.*array)[k] -= kStep;
    const double span = static_cast<double>((up.*array)[k]) - static_cast<double>((down.*array)[k]);
    return (value(up) - value(down)) / span;
  };
  for (size_t k = 0; k < 3 * count; ++k) {
    EXPECT_NEAR(by_raw.log_scales[k], difference(&RawSplats::log_scales, k), kTolerance) << k;
  }
  for (size_t i = 0; i < count; ++i) {
    EXPECT_NEAR(by_raw.logits[i], difference(&RawSplats::logits, i), kTolerance) << i;
  }
}

/// Three splats at a depth of 1, with axes about as long as the filter.
RawSplats differentAxes() {
  RawSplats splats = splatsOf({{0.01f, 0.8f}, {0.004f, 0.3f}, {0.03f, 0.99f}});
  splats.log_scales[1] = std::log(0.02f);
  for (size_t i = 0; i < 3; ++i) splats.positions[i * 3] = 0, splats.positions[i * 3 + 2] = 1;
  return splats;
}

TEST(Filter3d, ItsAdjointIsTheDerivative) {
  const RawSplats splats = differentAxes();
  judge(*looked(splats)->parameterisation(), splats);
}

/// Scales that are never below a hundredth.
class Offset final : public Parameterisation {
 public:
  void activate(const RawSplats&, SplatCloud& cloud) const override {
    for (float& scale : cloud.scales) scale += 0.01f;
  }
  void adjoint(const RawSplats&, const SplatCloud& cloud, const CloudGradient& by_cloud,
               RawSplats& by_raw) const override {
    for (size_t k = 0; k < cloud.scales.size(); ++k) {
      by_raw.log_scales[k] = by_cloud.scales[k] * (cloud.scales[k] - 0.01f);
    }
  }
};

TEST(Filter3d, ComesAfterAParameterisationAndBeforeItOnTheWayBack) {
  const RawSplats splats = differentAxes();
  const auto part = makeFilter3d();
  Cameras cameras(splats, {camera()});
  part->sweep(controlMoment(at(1), EventSchedule{}), cameras);
  const Offset offset;
  const FilteredParameterisation both(&offset, *part->filter());
  SplatCloud cloud = activated(splats);
  both.activate(splats, cloud);
  EXPECT_NEAR(cloud.scales[0], std::sqrt(0.02 * 0.02 + 0.2 * 0.02 * 0.02), 1e-8);
  judge(both, splats);
}

TEST(Filter3d, StandsScalesFromNothingToHuge) {
  RawSplats splats = splatsOf(std::vector<Kind>(3, {0.01f, 0.8f}));
  for (size_t i = 0; i < 3; ++i) splats.positions[i * 3] = 0, splats.positions[i * 3 + 2] = 1;
  for (size_t a = 0; a < 3; ++a) {
    splats.log_scales[a] = -200;
    splats.log_scales[3 + a] = 60;
  }
  splats.log_scales[6] = -200;
  splats.log_scales[7] = 60;
  const auto strategy = looked(splats);
  const SplatCloud cloud = drawn(*strategy, splats);
  EXPECT_EQ(cloud.opacities[0], 0.0f);
  EXPECT_EQ(cloud.opacities[1], 0.8f);
  std::vector<float> by_scales(9, 1.0f), by_opacities(3, 1.0f);
  RawSplats by_raw = zerosLike(splats);
  CloudGradient gradient;
  gradient.scales = by_scales;
  gradient.opacities = by_opacities;
  strategy->parameterisation()->adjoint(splats, cloud, gradient, by_raw);
  for (const float value : by_raw.log_scales) EXPECT_TRUE(std::isfinite(value));
  for (const float value : by_raw.logits) EXPECT_TRUE(std::isfinite(value));
}

TEST(Filter3d, LooksAgainAfterEventsAndNowAndThenLater) {
  RawSplats splats = splatsOf({{0.01f, 0.8f}});
  splats.positions[2] = 1;
  const auto strategy = looked(splats);
  EXPECT_FALSE(strategy->wantsSweep(at(2)));
  EXPECT_FALSE(strategy->wantsSweep(at(600)));
  editAt(*strategy, at(600), splats);
  EXPECT_TRUE(strategy->wantsSweep(at(601)));
  Cameras cameras(splats, {camera()});
  strategy->sweep(at(601), cameras);
  EXPECT_FALSE(strategy->wantsSweep(at(602)));
  EXPECT_TRUE(strategy->wantsSweep(at(15100)));
  EXPECT_FALSE(strategy->wantsSweep(at(15101)));
  EXPECT_TRUE(strategy->wantsSweep(at(29800)));
  EXPECT_FALSE(strategy->wantsSweep(at(29900)));
  EXPECT_FALSE(strategy->wantsSweep(at(30000)));
}

TEST(Filter3d, GoesOnFromItsState) {
  RawSplats splats = splatsOf({{0.01f, 0.8f}});
  splats.positions[2] = 1;
  const auto first = looked(splats);
  const auto second = makeStrategy("adaptive+filter_3d");
  second->restore(first->state());
  EXPECT_FALSE(second->wantsSweep(at(2)));
  EXPECT_EQ(drawn(*first, splats).scales, drawn(*second, splats).scales);
  TensorTable broken = first->state();
  broken["filter_3d.sizes"] = {{1}, std::vector<float>{-1}};
  EXPECT_THAT(messageOf([&] { second->restore(broken); }), HasSubstr("among sizes"));
}

TEST(Filter3d, GivesTheSameForAnyThreads) {
  std::vector<float> positions(60000);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-2, 3);
  for (float& value : positions) value = uniform(random);
  std::vector<float> sizes[2];
  for (unsigned threads = 1; threads <= 2; ++threads) {
    withThreads(threads, [&] { sizes[threads - 1] = sizesOf(positions, {camera(), camera(90)}); });
  }
  EXPECT_EQ(sizes[0], sizes[1]);
}

}  // namespace
}  // namespace stipple
