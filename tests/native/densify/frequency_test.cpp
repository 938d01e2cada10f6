#include "densify/strategies/frequency.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/control_cases.h"
#include "densify/known_views.h"
#include "densify/parts/density_scale.h"
#include "densify/quantities/local_radius.h"
#include "densify/quantities/view_confidence.h"

namespace stipple {
namespace {

using namespace stipple::testing;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

RawSplats withExtras(RawSplats splats) {
  splats.extra_lengths = {1, 3};
  splats.extras = DensityScale::initialExtras(splats);
  return splats;
}

SplatCloud drawnAs(const RawSplats& splats) {
  SplatCloud cloud = activated(splats);
  DensityScale().activate(splats, cloud);
  return cloud;
}

TEST(DensityScale, BeginsWithTheScalesThatThereAre) {
  const RawSplats splats = withExtras(mixedSplats(200, 1));
  const SplatCloud before = activated(splats), now = drawnAs(splats);
  for (size_t k = 0; k < 600; ++k) {
    // Logarithms of about 5 in float32, added twice: 1e-6.
    EXPECT_NEAR(now.scales[k] / before.scales[k], 1, 3e-6f);
    EXPECT_LT(now.scales[k], std::exp(splats.extras[0][k / 3]));
  }
  RawSplats round = mixedSplats(1, 1);
  round.log_scales = {-1, -1, -1};
  const std::vector<std::vector<float>> extras = DensityScale::initialExtras(round);
  for (const float u : extras[1]) EXPECT_NEAR(u, 0, 1e-6f);
}

TEST(DensityScale, AFreshStartIsThreeQuartersOfItsDistance) {
  RawSplats splats = mixedSplats(1, 1);
  splats.log_scales = {-1, -1, -1};
  const auto strategy = makeStrategy("frequency");
  strategy->prepare(splats, 30000);
  // R = 1.5 d and u = 0, as published.
  EXPECT_NEAR(std::exp(strategy->initialExtras(splats)[0][0]), 1.5 * std::exp(-1.0), 1e-6);
  EXPECT_EQ(strategy->parameters().size(), 2u);
  EXPECT_NE(strategy->parameterisation(), nullptr);
}

TEST(DensityScale, DerivativesAreThoseOfTheScales) {
  RawSplats splats = withExtras(mixedSplats(20, 2));
  for (size_t k = 0; k < 60; ++k) splats.extras[1][k] += 0.1f * static_cast<float>(k % 7) - 0.3f;
  std::vector<float> by_scale(60);
  for (size_t k = 0; k < 60; ++k) by_scale[k] = 100 * std::sin(static_cast<float>(k) + 1);
  const SplatCloud cloud = drawnAs(splats);
  CloudGradient by_cloud;
  by_cloud.scales = by_scale;
  RawSplats by_raw = zerosLike(splats);
  std::fill(by_raw.log_scales.begin(), by_raw.log_scales.end(), 7.0f);
  DensityScale().adjoint(splats, cloud, by_cloud, by_raw);
  EXPECT_THAT(by_raw.log_scales, Each(0.0f));
  const auto value = [&](const RawSplats& at) {
    const SplatCloud drawn = drawnAs(at);
    double sum = 0;
    for (size_t k = 0; k < 60; ++k) {
      sum += static_cast<double>(by_scale[k]) * static_cast<double>(drawn.scales[k]);
    }
    return sum;
  };
  // Central differences of float32 scales: 1e-7 / 1e-2 of a term, and their curvature 1e-4 / 6.
  constexpr float kStep = 1e-2f;
  for (size_t extra = 0; extra < 2; ++extra) {
    for (size_t k = 0; k < splats.extras[extra].size(); ++k) {
      RawSplats up = splats, down = splats;
      up.extras[extra][k] += kStep;
      down.extras[extra][k] -= kStep;
      const double step =
          static_cast<double>(up.extras[extra][k]) - static_cast<double>(down.extras[extra][k]);
      const double slope = (value(up) - value(down)) / step;
      EXPECT_NEAR(static_cast<double>(by_raw.extras[extra][k]), slope,
                  2e-4 * std::abs(slope) + 3e-4);
    }
  }
}

TEST(DensityScale, SaturatesWithinItsRadius) {
  RawSplats splats = withExtras(mixedSplats(1, 2));
  splats.extras = {{0.5f}, {100, -100, 0}};
  const SplatCloud cloud = drawnAs(splats);
  EXPECT_FLOAT_EQ(cloud.scales[0], std::exp(0.5f));
  EXPECT_EQ(cloud.scales[1], std::exp(-99.5f));
  EXPECT_FLOAT_EQ(cloud.scales[2], 0.5f * std::exp(0.5f));
}

std::vector<float> lattice(int side) {
  std::vector<float> places;
  for (int i = 0; i < side * side * side; ++i) {
    places.push_back(static_cast<float>(i % side));
    places.push_back(static_cast<float>(i / side % side));
    places.push_back(static_cast<float>(i / side / side));
  }
  return places;
}

TEST(LocalRadii, OfALatticeAsWorkedOutByHand) {
  const std::vector<double> radii = localRadii(lattice(9));
  // 49 neighbours: 6 at 1, 12 at sqrt 2, 8 at sqrt 3, 6 at 2 and 17 at sqrt 5; h = 1.
  double sum = 0, weights = 0;
  const double shells[][2] = {{6, 1}, {12, 2}, {8, 3}, {6, 4}, {17, 5}};
  for (const auto& [count, square] : shells) {
    const double d = std::sqrt(square), weight = count * std::exp(-(d - 1) * (d - 1));
    sum += weight * d;
    weights += weight;
  }
  EXPECT_NEAR(radii[4 + 9 * (4 + 9 * 4)], 1.2 * sum / weights, 1e-12);
}

TEST(LocalRadii, FewSplatsAndTwins) {
  EXPECT_TRUE(localRadii({}).empty());
  EXPECT_TRUE(localRadii(std::vector<float>{1, 2, 3}).empty());
  EXPECT_THAT(localRadii(std::vector<float>{0, 0, 0, 0, 3, 4}),
              ElementsAre(::testing::DoubleNear(6, 1e-12), ::testing::DoubleNear(6, 1e-12)));
  // All at one place.
  EXPECT_THAT(localRadii(std::vector<float>(300, 0.25f)), Each(0.0));
  // Two of three at one place: the median of the nearest is 0, and all neighbours weigh the same.
  const std::vector<double> radii = localRadii(std::vector<float>{0, 0, 0, 0, 0, 0, 2, 0, 0});
  EXPECT_NEAR(radii[0], 1.2 * 1, 1e-12);
  EXPECT_NEAR(radii[2], 1.2 * 2, 1e-12);
  // Far away, and far apart.
  for (const double radius : localRadii(std::vector<float>{1e30f, 0, 0, -1e30f, 0, 0, 0, 0, 1})) {
    EXPECT_TRUE(std::isfinite(radius));
  }
}

TEST(LocalRadii, SameForAnyNumberOfThreads) {
  const std::vector<float> places = mixedSplats(3000, 4).positions;
  std::vector<double> one;
  withThreads(1, [&] { one = localRadii(places); });
  withThreads(2, [&] { EXPECT_EQ(localRadii(places), one); });
}

TEST(DynamicThreshold, IsTheQuantileOfThoseBelowThreeMeans) {
  // 0.001 to 0.1 evenly, and one outlier of 10: mean 0.149, range 0.001 to 0.446, all hundred in
  // it.
  std::vector<double> gradients;
  for (int k = 1; k <= 100; ++k) gradients.push_back(0.001 * k);
  gradients.push_back(10);
  const DynamicThreshold threshold = dynamicThreshold(gradients);
  EXPECT_FALSE(threshold.is_least);
  // The lower end of the bin that the 75th is in.
  EXPECT_NEAR(threshold.value, 0.075, 0.446 / 1000);
  EXPECT_LE(threshold.value, 0.075);
}

TEST(DynamicThreshold, EndsAtTheLeast) {
  EXPECT_EQ(dynamicThreshold(std::vector<double>{1e-5, 2e-5, 3e-5}).value, 5e-4);
  EXPECT_TRUE(dynamicThreshold(std::vector<double>{1e-5, 2e-5, 3e-5}).is_least);
  EXPECT_FALSE(dynamicThreshold(std::vector<double>{0, 0}).is_least);  // nothing was learned
  EXPECT_FALSE(dynamicThreshold({}).is_least);
  EXPECT_DOUBLE_EQ(dynamicThreshold(std::vector<double>{0.25, 0.25, 0.25}).value, 0.25);
  EXPECT_DOUBLE_EQ(dynamicThreshold(std::vector<double>{7}).value, 7);
}

TEST(ViewConfidence, SamplesAreSpreadAsTheFootprintIs) {
  // The grey value is the column, then the row: what the patch reads tells where it looked.
  Camera camera = forwardCamera(400, 400, 1);
  PlaceInPicture place;
  place.x = 200.5;
  place.y = 200.5;
  const FootprintFactor factor{30, 20, 10};
  Eigen::Matrix2d seen = Eigen::Matrix2d::Zero(), expected = Eigen::Matrix2d::Zero();
  FootprintPatch read[2];
  for (size_t axis = 0; axis < 2; ++axis) {
    std::vector<float> picture(400 * 400 * 3);
    for (size_t i = 0; i < picture.size(); ++i) {
      picture[i] = static_cast<float>(axis == 0 ? i / 3 % 400 : i / 3 / 400) / 399;
    }
    read[axis] = patchAt(camera, picture, place, factor);
  }
  Eigen::Matrix2d l;
  l << 30, 0, 20, 10;
  for (size_t k = 0; k < kFootprintSamples; ++k) {
    const FootprintSample& sample = footprintSamples()[k];
    const Eigen::Vector2d at(read[0][k] * 399 / 65534.0 - 200, read[1][k] * 399 / 65534.0 - 200);
    const Eigen::Vector2d unit(sample.x, sample.y);
    seen += at * at.transpose();
    expected += l * unit * unit.transpose() * l.transpose();
  }
  // Whole pixels: half of one in 90.
  EXPECT_LT((seen - expected).norm() / expected.norm(), 0.02);
  EXPECT_NEAR(footprintSamples()[41].weight, 0.011, 5e-4);
  place.x = 2;
  const FootprintPatch cut = patchAt(camera, std::vector<float>(480000, 0.5f), place, factor);
  EXPECT_GT(std::count(cut.begin(), cut.end(), kOutside), 10);
}

TEST(ViewConfidence, ComparesPatches) {
  FootprintPatch ramp, flat, inverse, outside;
  for (size_t k = 0; k < kFootprintSamples; ++k) {
    ramp[k] = static_cast<uint16_t>(1000 * k);
    inverse[k] = static_cast<uint16_t>(48000 - 1000 * k);
  }
  flat.fill(30000);
  outside.fill(kOutside);
  EXPECT_NEAR(patchSimilarity(ramp, ramp), 1, 1e-12);
  EXPECT_NEAR(patchSimilarity(flat, flat), 1, 1e-12);
  EXPECT_EQ(patchSimilarity(ramp, inverse), 0);  // held: it is negative
  EXPECT_EQ(patchSimilarity(ramp, outside), 0);
  EXPECT_LT(patchSimilarity(ramp, flat), 0.2);
  FootprintPatch half = ramp;
  half[3] = half[9] = kOutside;
  EXPECT_NEAR(patchSimilarity(ramp, half), 1, 1e-12);
}

/// Four splats in front of three cameras, side by side: both look along z.
struct Scene {
  RawSplats splats;
  KnownViews views;

  explicit Scene(size_t count = 4, size_t view_count = 3, float norm = 1) {
    splats = mixedSplats(count, 1, 0, 1);
    for (size_t i = 0; i < count; ++i) {
      splats.positions[i * 3] = -0.3f + 0.6f * static_cast<float>(i) / static_cast<float>(count);
      splats.positions[i * 3 + 1] = 0.01f * static_cast<float>(i % 7);
      splats.positions[i * 3 + 2] = 2;
    }
    splats = withExtras(splats);
    views.cloud = drawnAs(splats);
    for (size_t v = 0; v < view_count; ++v) {
      KnownView view = plainView(forwardCamera(100, 100, 90), 0.5f, 0.5f);
      view.visible.assign(count, 1);
      view.of(Statistic::kBlendingWeights).assign(count, 1.0f);
      // Per pixel of a picture whose half is 50.
      view.of(Statistic::kScreenGradientNorms).assign(count, norm / 50);
      views.views.push_back(view);
    }
  }
  Edited event(Strategy& strategy, const FitMoment& moment) {
    if (strategy.wantsSweep(moment)) strategy.sweep(moment, views);
    return moved(*editAt(strategy, moment, splats), splats);
  }
};

/// Something to see under every splat: stripes, moved from view to view.
std::vector<float> stripes(int shift) {
  std::vector<float> picture;
  for (int i = 0; i < 100 * 100 * 3; ++i) {
    picture.push_back((i / 3 % 100 + shift) % 4 < 2 ? 1.0f : 0.0f);
  }
  return picture;
}

TEST(Frequency, HighOnesGetTwoChildrenAndStay) {
  Scene scene(40);
  for (KnownView& view : scene.views.views) view.of(Statistic::kScreenGradientNorms)[5] = 2.0f / 50;
  const auto strategy = makeStrategy("frequency(quantile=1)");
  const Edited now = scene.event(*strategy, publishedMoment(1000));
  ASSERT_EQ(now.splats.size(), 42u);
  EXPECT_EQ(now.splats.positions[15], scene.splats.positions[15]);
  EXPECT_EQ(now.splats.logits[40], scene.splats.logits[5]);
  EXPECT_EQ(now.splats.extras[1][120], scene.splats.extras[1][15]);
  EXPECT_EQ(now.splats.sh[41 * 12 + 3], scene.splats.sh[5 * 12 + 3]);
  EXPECT_NE(now.splats.positions[120], now.splats.positions[123]);
  EXPECT_FALSE(strategy->wantsSweep(publishedMoment(1100)));
  EXPECT_FALSE(strategy->wantsSweep(publishedMoment(15000)));
}

TEST(Frequency, RadiiAreThoseOfTheNeighbours) {
  Scene scene(60);
  const auto strategy = makeStrategy("frequency");
  const Edited now = scene.event(*strategy, publishedMoment(1000));
  const std::vector<double> radii = localRadii(now.splats.positions);
  for (size_t i = 0; i < now.splats.size(); ++i) {
    EXPECT_NEAR(now.splats.extras[0][i], std::log(radii[i]), 1e-6);
    EXPECT_EQ(now.splats.log_scales[i * 3], DensityScale::logScale(now.splats, i, 0));
    EXPECT_EQ(now.moments.extras[0][i], 0);  // forgotten
  }
  EXPECT_NE(now.moments.extras[1][4], 0);
}

TEST(Frequency, GoesWhereTwoViewsDisagree) {
  Scene scene(40);
  for (int v = 0; v < 3; ++v) scene.views.views[static_cast<size_t>(v)].target = stripes(2 * v);
  // Splat 0: its best two views agree. 1: they do not. 2: one view. 3: none.
  for (size_t v = 0; v < 3; ++v) {
    KnownView& view = scene.views.views[v];
    view.of(Statistic::kBlendingWeights)[0] = v == 1 ? 0.5f : 1.0f;
    view.of(Statistic::kBlendingWeights)[1] = v == 2 ? 0.5f : 1.0f;
    view.visible[2] = v == 2;
    view.of(Statistic::kBlendingWeights)[3] = 0;
  }
  const auto early = makeStrategy("frequency");
  EXPECT_GE(scene.event(*early, publishedMoment(1000)).splats.size(), 40u);
  const auto strategy = makeStrategy("frequency(random_removal=0)");
  scene.views.drawn.clear();
  strategy->sweep(publishedMoment(1500), scene.views);
  EXPECT_THAT(scene.views.drawn, ElementsAre(0, 1, 2));
  const auto edit = editAt(*strategy, publishedMoment(1500), scene.splats);
  ASSERT_TRUE(edit->keep);
  EXPECT_THAT(std::vector<uint32_t>(edit->keep->begin(), edit->keep->begin() + 2),
              ElementsAre(0, 2));
}

TEST(Frequency, ChildrenOfTheLastEventAreSpared) {
  Scene scene(40);
  const auto strategy = makeStrategy("frequency(random_removal=0)");
  const Edited first = scene.event(*strategy, publishedMoment(1000));
  const size_t children = first.splats.size() - 40;
  ASSERT_EQ(children, 80u);  // all tied: all are at the quantile
  Scene next(first.splats.size(), 3, 0);
  next.splats = first.splats;
  next.views.cloud = drawnAs(first.splats);
  for (KnownView& view : next.views.views) std::fill_n(view.visible.begin(), 120, uint8_t{0});
  const TensorTable state = strategy->state();
  EXPECT_EQ(next.event(*strategy, publishedMoment(1500)).splats.size(), 80u);
  // What a checkpoint brings back spares them too.
  const auto other = makeStrategy("frequency(random_removal=0)");
  other->restore(state);
  EXPECT_EQ(next.event(*other, publishedMoment(1500)).splats.size(), 80u);
  // At the event after that they are like all others: one is left, so that a fit can go on.
  const auto unaware = makeStrategy("frequency(random_removal=0)");
  EXPECT_EQ(next.event(*unaware, publishedMoment(1500)).splats.size(), 1u);
}

TEST(Frequency, ThinsOutByChanceWhereAllIsLearned) {
  Scene scene(200, 3, 1e-5f);
  const auto strategy = makeStrategy("frequency");
  EXPECT_EQ(scene.event(*strategy, publishedMoment(1000)).splats.size(), 190u);
  Scene black(200, 3, 0);
  EXPECT_EQ(black.event(*makeStrategy("frequency"), publishedMoment(1000)).splats.size(), 200u);
}

TEST(Frequency, KeepsToTheCapByTheHighestGradients) {
  Scene scene(40);
  for (KnownView& view : scene.views.views) view.of(Statistic::kScreenGradientNorms)[7] = 2.0f / 50;
  for (const uint64_t cap : {uint64_t{43}, uint64_t{40}, uint64_t{10}}) {
    const auto strategy = makeStrategy("frequency");
    const Edited now = scene.event(*strategy, publishedMoment(1000, cap));
    EXPECT_EQ(now.splats.size(), cap == 43 ? 42u : 40u);
    if (cap == 43) {
      EXPECT_EQ(now.splats.logits[40], scene.splats.logits[7]);
    }
  }
}

TEST(Frequency, LowersOpacitiesAtItsEventsToo) {
  Scene scene(40);
  const auto strategy = makeStrategy("frequency");
  const Edited now = scene.event(*strategy, publishedMoment(3000));
  for (const float logit : now.splats.logits) EXPECT_LE(logit, rawOpacity(0.01f));
}

TEST(Frequency, OneSplatTwinsAndNobodyLooked) {
  Scene one(1);
  EXPECT_EQ(one.event(*makeStrategy("frequency"), publishedMoment(1000)).splats.size(), 3u);
  Scene twins(80);
  std::fill(twins.splats.positions.begin(), twins.splats.positions.end(), 0.5f);
  const Edited now =
      twins.event(*makeStrategy("frequency(quantile=1,threshold=100)"), publishedMoment(1000));
  for (const float log_radius : now.splats.extras[0]) EXPECT_FLOAT_EQ(log_radius, std::log(1e-7f));
  const auto strategy = makeStrategy("frequency");
  const Scene scene(40);
  const auto edit = editAt(*strategy, publishedMoment(1500), scene.splats);
  EXPECT_EQ(edit->countAfter(40), 40u);
}

TEST(Frequency, SameForAnyNumberOfThreads) {
  RawSplats results[2];
  for (unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] {
      Scene scene(3000);
      for (size_t i = 0; i < 3000; ++i) {
        scene.views.views[0].of(Statistic::kScreenGradientNorms)[i] =
            static_cast<float>(i % 17) / 50;
      }
      for (int v = 0; v < 3; ++v) scene.views.views[static_cast<size_t>(v)].target = stripes(v);
      results[threads - 1] = scene.event(*makeStrategy("frequency"), publishedMoment(1500)).splats;
    });
  }
  EXPECT_TRUE(areSame(results[0], results[1]));
}

TEST(Frequency, DoesNotGoWithPartsThatSetScales) {
  try {
    makeStrategy("frequency+long_axis_split");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("long_axis_split does not go with density_scale"));
  }
}

}  // namespace
}  // namespace stipple
