#include "motion/moving_splat.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "motion/lifespan.h"

namespace stipple {
namespace {

constexpr double kNewLifespan = 0.17557079;  // raw value 1, 300 frames

struct Row {
  double centre, time, offset, share, share_of_plain_time;
};

// Of the released formulas, 300 frames, window of 50 with 70 %, by an independent computation; six
// digits are given.
const std::vector<Row> kRows = {
    {0.4, 0.00, -0.464, 0.000926, 0.005569}, {0.4, 0.35, -0.21, 0.239153, 0.922099},
    {0.4, 0.48, 0.336, 0.025669, 0.812513},  {0.4, 0.50, 0.356, 0.016384, 0.722953},
    {0.4, 0.90, 0.5, 0.000300, 0.000300},    {0.0, 0.10, 0.42, 0.003271, 0.722953},
    {0.0, 0.50, 0.82, 0.0, 0.000300},        {20.0 / 300, 0.0, -0.28, 0.078600, 0.865730},
};

TEST(TimeWindow, GivesTheOffsetsOfTheReleasedFormulas) {
  const TimeWindow window = timeWindow(300);
  EXPECT_DOUBLE_EQ(window.near, 4.2);
  EXPECT_NEAR(window.far, 0.36, 1e-15);
  for (const Row& row : kRows) {
    EXPECT_NEAR(stretchedOffset(window, row.time, row.centre), row.offset, 1e-12) << row.time;
  }
}

TEST(TimeWindow, ShareOfOpacityIsThatOfTheReleasedFormulas) {
  const std::array<double, 2> lifespans = {kNewLifespan, kNewLifespan};
  for (const Row& row : kRows) {
    EXPECT_NEAR(temporalShare(lifespans, row.offset), row.share, 6e-7) << row.time;
    const double plain = stretchedOffset(TimeWindow(), row.time, row.centre);
    EXPECT_NEAR(temporalShare(lifespans, plain), row.share_of_plain_time, 6e-7) << row.time;
  }
}

TEST(TimeWindow, WindowNearAnEndMovesInside) {
  // The released code leaves it outside but for a centre of exactly 0 or 1, which gives 0.62 here.
  const TimeWindow window = timeWindow(300);
  EXPECT_NEAR(stretchedOffset(window, 0.9, 20.0 / 300), (0.5 - 0.2) / 3 * 4.2 + 11.0 / 15 * 0.36,
              1e-12);
}

TEST(TimeWindow, RisesWithoutJumpsOverARangeOfOne) {
  for (const uint32_t frames : {2u, 3u, 50u, 60u, 300u, 100000u}) {
    const TimeWindow window = timeWindow(frames);
    for (const double centre : {0.0, 1e-9, 0.01, 20.0 / 300, 0.3, 0.5, 0.93, 1 - 1e-9, 1.0}) {
      EXPECT_NEAR(stretchedOffset(window, 1.0, centre) - stretchedOffset(window, 0.0, centre), 1,
                  1e-12);
      EXPECT_NEAR(stretchedOffset(window, centre, centre), 0, 1e-15);
      double last = stretchedOffset(window, 0.0, centre);
      for (int step = 1; step <= 1000; ++step) {
        const double next = stretchedOffset(window, step / 1000.0, centre);
        // The slopes are the largest differences that a continuous line can have.
        EXPECT_GT(next, last);
        EXPECT_LE(next - last, std::max(window.near, window.far) / 1000 + 1e-12);
        last = next;
      }
    }
  }
}

TEST(TimeWindow, ClipsAsShortAsTheirWindowKeepHalfOfThemselvesOutside) {
  const TimeWindow window = timeWindow(50);
  EXPECT_DOUBLE_EQ(window.half, 0.25);
  EXPECT_DOUBLE_EQ(window.near, 1.4);
  EXPECT_NEAR(window.far, 0.6, 1e-15);
  EXPECT_EQ(timeWindow(1).half, 0);
  EXPECT_EQ(timeWindow(300, 0).half, 0);
}

TEST(Lifespan, IsThatOfTheReleasedCode) {
  // Six digits are given, some of them cut off.
  EXPECT_NEAR(lifespanUnit(300), 0.064589, 1e-6);
  EXPECT_NEAR(lifespanOf(1.0, lifespanUnit(300)), 0.175571, 5e-7);
  EXPECT_NEAR(lifespanUnit(250), 0.077558, 1e-6);
  EXPECT_NEAR(lifespanOf(1.0, lifespanUnit(250)), 0.210826, 5e-7);
  EXPECT_NEAR(lifespanUnit(50), 0.394, 5e-4);
  EXPECT_NEAR(lifespanOf(1.0, lifespanUnit(50)), 1.071, 5e-4);
  // Fifty frames about its moment a splat keeps a fifth of its opacity.
  const double unit = lifespanUnit(300);
  EXPECT_NEAR(temporalShare(std::array{unit, unit}, 24.5 / 299), 0.2, 1e-12);
}

TEST(Lifespan, GradientIsThatOfDifferencesInsideTheBounds) {
  const double unit = lifespanUnit(300), step = 1e-6;
  for (const double raw : {-3.0, 0.0, 1.0, 2.5}) {
    const double slope = (lifespanOf(raw + step, unit) - lifespanOf(raw - step, unit)) / (2 * step);
    EXPECT_NEAR(rawLifespanGradient(raw, unit, 1.0), slope, 1e-9);
  }
}

TEST(Lifespan, AtABoundOnlyTheWayBackIsOpen) {
  const double unit = lifespanUnit(300);
  EXPECT_EQ(lifespanOf(9.0, unit), kLargestLifespan);
  EXPECT_GT(rawLifespanGradient(9.0, unit, 1.0), 0);  // a step of descent makes it shorter
  EXPECT_EQ(rawLifespanGradient(9.0, unit, -1.0), 0);
  EXPECT_EQ(lifespanOf(-30.0, unit), kSmallestLifespan);
  EXPECT_LT(rawLifespanGradient(-30.0, unit, -1.0), 0);
  EXPECT_EQ(rawLifespanGradient(-30.0, unit, 1.0), 0);
}

MovingSplat<double> someSplat() {
  MovingSplat<double> splat;
  splat.position = {0.3, -1.2, 2.0};
  splat.rotation = {0.9, -0.2, 0.7, 0.1};
  splat.opacity = 0.8;
  for (size_t wave = 0; wave < kMotionWaves; ++wave) {
    const double w = static_cast<double>(wave);
    splat.waves[wave] = {0.2 - 0.05 * w, 0.03 * w, -0.1 + 0.02 * w * w};
  }
  splat.phases = {0.4, -1.0, 7.0, 0.1};
  splat.spin = {-0.3, 0.5, 0.2, -1.1};
  splat.lifespans = {0.3, 0.5};
  splat.centre = 0.4;
  return splat;
}

TEST(MovingSplat, IsItsFourierSeries) {
  const MovingSplat<double> splat = someSplat();
  const TimeWindow window = timeWindow(300);
  const double offset = stretchedOffset(window, 0.45, splat.centre);
  const SplatMoment<double> moment = momentOf(splat, window, 0.45);
  for (size_t axis = 0; axis < 3; ++axis) {
    double place = splat.position[axis];
    for (size_t k = 1; k <= kMotionHarmonics; ++k) {
      const double theta = 2 * M_PI * static_cast<double>(k) * offset + splat.phases[k - 1];
      place += splat.waves[2 * k - 2][axis] * std::cos(theta) +
               splat.waves[2 * k - 1][axis] * std::sin(theta);
    }
    EXPECT_NEAR(moment.position[axis], place, 1e-14);
  }
  EXPECT_DOUBLE_EQ(moment.opacity, 0.8 * std::exp(-offset * offset / 0.25));
  // A period of the series is a whole unit of the offset.
  MovingSplat<double> shifted = splat;
  shifted.phases[2] += 40 * M_PI;
  EXPECT_NEAR(momentOf(shifted, window, 0.45).position[0], moment.position[0], 1e-13);
}

/// A number that depends on all of a moment.
double lossOf(const MovingSplat<double>& splat, const TimeWindow& window, double time,
              const SplatMoment<double>& weights) {
  const SplatMoment<double> moment = momentOf(splat, window, time);
  double sum = weights.opacity * moment.opacity;
  for (size_t i = 0; i < 3; ++i) sum += weights.position[i] * moment.position[i];
  for (size_t i = 0; i < 4; ++i) sum += weights.rotation[i] * moment.rotation[i];
  return sum;
}

TEST(MovingSplat, DerivativesAreThoseOfDifferences) {
  SplatMoment<double> weights;
  weights.position = {0.7, -1.3, 0.4};
  weights.rotation = {0.5, -0.8, 1.1, 0.3};
  weights.opacity = 2.0;
  for (const TimeWindow& window : {timeWindow(300), TimeWindow()}) {
    for (const double time : {0.1, 0.38, 0.4, 0.47, 0.9}) {
      MovingSplat<double> splat = someSplat();
      const MovingSplat<double> by = momentGradient(splat, window, time, weights);
      const auto check = [&](double& value, double derivative, const char* name) {
        constexpr double kStep = 1e-6;  // error of differences: 1e-12 of third derivatives
        const double kept = value;
        value = kept + kStep;
        const double above = lossOf(splat, window, time, weights);
        value = kept - kStep;
        const double below = lossOf(splat, window, time, weights);
        value = kept;
        EXPECT_NEAR(derivative, (above - below) / (2 * kStep), 2e-8) << name << " at " << time;
      };
      for (size_t i = 0; i < 3; ++i) check(splat.position[i], by.position[i], "position");
      for (size_t i = 0; i < 4; ++i) check(splat.rotation[i], by.rotation[i], "rotation");
      for (size_t i = 0; i < 4; ++i) check(splat.spin[i], by.spin[i], "spin");
      for (size_t i = 0; i < kMotionHarmonics; ++i) check(splat.phases[i], by.phases[i], "phase");
      for (size_t wave = 0; wave < kMotionWaves; ++wave) {
        for (size_t i = 0; i < 3; ++i) check(splat.waves[wave][i], by.waves[wave][i], "wave");
      }
      for (size_t i = 0; i < 2; ++i) check(splat.lifespans[i], by.lifespans[i], "lifespan");
      check(splat.opacity, by.opacity, "opacity");
    }
  }
}

}  // namespace
}  // namespace stipple
