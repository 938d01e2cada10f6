#include "densify/strategies/mcmc.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/control_cases.h"
#include "densify/parts/relocation.h"
#include "math/covariance.h"

namespace stipple {
namespace {

using namespace stipple::testing;
using ::testing::Each;
using ::testing::HasSubstr;

TEST(Mcmc, StartsSmallAndHalfOpaque) {
  RawSplats splats = mixedSplats(3, 1);
  const RawSplats before = splats;
  makeStrategy("mcmc")->prepare(splats, 30000);
  EXPECT_THAT(splats.logits, Each(0.0f));
  // ln 0.1, in float32 beside numbers of 5.
  for (size_t k = 0; k < 9; ++k) {
    EXPECT_NEAR(splats.log_scales[k], before.log_scales[k] - 2.3025851f, 1e-6f);
  }
}

TEST(Mcmc, TheWayBackToSizeIsAsLongAPartOfAnyFit) {
  const RawSplats before = mixedSplats(3, 1);
  for (const auto& [iterations, change] : {std::pair{3000u, -0.2302585f}, {90000u, -2.3025851f}}) {
    RawSplats splats = before;
    makeStrategy("mcmc")->prepare(splats, iterations);
    for (size_t k = 0; k < 9; ++k) {
      EXPECT_NEAR(splats.log_scales[k], before.log_scales[k] + change, 1e-6f);
    }
  }
}

TEST(Mcmc, GrowsByAShareUpToTheCap) {
  const RawSplats splats = mixedSplats(1000, 2, 0, 2);
  const auto strategy = makeStrategy("mcmc");
  EXPECT_EQ(editAt(*strategy, publishedMoment(600), splats)->countAfter(1000), 1050u);
  EXPECT_EQ(editAt(*strategy, publishedMoment(600, 1020), splats)->countAfter(1000), 1020u);
  EXPECT_EQ(editAt(*strategy, publishedMoment(600, 700), splats)->countAfter(1000), 1000u);
  EXPECT_EQ(editAt(*makeStrategy("mcmc(cap=1010)"), publishedMoment(600), splats)->countAfter(1000),
            1010u);
  // Long after adaptive control has ended, but not in the last sixth.
  EXPECT_TRUE(editAt(*strategy, publishedMoment(24900), splats));
  EXPECT_FALSE(editAt(*strategy, publishedMoment(25000), splats));
  EXPECT_FALSE(editAt(*strategy, publishedMoment(650), splats));
}

TEST(Mcmc, EventsOfShortFitsStandForThoseThatAreLeftOut) {
  const auto growth = makeSteadyGrowth({500, 25000, 100, 100}, 0.05, 1000000);
  ControlMoment moment;
  moment.iterations = 3000;  // an event per 100 steps instead of 10
  EXPECT_EQ(growth->limit(moment, 1000), static_cast<uint64_t>(1000 * std::pow(1.05, 10)));
  moment.iterations = 60000;
  EXPECT_EQ(growth->limit(moment, 1000), 1050u);
  EXPECT_EQ(growth->limit(moment, 1), 2u);
  EXPECT_EQ(growth->limit(moment, 2000000), 1000000u);
}

TEST(Mcmc, AnotherPartMayDecideHowManyThereAre) {
  ControlAssembly assembly = mcmcControl();
  const size_t parts = assembly.parts.size();
  addPart(assembly, makeSteadyGrowth({}, 0.5, 100));
  EXPECT_EQ(assembly.parts.size(), parts);
  const auto strategy = makeDensityControl("mcmc", std::move(assembly));
  EXPECT_EQ(editAt(*strategy, publishedMoment(600), mixedSplats(80, 1))->countAfter(80), 100u);
}

TEST(Mcmc, EventsKeepTheCompositeOfEverySplat) {
  const RawSplats splats = mixedSplats(500, 3, -1, 3);
  const auto strategy = makeStrategy("mcmc");
  const Edited now = moved(*editAt(*strategy, publishedMoment(600), splats), splats);
  ASSERT_EQ(now.splats.size(), 525u);
  // By place: copies stand where their sources do.
  for (size_t i = 0; i < 500; ++i) {
    double clear = 1;
    for (size_t k = 0; k < 525; ++k) {
      if (now.splats.positions[k * 3] == splats.positions[i * 3]) {
        clear *= 1 - opacityOf(now.splats.logits[k]);
      }
    }
    // Logits in float32: 1e-7 times the number of copies.
    EXPECT_NEAR(1 - clear, opacityOf(splats.logits[i]), 1e-6);
  }
  const std::vector<float> draws = strategy->seen(now.splats.size()).score;
  ASSERT_EQ(draws.size(), 525u);
  EXPECT_EQ(std::accumulate(draws.begin(), draws.end(), 0.0f), 25.0f);
}

TEST(Mcmc, OneSplatAllTiedAndAllDead) {
  const auto strategy = makeStrategy("mcmc");
  EXPECT_EQ(editAt(*strategy, publishedMoment(600), mixedSplats(1, 1))->countAfter(1), 2u);
  RawSplats tied = mixedSplats(100, 1, 1, 1);
  EXPECT_EQ(editAt(*makeStrategy("mcmc"), publishedMoment(600), tied)->countAfter(100), 105u);
  RawSplats dead = mixedSplats(100, 1, -9, -8);
  const auto edit = editAt(*makeStrategy("mcmc"), publishedMoment(600), dead);
  EXPECT_EQ(moved(*edit, dead).splats.size(), 105u);
}

/// Moves of `count` equal splats at the origin.
std::vector<float> movesOf(size_t count, float logit, const FitMoment& moment) {
  RawSplats splats = rowsOf(mixedSplats(1, 9), std::vector<uint32_t>(count, 0));
  std::fill(splats.positions.begin(), splats.positions.end(), 0.0f);
  std::fill(splats.logits.begin(), splats.logits.end(), logit);
  const RawSplats moments = zerosLike(splats);
  const auto edit = makeStrategy("mcmc")->afterStep(moment, {splats, moments, moments});
  return edit ? moved(*edit, splats).splats.positions : std::vector<float>{};
}

TEST(Mcmc, FaintSplatsTrembleAsTheyAreShaped) {
  constexpr size_t kCount = 40000;
  const std::vector<float> moves = movesOf(kCount, rawOpacity(0.005f), publishedMoment(700));
  ASSERT_EQ(moves.size(), kCount * 3);
  // Noise is the covariance times a normal number, so its covariance is the square; the gate is 1/2
  // here, 5e5 times the rate is 500.
  const RawSplats splat = mixedSplats(1, 9);
  const SplatCloud cloud = activated(splat);
  const Mat3d sigma = covariance<double>(cloud.rotations.data(), cloud.scales.data());
  const Mat3d expected = 250.0 * 250.0 * sigma * sigma;
  Mat3d seen = Mat3d::Zero();
  for (size_t i = 0; i < kCount; ++i) {
    const Vec3d move(static_cast<double>(moves[i * 3]), static_cast<double>(moves[i * 3 + 1]),
                     static_cast<double>(moves[i * 3 + 2]));
    seen += move * move.transpose() / static_cast<double>(kCount);
  }
  // Five standard errors of variances: 5 sqrt(2 / 40000).
  EXPECT_LT((seen - expected).norm() / expected.norm(), 0.036);
}

double lengthOf(const std::vector<float>& moves) {
  double squares = 0;
  for (const float move : moves) squares += static_cast<double>(move) * static_cast<double>(move);
  return std::sqrt(squares);
}

TEST(Mcmc, NoiseFallsWithOpacityAndEndsWithTheRate) {
  const FitMoment moment = publishedMoment(700);
  const double faint = lengthOf(movesOf(100, rawOpacity(0.005f), moment));
  // The same numbers, times 1 / (1 + exp(100 (0.02 - 0.005))) = 0.182 over 0.5.
  const double seen = lengthOf(movesOf(100, rawOpacity(0.02f), moment));
  EXPECT_NEAR(seen / faint, 2 / (1 + std::exp(1.5)), 1e-4);
  EXPECT_TRUE(movesOf(100, rawOpacity(0.9f), moment).empty());
  // After the last event splats still tremble; without a rate they do not.
  EXPECT_FALSE(movesOf(10, -6, publishedMoment(29000)).empty());
  FitMoment still = publishedMoment(700);
  still.position_rate = 0;
  EXPECT_TRUE(movesOf(10, -6, still).empty());
}

TEST(Mcmc, NoiseDoesNotDependOnTheUnitOfTheScene) {
  // Everything 1000 times as large.
  RawSplats metres = mixedSplats(200, 4, -7, -4), millimetres = metres;
  for (float& value : millimetres.positions) value *= 1000;
  for (float& value : millimetres.log_scales) value += std::log(1000.0f);
  FitMoment moment = publishedMoment(700), large = moment;
  large.extent *= 1000;
  large.position_rate *= 1000;
  const auto strategy = makeStrategy("mcmc");
  const auto a = strategy->afterStep(moment, {metres, metres, metres});
  const auto b = strategy->afterStep(large, {millimetres, millimetres, millimetres});
  ASSERT_TRUE(a && b);
  const RawSplats by_metres = moved(*a, metres).splats, also = moved(*b, millimetres).splats;
  for (size_t k = 0; k < by_metres.positions.size(); ++k) {
    // Rounding of logarithms and places in float32.
    EXPECT_NEAR(also.positions[k] / 1000, by_metres.positions[k], 2e-6f);
  }
}

TEST(Mcmc, NoiseIsTheSameForAnyNumberOfThreads) {
  std::vector<float> first;
  withThreads(1, [&] { first = movesOf(20000, -6, publishedMoment(700)); });
  withThreads(2, [&] { EXPECT_EQ(movesOf(20000, -6, publishedMoment(700)), first); });
  EXPECT_NE(movesOf(20000, -6, publishedMoment(701)), first);
}

TEST(SizeRegulariser, ItsDerivativeIsThatOfItsValue) {
  const SplatCloud cloud = activated(mixedSplats(40, 6));
  const auto part = makeSizeRegulariser({0.02, 0.03});
  ControlMoment moment;
  moment.extent = 10;  // two published units: scales count half
  const auto value = [&](const SplatCloud& at, std::vector<float>& by_opacity,
                         std::vector<float>& by_scale) {
    by_opacity.assign(at.size(), 0.5f);
    by_scale.assign(at.size() * 3, 0.5f);
    CloudGradient gradient;
    gradient.opacities = by_opacity;
    gradient.scales = by_scale;
    return part->loss(moment, at, gradient);
  };
  std::vector<float> by_opacity, by_scale, unused[2];
  const double here = value(cloud, by_opacity, by_scale);
  double opacities = 0, scales = 0;
  for (const float o : cloud.opacities) opacities += static_cast<double>(o);
  for (const float s : cloud.scales) scales += static_cast<double>(s);
  EXPECT_NEAR(here, 0.02 * opacities / 40 + 0.03 * scales / 120 / 2, 1e-12);
  // The value is linear: any step will do, and the float32 number of the step is what is exact.
  SplatCloud moved = cloud;
  moved.opacities[7] += 0.25f;
  const double by_seven = (value(moved, unused[0], unused[1]) - here) /
                          static_cast<double>(moved.opacities[7] - cloud.opacities[7]);
  EXPECT_NEAR(static_cast<double>(by_opacity[7]) - 0.5, by_seven, 1e-7);
  moved = cloud;
  moved.scales[31] += 2.0f;
  const double by_scale_31 = (value(moved, unused[0], unused[1]) - here) /
                             static_cast<double>(moved.scales[31] - cloud.scales[31]);
  EXPECT_NEAR(static_cast<double>(by_scale[31]) - 0.5, by_scale_31, 1e-7);
}

TEST(Mcmc, StateComesBackBitForBit) {
  const auto strategy = makeStrategy("mcmc");
  RawSplats splats = mixedSplats(300, 8);
  splats = moved(*editAt(*strategy, publishedMoment(600), splats), splats).splats;
  const auto other = makeStrategy("mcmc");
  other->restore(strategy->state());
  const auto a = editAt(*strategy, publishedMoment(700), splats);
  const auto b = editAt(*other, publishedMoment(700), splats);
  EXPECT_TRUE(areSame(moved(*a, splats).splats, moved(*b, splats).splats));
  EXPECT_EQ(strategy->seen(moved(*a, splats).splats.size()).age,
            other->seen(moved(*b, splats).splats.size()).age);
}

TEST(Mcmc, RefusesSettingsThatItDoesNotHave) {
  try {
    makeStrategy("mcmc(caps=3)");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("mcmc has no setting 'caps'; there is cap, growth"));
  }
}

}  // namespace
}  // namespace stipple
