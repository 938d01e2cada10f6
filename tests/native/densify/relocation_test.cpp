#include "densify/parts/relocation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/parallel.h"
#include "densify/control_cases.h"

namespace stipple {
namespace {

using namespace stipple::testing;
using ::testing::Each;
using ::testing::ElementsAre;

float logitOf(double opacity) {
  return static_cast<float>(std::log(opacity) - std::log1p(-opacity));
}

/// The sum as published, without its double loop: sum_k C(n, k+1) (-1)^k o^(k+1) / sqrt(k+1).
double alternatingSum(double opacity, int count) {
  long double sum = 0, binomial = 1, power = 1;
  for (int k = 1; k <= count; ++k) {
    binomial *= static_cast<long double>(count - k + 1) / k;
    power *= static_cast<long double>(opacity);
    sum += (k % 2 ? 1 : -1) * binomial * power / std::sqrt(static_cast<long double>(k));
  }
  return static_cast<double>(sum);
}

TEST(Relocation, OneSplatStaysWhatItIs) {
  const RelocationShare share = relocationShare(logitOf(0.3), 1);
  EXPECT_NEAR(share.opacity, 0.3, 1e-7);
  EXPECT_EQ(share.log_shrink, 0);
}

TEST(Relocation, TwoSplatsAsWorkedOutByHand) {
  const RelocationShare share = relocationShare(0, 2);
  EXPECT_NEAR(share.opacity, 1 - std::sqrt(0.5), 1e-15);
  // 0.5 / (2 o' - o'^2 / sqrt 2), o' = 1 - sqrt 0.5.
  const double o = 1 - std::sqrt(0.5);
  EXPECT_NEAR(std::exp(share.log_shrink), 0.5 / (2 * o - o * o / std::sqrt(2)), 1e-11);
  EXPECT_NEAR(std::exp(share.log_shrink), 0.952152, 1e-6);
  EXPECT_NEAR(share.logit, std::log(o / (1 - o)), 1e-14);
}

TEST(Relocation, ScalesAreThoseOfThePublishedSum) {
  for (const double opacity : {0.01, 0.05, 0.3, 0.5, 0.9, 0.99, 0.9999, 0.99999988}) {
    for (const int count : {2, 3, 5, 20, 50}) {
      const RelocationShare share = relocationShare(logitOf(opacity), static_cast<uint64_t>(count));
      const double held = opacityOf(std::min(logitOf(opacity), 15.942385f));
      // Of the sum: 1e-15 times binomials times powers, below 1e-10; of the logit in float32: 1e-6.
      EXPECT_NEAR(std::exp(share.log_shrink), held / alternatingSum(share.opacity, count), 1e-9)
          << opacity << " by " << count;
    }
  }
  // As published programs print them.
  EXPECT_NEAR(std::exp(relocationShare(logitOf(0.9), 5).log_shrink), 0.7971, 5e-5);
  EXPECT_NEAR(std::exp(relocationShare(logitOf(0.99), 50).log_shrink), 0.6422, 5e-5);
  EXPECT_NEAR(std::exp(relocationShare(logitOf(0.01), 5).log_shrink), 0.999, 5e-4);
}

TEST(Relocation, CompositesAreKept) {
  for (const double opacity : {0.001, 0.2, 0.97}) {
    for (const uint64_t count : {2u, 7u, 300u}) {
      const float logit = logitOf(opacity);
      const RelocationShare share = relocationShare(logit, count);
      const double n = static_cast<double>(count);
      EXPECT_NEAR(std::expm1(n * std::log1p(-share.opacity)) / -opacityOf(logit), 1, 1e-12);
      // The integral of a slice through the middle, by the midpoint rule to 12 deviations.
      const double shrink = std::exp(share.log_shrink);
      double one = 0, many = 0;
      for (int k = 0; k < 4000; ++k) {
        const double x = -12 + 24 * (k + 0.5) / 4000;
        one += opacityOf(logit) * std::exp(-0.5 * x * x);
        const double alpha = share.opacity * std::exp(-0.5 * x * x / (shrink * shrink));
        many -= std::expm1(n * std::log1p(-alpha));
      }
      EXPECT_NEAR(many / one, 1, 1e-9) << opacity << " by " << count;
    }
  }
}

TEST(Relocation, HoldsAtBothEnds) {
  for (const float logit : {-1e30f, -100.0f, -20.0f, 15.0f, 40.0f, 1e30f}) {
    for (const uint64_t count : {uint64_t{2}, uint64_t{50}, uint64_t{1000000}}) {
      const RelocationShare share = relocationShare(logit, count);
      EXPECT_TRUE(std::isfinite(share.logit)) << logit;
      EXPECT_TRUE(std::isfinite(share.log_shrink)) << logit;
      EXPECT_GT(share.opacity, 0) << logit;
      EXPECT_LE(share.log_shrink, 1e-11) << logit;
      EXPECT_GT(share.log_shrink, -2) << logit;
    }
  }
}

TEST(RelocatedSplats, DeadOnesBecomeCopiesOfLivingOnes) {
  RawSplats splats = mixedSplats(4, 1);
  splats.logits = {-6, 0, -5.5f, -9};  // one is alive
  RelocatedSplats relocated(splats);
  relocated.moveDead(publishedMoment(600), 0.005);
  EXPECT_THAT(relocated.drawCounts(), ElementsAre(0, 3, 0, 0));
  SplatEdit edit;
  relocated.write(edit);
  const Edited now = moved(edit, splats);
  const RelocationShare share = relocationShare(0, 4);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_FLOAT_EQ(now.splats.logits[i], static_cast<float>(share.logit));
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(now.splats.positions[i * 3 + k], splats.positions[3 + k]);
      EXPECT_FLOAT_EQ(now.splats.log_scales[i * 3 + k],
                      splats.log_scales[3 + k] + static_cast<float>(share.log_shrink));
    }
    for (size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(now.splats.rotations[i * 4 + k], splats.rotations[4 + k]);
    }
    for (size_t k = 0; k < 12; ++k) EXPECT_EQ(now.splats.sh[i * 12 + k], splats.sh[12 + k]);
  }
  // Moments of the source are forgotten, those of splats that moved stay.
  EXPECT_THAT(now.moments.logits, ElementsAre(1, 0, 3, 4));
  EXPECT_THAT(now.moments.positions, ElementsAre(1, 2, 3, 0, 0, 0, 7, 8, 9, 10, 11, 12));
  EXPECT_EQ(now.moments.sh[11], 12);
  EXPECT_EQ(now.moments.sh[12], 0);
}

TEST(RelocatedSplats, FaintSourcesStopAtTheEndOfTheLiving) {
  RawSplats splats = mixedSplats(2, 1);
  splats.logits = {-9, rawOpacity(0.0051f)};
  RelocatedSplats relocated(splats);
  relocated.moveDead(publishedMoment(600), 0.005);
  // 0.0051 shared by two is 0.00255: held at 0.005, and the scale is that of 0.00255, near 1.
  EXPECT_FLOAT_EQ(relocated.logit(1), rawOpacity(0.005f));
  EXPECT_NEAR(relocated.logScales(1)[0], splats.log_scales[3], 1e-3f);
}

TEST(RelocatedSplats, NothingHappensWhereNoneLives) {
  RawSplats splats = mixedSplats(5, 2, -12, -6);
  RelocatedSplats relocated(splats);
  relocated.moveDead(publishedMoment(600), 0.005);
  SplatEdit edit;
  relocated.write(edit);
  EXPECT_TRUE(edit.writes.empty());
}

TEST(RelocatedSplats, SourcesAreDrawnByOpacity) {
  RawSplats splats = mixedSplats(20002, 3, -9, -8);
  splats.logits[0] = rawOpacity(0.6f);
  splats.logits[1] = rawOpacity(0.2f);
  RelocatedSplats relocated(splats);
  relocated.moveDead(publishedMoment(600), 0.005);
  EXPECT_EQ(relocated.drawCounts()[0] + relocated.drawCounts()[1], 20000u);
  // Four standard deviations of 20,000 draws of 3/4: 4 sqrt(20000 * 3/16).
  EXPECT_NEAR(static_cast<double>(relocated.drawCounts()[0]), 15000, 245);
}

TEST(RelocatedSplats, CopiesShareWithTheirSources) {
  RawSplats splats = mixedSplats(1, 4);
  splats.logits = {rawOpacity(0.8f)};
  RelocatedSplats relocated(splats);
  RawSplats append;
  relocated.appendCopies(publishedMoment(600), 3, append);
  ASSERT_EQ(append.size(), 3u);
  const RelocationShare share = relocationShare(splats.logits[0], 4);
  EXPECT_THAT(append.logits, Each(static_cast<float>(share.logit)));
  EXPECT_EQ(append.logits[0], relocated.logit(0));
  EXPECT_EQ(append.log_scales[8], relocated.logScales(0)[2]);
}

TEST(RelocatedSplats, SameForAnyNumberOfThreads) {
  const RawSplats splats = mixedSplats(5000, 5);
  SplatEdit edits[2];
  for (unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] {
      RelocatedSplats relocated(splats);
      relocated.moveDead(publishedMoment(600), 0.005);
      relocated.appendCopies(publishedMoment(600), 700, edits[threads - 1].append);
      relocated.write(edits[threads - 1]);
    });
  }
  EXPECT_TRUE(areSame(moved(edits[0], splats).splats, moved(edits[1], splats).splats));
}

}  // namespace
}  // namespace stipple
