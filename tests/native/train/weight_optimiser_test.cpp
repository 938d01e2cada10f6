#include "train/optimiser/weight_optimiser.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "base/error.h"

namespace stipple {
namespace {

WeightOptimiserOptions quick() {
  WeightOptimiserOptions options;
  options.learning_rate = 0.05;
  options.warm_up = 3;
  options.total_steps = 200;
  options.clip_buffer = 5;
  return options;
}

/// Of a bowl around (1, -2).
std::vector<float> bowl(const std::vector<float>& at) {
  return {2 * (at[0] - 1.0f), 20 * (at[1] + 2.0f)};
}

TEST(WeightOptimiser, FindsTheBottomOfABowl) {
  std::vector<float> values = {4, 4};
  WeightOptimiserOptions options = quick();
  options.learning_rate = 0.2;
  WeightOptimiser optimiser(options, values);
  for (int step = 0; step < 200; ++step) {
    std::vector<float> gradient = bowl(values);
    optimiser.step(gradient, values);
  }
  EXPECT_NEAR(values[0], 1.0f, 0.05f);
  EXPECT_NEAR(values[1], -2.0f, 0.05f);
}

TEST(WeightOptimiser, AGradientThatIsNotFiniteChangesNothing) {
  std::vector<float> values = {4, 4};
  WeightOptimiser optimiser(quick(), values);
  std::vector<float> gradient = bowl(values);
  for (int step = 0; step < 4; ++step) optimiser.step(gradient = bowl(values), values);
  const std::vector<float> before = values;
  const WeightOptimiser::State state = optimiser.state();
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    gradient = {1.0f, bad};
    EXPECT_TRUE(optimiser.step(gradient, values).is_skipped);
  }
  EXPECT_EQ(values, before);
  EXPECT_EQ(optimiser.state().first, state.first);
  EXPECT_EQ(optimiser.state().second, state.second);
  EXPECT_EQ(optimiser.state().mean, state.mean);
  EXPECT_EQ(optimiser.state().steps, 4u);
  EXPECT_EQ(optimiser.state().skipped, 2u);
}

TEST(WeightOptimiser, GoesOnFromAStateBitForBit) {
  std::vector<float> whole = {4, 4}, gradient;
  WeightOptimiser through(quick(), whole);
  for (int step = 0; step < 40; ++step) through.step(gradient = bowl(whole), whole);
  std::vector<float> parts = {4, 4};
  WeightOptimiser first(quick(), parts);
  for (int step = 0; step < 17; ++step) first.step(gradient = bowl(parts), parts);
  WeightOptimiser second(quick(), first.state());
  for (int step = 17; step < 40; ++step) second.step(gradient = bowl(parts), parts);
  EXPECT_EQ(whole, parts);
  EXPECT_EQ(through.state().mean, second.state().mean);
  EXPECT_EQ(through.state().norms, second.state().norms);
}

TEST(WeightOptimiser, CutsWhatIsLongerThanUsual) {
  std::vector<float> values = {0, 0};
  WeightOptimiser optimiser(quick(), values);
  std::vector<float> gradient;
  for (int step = 0; step < 6; ++step) {
    optimiser.step(gradient = {0.01f, 0.0f}, values);
  }
  const WeightStep done = optimiser.step(gradient = {10.0f, 0.0f}, values);
  EXPECT_NEAR(done.most_norm, 0.01, 1e-8);
  EXPECT_NEAR(gradient[0], 0.01f, 1e-6f);
}

WeightOptimiserOptions scaled() {
  WeightOptimiserOptions options = quick();
  options.loss_scaling = LossScaling::kDynamic;
  options.loss_scale_start = 4.5;
  options.loss_scale_growth = 0.25;
  return options;
}

/// As networks find it where their loss is multiplied.
std::vector<float> bowl(const std::vector<float>& at, double loss_scale) {
  std::vector<float> gradient = bowl(at);
  for (float& value : gradient) value *= static_cast<float>(loss_scale);
  return gradient;
}

TEST(WeightOptimiser, AScaleOfLossesIsAPowerOfTwoAndChangesNoBit) {
  std::vector<float> plain = {4, 4}, values = plain, gradient;
  WeightOptimiser alone(quick(), plain), optimiser(scaled(), values);
  std::vector<double> scales;
  for (int step = 0; step < 30; ++step) {
    alone.step(gradient = bowl(plain), plain);
    scales.push_back(optimiser.lossScale());
    const WeightStep done = optimiser.step(gradient = bowl(values, scales.back()), values);
    EXPECT_EQ(done.loss_scale, scales.back());
  }
  EXPECT_EQ(alone.lossScale(), 1);
  EXPECT_EQ(values, plain);
  EXPECT_EQ(optimiser.state().mean, alone.state().mean);
  EXPECT_EQ(optimiser.state().norms, alone.state().norms);
  // 4.5 and a quarter for each step before; the power of two below it.
  EXPECT_EQ(scales[0], 16);
  EXPECT_EQ(scales[1], 16);
  EXPECT_EQ(scales[2], 32);
  EXPECT_EQ(scales[6], 64);
  EXPECT_EQ(optimiser.state().loss_scale_log2, 4.5 + 30 * 0.25);
}

TEST(WeightOptimiser, AScaleOfLossesFallsWhereDerivativesOverflow) {
  std::vector<float> values = {4, 4}, gradient;
  WeightOptimiser optimiser(scaled(), values);
  optimiser.step(gradient = bowl(values, 16), values);
  const std::vector<float> before = values;
  gradient = {1.0f, std::numeric_limits<float>::infinity()};
  EXPECT_TRUE(optimiser.step(gradient, values).is_skipped);
  EXPECT_EQ(values, before);
  EXPECT_EQ(optimiser.state().loss_scale_log2, 3.75);
  EXPECT_EQ(optimiser.lossScale(), 8);
  EXPECT_EQ(optimiser.state().skipped, 1u);
  EXPECT_EQ(optimiser.state().steps, 1u);
  for (int step = 0; step < 9; ++step) {
    gradient = {1.0f, std::numeric_limits<float>::quiet_NaN()};
    EXPECT_TRUE(optimiser.step(gradient, values).is_skipped);
  }
  EXPECT_EQ(optimiser.lossScale(), 1) << "and no further";
  EXPECT_FALSE(optimiser.step(gradient = bowl(values), values).is_skipped);
}

TEST(WeightOptimiser, GoesOnWithTheScaleOfLossesThatItHad) {
  std::vector<float> whole = {4, 4}, parts = whole, gradient;
  const auto run = [&](WeightOptimiser& optimiser, int first, int last, std::vector<float>& at) {
    for (int step = first; step < last; ++step) {
      gradient = bowl(at, optimiser.lossScale());
      if (step % 7 == 3) gradient[0] = std::numeric_limits<float>::infinity();
      optimiser.step(gradient, at);
    }
  };
  WeightOptimiser through(scaled(), whole), first(scaled(), parts);
  run(through, 0, 40, whole);
  run(first, 0, 17, parts);
  WeightOptimiser second(scaled(), first.state());
  run(second, 17, 40, parts);
  EXPECT_EQ(whole, parts);
  EXPECT_EQ(through.state().loss_scale_log2, second.state().loss_scale_log2);
  EXPECT_EQ(through.state().skipped, second.state().skipped);
}

TEST(WeightOptimiser, RefusesWhatIsOutOfRange) {
  const std::vector<float> values = {1};
  const auto refuses = [&](auto&& change) {
    WeightOptimiserOptions options = quick();
    change(options);
    EXPECT_THROW(WeightOptimiser(options, values), Error);
  };
  refuses([](auto& o) { o.learning_rate = 0; });
  refuses([](auto& o) { o.learning_rate = std::nan(""); });
  refuses([](auto& o) { o.beta1 = 1; });
  refuses([](auto& o) { o.beta2 = -0.1; });
  refuses([](auto& o) { o.weight_decay = 21; });
  refuses([](auto& o) { o.total_steps = 3; });
  refuses([](auto& o) { o.least_share = 1.1; });
  refuses([](auto& o) { o.most_norm = 0; });
  refuses([](auto& o) { o.clip_percentile = 101; });
  refuses([](auto& o) { o.mean_decay = 2; });
  refuses([](auto& o) { o.loss_scale_start = -1; });
  refuses([](auto& o) { o.loss_scale_start = 101; });
  refuses([](auto& o) { o.loss_scale_growth = std::nan(""); });
  WeightOptimiser::State state;
  state.mean = {1.0};
  EXPECT_THROW(WeightOptimiser(quick(), state), Error);
}

}  // namespace
}  // namespace stipple
