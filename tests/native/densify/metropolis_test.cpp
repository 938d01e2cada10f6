#include "densify/strategies/metropolis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/control_cases.h"
#include "densify/known_views.h"
#include "math/covariance.h"

namespace stipple {
namespace {

using namespace stipple::testing;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Splats of one kind over the picture of a camera that looks along z.
RawSplats splatsInFront(size_t count, uint32_t seed = 1) {
  RawSplats splats = mixedSplats(count, seed, 1, 1);
  for (size_t i = 0; i < count; ++i) splats.positions[i * 3 + 2] = 2;
  return splats;
}

/// Two of them see the box of mixedSplats() whole. The left half of the picture is wrong.
KnownViews viewsOf(const RawSplats& splats, size_t count = 2) {
  KnownViews views;
  views.cloud = activated(splats);
  for (size_t v = 0; v < count; ++v) {
    KnownView view = plainView(forwardCamera(100, 100, 90), 0.5f, 0.5f);
    for (size_t i = 0; i < view.picture.size(); ++i) {
      if (i / 3 % 100 < 50) view.picture[i] = 0.9f;
    }
    views.views.push_back(std::move(view));
  }
  return views;
}

std::optional<SplatEdit> eventOf(Strategy& strategy, const FitMoment& moment,
                                 const RawSplats& splats, KnownViews& views) {
  if (strategy.wantsSweep(moment)) strategy.sweep(moment, views);
  return editAt(strategy, moment, splats);
}

TEST(Metropolis, CrowdingAsWorkedOutByHand) {
  EXPECT_EQ(crowdingFactor(5, 0), 1);
  EXPECT_DOUBLE_EQ(crowdingFactor(5, 1), 1.0 / 6);
}

TEST(Metropolis, CuesCountInTheirDeviations) {
  EXPECT_THAT(normalisedCue({1, 3, 100}, {1, 1, 0}), ElementsAre(-1, 1, 0));
  EXPECT_THAT(normalisedCue({0.1, 0.1, 0.1}, {1, 1, 1}),
              Each(::testing::DoubleNear(0, 1e-9)));  // rounding of 1e-17 over 1e-7
  EXPECT_THAT(normalisedCue({0, 0}, {1, 1}), Each(0.0));
  EXPECT_THAT(normalisedCue({7}, {1}), ElementsAre(0));
  EXPECT_THAT(normalisedCue({7, 8}, {0, 0}), Each(0.0));
}

TEST(Metropolis, SplatsAreBornWherePicturesAreWrong) {
  constexpr size_t kCount = 40000;
  const RawSplats splats = splatsInFront(kCount);
  KnownViews views = viewsOf(splats);
  const auto strategy = makeStrategy("metropolis(crowding=0,coarse=0,fine=16000)");
  const auto edit = eventOf(*strategy, publishedMoment(600), splats, views);
  const Edited now = moved(*edit, splats);
  EXPECT_THAT(views.drawn, ElementsAre(0));  // 1 - 100/14500 of two views
  const std::vector<float> score = strategy->seen(now.splats.size()).score;
  ASSERT_EQ(score.size(), now.splats.size());
  size_t left = 0;
  for (size_t i = kCount; i < now.splats.size(); ++i) {
    left += now.splats.positions[i * 3] < 0;
    EXPECT_EQ(score[i], 0);  // newborn
  }
  const double births = static_cast<double>(now.splats.size() - kCount);
  // Chances of being drawn once or more, times those of being accepted.
  const double tries = std::floor(16000 * (1 - 100.0 / 14500));
  const double sum = std::accumulate(score.begin(), score.begin() + kCount, 0.0);
  double expected[2] = {0, 0}, mean[2] = {0, 0}, count[2] = {0, 0};
  for (size_t i = 0; i < kCount; ++i) {
    const double importance = static_cast<double>(score[i]);
    const size_t side = splats.positions[i * 3] < 0 ? 0 : 1;
    expected[side] += -std::expm1(-tries * importance / sum) / (1 + std::exp(-importance));
    mean[side] += importance;
    ++count[side];
  }
  // Four standard deviations of the number of births, and of the left among them.
  const double total = expected[0] + expected[1];
  EXPECT_NEAR(births, total, 4 * std::sqrt(total));
  EXPECT_NEAR(static_cast<double>(left) / births, expected[0] / total, 2 / std::sqrt(births));
  EXPECT_GT(mean[0] / count[0], mean[1] / count[1] + 0.2);
}

TEST(Metropolis, CopiesArriveWholeAndAsCloseAsTheBatchSays) {
  // One splat many times, turned: places are spread along its own axes.
  constexpr size_t kCount = 20000;
  RawSplats one = splatsInFront(1, 5);
  one.positions = {0, 0, 2};
  one.log_scales = {-3, -5, -7};
  const RawSplats splats = rowsOf(one, std::vector<uint32_t>(kCount, 0));
  KnownViews views = viewsOf(splats);
  const FitMoment moment = publishedMoment(600);
  for (const bool released : {false, true}) {
    const auto strategy = makeStrategy(std::string("metropolis(crowding=0,coarse=60000,fine=0") +
                                       (released ? ",released=1)" : ")"));
    const Edited now = moved(*eventOf(*strategy, moment, splats, views), splats);
    const size_t births = now.splats.size() - kCount;
    ASSERT_GT(births, 5000u);
    Mat3d seen = Mat3d::Zero();
    for (size_t i = kCount; i < now.splats.size(); ++i) {
      const float* p = &now.splats.positions[i * 3];
      const Vec3d offset(static_cast<double>(p[0]), static_cast<double>(p[1]),
                         static_cast<double>(p[2]) - 2);
      seen += offset * offset.transpose() / static_cast<double>(births);
    }
    const double eta = 100.0 / 14500;
    const double factor = (10 - 5 * eta) / (1 + std::log(2.0));
    Mat3d axes = Vec3d(std::exp(-3.0), std::exp(-5.0), std::exp(-7.0)).asDiagonal();
    if (!released) axes = rotationFromQuaternion<double>(one.rotations.data()) * axes;
    const Mat3d expected = factor * factor * axes * axes.transpose();
    // Five standard errors of 5000: 5 sqrt(2 / 5000).
    EXPECT_LT((seen - expected).norm() / expected.norm(), 0.1) << released;
    EXPECT_EQ(now.splats.log_scales[kCount * 3 + 1], -5);
    EXPECT_EQ(now.splats.logits[kCount], one.logits[0]);
    EXPECT_EQ(now.splats.sh[kCount * 12 + 5], one.sh[5]);
    EXPECT_EQ(now.moments.logits[kCount], 0);
  }
}

TEST(Metropolis, CrowdsHaveFewBirths) {
  RawSplats one = splatsInFront(1, 5);
  one.positions = {0.01f, 0.01f, 2.01f};
  one.log_scales = {-12, -12, -12};
  const RawSplats splats = rowsOf(one, std::vector<uint32_t>(1000, 0));
  KnownViews views = viewsOf(splats);
  const auto strategy = makeStrategy("metropolis");
  const size_t births =
      eventOf(*strategy, publishedMoment(600), splats, views)->countAfter(1000) - 1000;
  // Cues are equal: 2000 tries at most, accepted s(s(0)) / 5001 times.
  EXPECT_LT(births, 5u);
}

TEST(Metropolis, TriesAndViewsFadeOut) {
  const RawSplats splats = splatsInFront(3000);
  KnownViews views = viewsOf(splats, 8);
  const auto strategy = makeStrategy("metropolis(crowding=0,coarse=0,fine=3000)");
  const size_t early =
      eventOf(*strategy, publishedMoment(600), splats, views)->countAfter(3000) - 3000;
  EXPECT_THAT(views.drawn, ElementsAre(0, 1, 2, 3, 4, 5, 6));  // 600 * 7 mod 8
  views.drawn.clear();
  const size_t late =
      eventOf(*strategy, publishedMoment(14900), splats, views)->countAfter(3000) - 3000;
  EXPECT_THAT(views.drawn, ElementsAre(4));  // 14900 mod 8
  EXPECT_GT(early, 500u);
  EXPECT_LT(late, 21u);  // 3000 * 100 / 14500 tries
  EXPECT_FALSE(strategy->wantsSweep(publishedMoment(650)));
  EXPECT_FALSE(strategy->wantsSweep(publishedMoment(15000)));
}

TEST(Metropolis, ViewsThatIterationsHaveDrawnAreNotDrawnAgain) {
  const RawSplats splats = splatsInFront(3000);
  KnownViews views = viewsOf(splats, 8);
  for (size_t v = 0; v < 8; ++v) {  // another thing wrong in each
    std::vector<float>& picture = views.views[v].picture;
    for (size_t i = 0; i < 3000; ++i) picture[(7919 * v + i) % picture.size()] = 0.1f;
  }
  const auto drawing = makeStrategy("metropolis"), watching = makeStrategy("metropolis");
  const auto drawn = eventOf(*drawing, publishedMoment(600), splats, views);
  EXPECT_EQ(views.drawn.size(), 7u);
  views.drawn.clear();
  // A round of views before the event, the one outside its block first; then the first one again.
  FitMoment moment = publishedMoment(592);
  for (const size_t view : {7, 0, 1, 2, 3, 4, 5, 6, 0}) {
    const bool counts = view < 7 && moment.iteration < 600;
    EXPECT_EQ(iterate(*watching, views, moment, view).error_maps, counts) << view;
    ++moment.iteration;
  }
  moment = publishedMoment(600);
  moment.view_count = 8;
  const auto watched = eventOf(*watching, moment, splats, views);
  EXPECT_THAT(views.drawn, ::testing::IsEmpty());
  const std::vector<float> a = drawing->seen(drawn->countAfter(3000)).score;
  const std::vector<float> b = watching->seen(watched->countAfter(3000)).score;
  // Differences of pictures are summed in another order: single precision.
  for (size_t i = 0; i < 3000; ++i) EXPECT_NEAR(a[i], b[i], 1e-5);
  // Long before an event nothing is asked for.
  EXPECT_FALSE(iterate(*watching, views, publishedMoment(650), 0).any());
  EXPECT_FALSE(iterate(*watching, views, publishedMoment(14990), 0).any());
}

TEST(Metropolis, GoesOnFromItsStateInTheMiddleOfItsViews) {
  const RawSplats splats = splatsInFront(500);
  KnownViews views = viewsOf(splats, 4);
  const auto whole = makeStrategy("metropolis"), half = makeStrategy("metropolis");
  for (const auto& strategy : {whole.get(), half.get()}) {
    iterate(*strategy, views, publishedMoment(598), 1);
    iterate(*strategy, views, publishedMoment(599), 2);
  }
  const auto other = makeStrategy("metropolis");
  other->restore(half->state());
  for (const auto& strategy : {whole.get(), other.get()}) {
    iterate(*strategy, views, publishedMoment(600), 0);
  }
  FitMoment moment = publishedMoment(600);
  moment.view_count = 4;
  const Edited a = moved(*eventOf(*whole, moment, splats, views), splats);
  const Edited b = moved(*eventOf(*other, moment, splats, views), splats);
  EXPECT_TRUE(areSame(a.splats, b.splats));
  EXPECT_EQ(whole->seen(a.splats.size()).score, other->seen(b.splats.size()).score);
  TensorTable broken = half->state();
  broken["metropolis_birth.view_counts"] = {{1}, std::vector<uint32_t>{1}};
  EXPECT_THROW(makeStrategy("metropolis")->restore(broken), Error);
}

TEST(Metropolis, WhatNoViewSeesDoesNotTry) {
  RawSplats splats = splatsInFront(500);
  for (size_t i = 0; i < 250; ++i) splats.positions[i * 3 + 2] = -2;
  KnownViews views = viewsOf(splats);
  const Edited now =
      moved(*eventOf(*makeStrategy("metropolis(crowding=0)"), publishedMoment(600), splats, views),
            splats);
  ASSERT_GT(now.splats.size(), 600u);
  for (size_t i = 500; i < now.splats.size(); ++i) EXPECT_GT(now.splats.positions[i * 3 + 2], 0);
}

TEST(Metropolis, KeepsToTheCap) {
  const RawSplats splats = splatsInFront(500);
  KnownViews views = viewsOf(splats);
  for (const uint64_t cap : {uint64_t{520}, uint64_t{500}, uint64_t{100}}) {
    const auto strategy = makeStrategy("metropolis(crowding=0)");
    EXPECT_EQ(eventOf(*strategy, publishedMoment(600, cap), splats, views)->countAfter(500),
              std::max<uint64_t>(cap, 500));
  }
}

TEST(Metropolis, FaintOnesMoveBeforeBirths) {
  RawSplats splats = splatsInFront(200);
  for (size_t i = 0; i < 100; ++i) splats.logits[i] = -8;
  KnownViews views = viewsOf(splats);
  const auto strategy = makeStrategy("metropolis(coarse=0,fine=0)");
  const Edited now = moved(*eventOf(*strategy, publishedMoment(600), splats, views), splats);
  ASSERT_EQ(now.splats.size(), 200u);
  for (const float logit : now.splats.logits) EXPECT_GT(logit, -6);
}

TEST(Metropolis, OneSplatAllDeadAndNoLookAround) {
  for (const size_t count : {size_t{1}, size_t{50}}) {
    RawSplats splats = mixedSplats(count, 1, -9, -8);
    const auto strategy = makeStrategy("metropolis");
    const auto edit = editAt(*strategy, publishedMoment(600), splats);  // nobody swept
    EXPECT_GE(moved(*edit, splats).splats.size(), count);
    KnownViews none;
    none.cloud = activated(splats);
    EXPECT_TRUE(eventOf(*strategy, publishedMoment(700), splats, none));
  }
}

TEST(Metropolis, ReleasedReadsPixelsAtTheWorldsPlaces) {
  const RawSplats splats = splatsInFront(2000);
  KnownViews views = viewsOf(splats);
  // A camera that sees nothing of them: nobody would try.
  views.views[0].camera.world_to_camera(2, 3) = -100;
  const auto strategy = makeStrategy("metropolis(released=1,coarse=0,fine=0)");
  eventOf(*strategy, publishedMoment(600), splats, views);
  const std::vector<float> score = strategy->seen(splats.size()).score;
  ASSERT_EQ(score.size(), 2000u);
  // World x from 0 to 1 is the width, wrong left of 0.5. Away from that edge and from the border of
  // the picture, splats of one side read the same.
  std::vector<float> first, last;
  for (size_t i = 0; i < 2000; ++i) {
    const float x = splats.positions[i * 3], y = splats.positions[i * 3 + 1];
    if (y < 0.2f || y > 0.8f) continue;
    if (x < 0.4f && x > 0.1f) first.push_back(score[i]);
    if (x > 0.6f && x < 0.9f) last.push_back(score[i]);
  }
  ASSERT_GT(first.size(), 20u);
  ASSERT_GT(last.size(), 20u);
  EXPECT_NEAR(*std::min_element(first.begin(), first.end()),
              *std::max_element(first.begin(), first.end()), 1e-4);
  EXPECT_NEAR(*std::min_element(last.begin(), last.end()),
              *std::max_element(last.begin(), last.end()), 1e-4);
  EXPECT_GT(std::abs(first[0] - last[0]), 1e-3);
  views.views[0].camera.width = 10;
  views.views[0].camera.height = 1000;
  views.views.push_back(views.views[1]);
  try {
    eventOf(*makeStrategy("metropolis(released=1)"), publishedMoment(600), splats, views);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("averages images of one size; there are 10 x 1000 and 100 x 100"));
  }
}

TEST(Metropolis, SameForAnyNumberOfThreads) {
  const RawSplats splats = splatsInFront(3000);
  RawSplats results[2];
  for (unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] {
      KnownViews views = viewsOf(splats);
      const auto strategy = makeStrategy("metropolis");
      results[threads - 1] =
          moved(*eventOf(*strategy, publishedMoment(600), splats, views), splats).splats;
    });
  }
  EXPECT_GT(results[0].size(), 3000u);
  EXPECT_TRUE(areSame(results[0], results[1]));
}

TEST(Metropolis, VoxelsGrowWithTheScene) {
  // A million times as large, cameras too: the same births.
  RawSplats metres = splatsInFront(2000), micrometres = metres;
  for (float& value : micrometres.positions) value *= 1048576;
  for (float& value : micrometres.log_scales) value += std::log(1048576.0f);
  FitMoment moment = publishedMoment(600), large = moment;
  large.extent *= 1048576;
  KnownViews views = viewsOf(metres), large_views = viewsOf(micrometres);
  const auto count = [](const FitMoment& at, const RawSplats& splats, KnownViews& seen) {
    return eventOf(*makeStrategy("metropolis(edge=0.3)"), at, splats, seen)->countAfter(2000);
  };
  EXPECT_EQ(count(moment, metres, views), count(large, micrometres, large_views));
}

}  // namespace
}  // namespace stipple
