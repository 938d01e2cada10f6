#include "train/loop/densify_cloud.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/control_part.h"
#include "toy_views.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;

constexpr size_t kViews = 6;
constexpr uint32_t kSize = 48;

std::vector<size_t> all(const ViewSource& views) {
  std::vector<size_t> chosen(views.count());
  std::iota(chosen.begin(), chosen.end(), size_t{0});
  return chosen;
}

/// A ball of as many splats as show its colours only coarsely, with pictures of a finer one.
struct Scene {
  SplatCloud coarse = toyBall(60);
  std::shared_ptr<MemoryViewSource> views = toyViews(toyBall(1200), kViews, kSize);
};

template <typename Call>
std::string messageOf(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing thrown";
}

bool isEqual(const SplatCloud& a, const SplatCloud& b) {
  return a.positions == b.positions && a.rotations == b.rotations && a.scales == b.scales &&
         a.opacities == b.opacities && a.sh == b.sh;
}

/// Row `a` of one cloud and `b` of another hold the same bits.
bool isSameSplat(const SplatCloud& x, size_t a, const SplatCloud& y, size_t b) {
  const size_t stride = x.shStride();
  return std::equal(&x.positions[a * 3], &x.positions[a * 3] + 3, &y.positions[b * 3]) &&
         std::equal(&x.rotations[a * 4], &x.rotations[a * 4] + 4, &y.rotations[b * 4]) &&
         std::equal(&x.scales[a * 3], &x.scales[a * 3] + 3, &y.scales[b * 3]) &&
         x.opacities[a] == y.opacities[b] &&
         std::equal(&x.sh[a * stride], &x.sh[a * stride] + stride, &y.sh[b * stride]);
}

TEST(DensifyCloud, MultipliesWhatPicturesPullAtAndKeepsTheRestBitForBit) {
  const Scene scene;
  DensifyOptions options;
  options.max_splats = 90;
  const SplatCloud made =
      densifyCloud(*cpuBackends(), scene.coarse, scene.views, all(*scene.views), options);
  EXPECT_EQ(made.size(), 90u);
  // Those that stay come first, in their order.
  size_t from = 0, kept = 0;
  while (kept < made.size()) {
    while (from < scene.coarse.size() && !isSameSplat(scene.coarse, from, made, kept)) ++from;
    if (from == scene.coarse.size()) break;
    ++from;
    ++kept;
  }
  // 30 more splats: 30 parents split, whose 60 children come at the end.
  EXPECT_EQ(kept, 30u);
}

/// Nothing is pulled at that strongly.
DensifyOptions nothingMultiplies() {
  DensifyOptions options;
  options.strategy = "adaptive(threshold=1000)";
  return options;
}

TEST(DensifyCloud, LeavesSplatsThatNeitherMultiplyNorGoBitForBit) {
  const SplatCloud cloud = toyBall(300);
  const auto views = toyViews(cloud, kViews, kSize);
  EXPECT_TRUE(
      isEqual(densifyCloud(*cpuBackends(), cloud, views, all(*views), nothingMultiplies()), cloud));
}

TEST(DensifyCloud, GivesTheSameForAnyNumberOfThreadsAndAnyPictureMemory) {
  const Scene scene;
  DensifyOptions options;
  options.event_count = 3;
  SplatCloud one, two;
  withThreads(1, [&] {
    one = densifyCloud(*cpuBackends(), scene.coarse, scene.views, all(*scene.views), options);
  });
  options.picture_bytes = 0;
  withThreads(2, [&] {
    two = densifyCloud(*cpuBackends(), scene.coarse, scene.views, all(*scene.views), options);
  });
  EXPECT_GT(one.size(), scene.coarse.size());
  EXPECT_TRUE(isEqual(one, two));
}

TEST(DensifyCloud, LooksAgainBetweenEvents) {
  const Scene scene;
  DensifyOptions options;
  options.max_splats = 100000;
  const std::vector<size_t> shown = all(*scene.views);
  const SplatCloud once = densifyCloud(*cpuBackends(), scene.coarse, scene.views, shown, options);
  options.event_count = 3;
  const SplatCloud thrice = densifyCloud(*cpuBackends(), scene.coarse, scene.views, shown, options);
  EXPECT_GT(once.size(), scene.coarse.size());
  EXPECT_GT(thrice.size(), once.size());
}

TEST(DensifyCloud, RemovesFaintSplatsAndLowersNoOpacity) {
  SplatCloud cloud = toyBall(300);
  const auto views = toyViews(cloud, kViews, kSize);
  cloud.opacities[7] = 0.001f;
  const SplatCloud made =
      densifyCloud(*cpuBackends(), cloud, views, all(*views), nothingMultiplies());
  EXPECT_EQ(made.size(), 299u);
  EXPECT_EQ(*std::min_element(made.opacities.begin(), made.opacities.end()), 0.95f);
}

TEST(DensifyCloud, KeepsASkyThatIsLargerThanTheWholeRig) {
  SplatCloud cloud = toyBall(300);
  const auto views = toyViews(cloud, kViews, kSize);
  for (size_t a = 0; a < 3; ++a) {
    cloud.positions[a] = 500.0f;  // far out: no picture of the ball shows it
    cloud.scales[a] = 100.0f;
  }
  EXPECT_EQ(densifyCloud(*cpuBackends(), cloud, views, all(*views), nothingMultiplies()).size(),
            300u);
}

TEST(DensifyCloud, NeverExceedsItsCapNorTwiceTheCountWhereNoneIsGiven) {
  const Scene scene;
  DensifyOptions options;
  options.event_count = 20;
  const SplatCloud made =
      densifyCloud(*cpuBackends(), scene.coarse, scene.views, all(*scene.views), options);
  EXPECT_GT(made.size(), 60u);
  EXPECT_LE(made.size(), 120u);
}

TEST(DensifyCloud, TakesOneSplatAndOneViewOfOnePixel) {
  const SplatCloud cloud = toyBall(1);
  const auto views = toyViews(toyBall(300), 1, 1);
  const SplatCloud made = densifyCloud(*cpuBackends(), cloud, views, all(*views), {});
  EXPECT_GE(made.size(), 1u);
  EXPECT_LE(made.size(), 2u);
}

TEST(DensifyCloud, SaysWhatItCannotTake) {
  const Scene scene;
  const std::vector<size_t> shown = all(*scene.views);
  const auto refusal = [&](const DensifyOptions& options) {
    return messageOf(
        [&] { densifyCloud(*cpuBackends(), scene.coarse, scene.views, shown, options); });
  };
  EXPECT_THAT(messageOf([&] { densifyCloud(*cpuBackends(), {}, scene.views, shown, {}); }),
              HasSubstr("no splats"));
  EXPECT_THAT(messageOf([&] { densifyCloud(*cpuBackends(), scene.coarse, scene.views, {}, {}); }),
              HasSubstr("no views to look at"));
  DensifyOptions options;
  options.max_splats = 59;
  EXPECT_THAT(refusal(options), HasSubstr("at most 59 splats are asked for; the cloud has 60"));
  options = {};
  options.event_count = 0;
  EXPECT_THAT(refusal(options), HasSubstr("event count is 0; 1 to 1000"));
  options = {};
  options.strategy = "best";
  EXPECT_THAT(refusal(options), HasSubstr("strategy is 'best'; there is adaptive"));
  SplatCloud linear = scene.coarse;
  linear.colour_space = ColourSpace::kLinear;
  EXPECT_THAT(messageOf([&] { densifyCloud(*cpuBackends(), linear, scene.views, shown, {}); }),
              HasSubstr("different colour spaces"));
}

TEST(DensifyCloud, EndsWhereItIsCancelled) {
  const Scene scene;
  Progress progress;
  progress.cancel();
  EXPECT_THROW(
      densifyCloud(*cpuBackends(), scene.coarse, scene.views, all(*scene.views), {}, &progress),
      Error);
}

TEST(StandaloneEvents, AreSpreadOverTheWindowAndTakeNoSteps) {
  FitMoment moment;
  moment.standalone = StandaloneEvent{1, 4, true};
  const ControlMoment at = controlMoment(moment, EventSchedule{});
  EXPECT_TRUE(at.is_event);
  EXPECT_TRUE(at.is_learning);
  EXPECT_FALSE(at.takes_steps);
  EXPECT_EQ(at.event, 1u);
  EXPECT_EQ(at.event_count, 4u);
  EXPECT_EQ(at.progress, 0.5);
  EXPECT_EQ(at.iteration, 500u + 14500u * 2 / 5);
  moment.standalone->is_now = false;
  EXPECT_FALSE(controlMoment(moment, EventSchedule{}).is_event);
}

}  // namespace
}  // namespace stipple
