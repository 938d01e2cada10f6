#include "train/networks/flow_trainer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "generate/flow_sampler.h"
#include "nn/matrix_backend.h"

namespace stipple {
namespace {

constexpr size_t kTokens = 6, kWidth = 4;

FlowSizes smallSizes() {
  return {
      .block = {.channels = 32, .heads = 2, .head_width = 16, .mlp_width = 64, .rotary_width = 8},
      .block_count = 2,
      .noise_refiner_count = 1,
      .context_refiner_count = 1,
      .token_width = kWidth,
      .structure_width = 3,
      .colour_width = 2,
      .time_width = 16};
}

/// Two objects, told apart by the first number of their images alone.
class TwoObjects final : public FlowSource {
 public:
  size_t count() const override { return 2; }
  FlowObject object(size_t index, uint64_t draw) const override {
    FlowObject made;
    made.latent.token_count = kTokens;
    made.latent.width = kWidth;
    for (size_t i = 0; i < kTokens * kWidth; ++i) made.latent.tokens.push_back(at(index, i));
    made.latent.camera = {1, 0, 0, 0.5f, 0.7f};
    made.condition.rows = 2;
    made.condition.structure_width = 3;
    made.condition.colour_width = 2;
    const float sign = index == 0 ? 1.0f : -1.0f;
    made.condition.structure = {sign, unitFloat(draw), 0, sign, 0, 1};
    made.condition.colour = {0, 1, 1, 0};
    if (is_broken && index == 1) made.latent.tokens[3] = std::numeric_limits<float>::quiet_NaN();
    return made;
  }
  static float at(size_t index, size_t i) {
    return 2 * unitFloat(keyedBits(index + 1, RandomUse::kTokenNoise, i)) - 1;
  }
  bool is_broken = false;
};

FlowSchedule scheduleOf(uint64_t steps) {
  FlowSchedule schedule;
  schedule.batch = 4;
  schedule.optimiser.learning_rate = 4e-3;
  schedule.optimiser.warm_up = 10;
  schedule.optimiser.total_steps = steps;
  schedule.optimiser.mean_decay = 0.98;
  schedule.optimiser.clip_buffer = 8;
  return schedule;
}

TEST(FlowTrainer, LearnsToTellTwoObjectsApartByTheirImages) {
  const auto objects = std::make_shared<TwoObjects>();
  FlowTrainer trainer(smallSizes(), scheduleOf(700), 1, objects);
  const double before = trainer.loss(trainer.values(), *objects, 16, 5);
  EXPECT_NEAR(before, 1.35, 0.3);  // Velocities are 0: the mean square of noise, 1, and of objects.
  while (!trainer.isDone()) trainer.step();
  const std::vector<float> values = trainer.meanValues();
  const double after = trainer.loss(values, *objects, 16, 5);
  EXPECT_LT(after, 0.35 * before);

  // From noise to the object in the image, by the network that is only run.
  const auto kept = std::make_shared<const std::vector<float>>(values);
  const TensorTable tensors = trainer.tensors(values);
  std::map<std::string, WeightTensor> found;
  for (const auto& [name, tensor] : tensors) {
    found[name] = {
        WeightType::kFloat32, "F32", tensor.shape,
        reinterpret_cast<const uint8_t*>(std::get<std::vector<float>>(tensor.values).data())};
  }
  const FlowNetwork network(WeightTable("trained", std::move(found), nullptr));
  for (size_t index = 0; index < 2; ++index) {
    const FlowContext context = network.context({}, objects->object(index, 9).condition);
    const FlowSettings settings = {.steps = 12, .guidance = 1, .shift = 1};
    const GenerationNoise noise = drawNoise({.colour = 0, .tokens = kTokens * kWidth}, {});
    SamplerState state = startSampling(network, kTokens, noise, settings);
    sampleLatent({}, network, context, state);
    double to_own = 0, to_other = 0;
    for (size_t i = 0; i < kTokens * kWidth; ++i) {
      const auto seen = static_cast<double>(state.latent.tokens[i]);
      to_own += std::pow(seen - static_cast<double>(TwoObjects::at(index, i)), 2);
      to_other += std::pow(seen - static_cast<double>(TwoObjects::at(1 - index, i)), 2);
    }
    EXPECT_LT(to_own, 0.35 * to_other) << index;
    EXPECT_NEAR(static_cast<double>(state.latent.camera[0]), 1, 0.4);
  }
}

TEST(FlowTrainer, GoesOnBitForBitWhateverTheThreads) {
  const auto objects = std::make_shared<TwoObjects>();
  FlowTrainer whole(smallSizes(), scheduleOf(20), 3, objects);
  std::vector<TensorTable> states;
  withThreads(1, [&] {
    while (!whole.isDone()) {
      states.push_back(whole.state());
      whole.step();
    }
  });
  for (const size_t at : {size_t{0}, size_t{7}, size_t{19}}) {
    FlowTrainer again(smallSizes(), scheduleOf(20), 3, objects);
    again.resume(states[at]);
    withThreads(2, [&] {
      while (!again.isDone()) again.step();
    });
    EXPECT_EQ(again.values(), whole.values()) << at;
    EXPECT_EQ(again.meanValues(), whole.meanValues()) << at;
  }
  TensorTable broken = states[3];
  broken.erase("flow.optimiser.mean");
  FlowTrainer other(smallSizes(), scheduleOf(20), 3, objects);
  const std::vector<float> before = other.values();
  EXPECT_THROW(other.resume(broken), Error);
  EXPECT_EQ(other.values(), before);
}

TEST(FlowTrainer, AScaleOfLossesChangesNoBit) {
  const auto objects = std::make_shared<TwoObjects>();
  FlowSchedule with = scheduleOf(20);
  with.optimiser.loss_scaling = LossScaling::kDynamic;
  FlowTrainer plain(smallSizes(), scheduleOf(20), 3, objects);
  FlowTrainer scaled(smallSizes(), with, 3, objects);
  while (!plain.isDone()) {
    const FlowStep one = plain.step(), other = scaled.step();
    EXPECT_EQ(one.loss, other.loss);
    EXPECT_EQ(other.weights.loss_scale, std::exp2(20));
  }
  EXPECT_EQ(scaled.values(), plain.values());
}

TEST(FlowTrainer, InBfloat16LearnsAboutAsMuchAndGoesOnBitForBit) {
  const TrainerRun narrow = {nullptr, FactorPrecision::kBfloat16};
  const auto objects = std::make_shared<TwoObjects>();
  if (!defaultMatrixBackend().has(narrow.precision)) {
    EXPECT_THROW(FlowTrainer(smallSizes(), scheduleOf(300), 1, objects, narrow), Error);
    GTEST_SKIP() << "no products in bfloat16 here";
  }
  FlowTrainer wide(smallSizes(), scheduleOf(300), 1, objects);
  FlowTrainer trainer(smallSizes(), scheduleOf(300), 1, objects, narrow);
  const double before = wide.loss(wide.values(), *objects, 16, 5);
  TensorTable state;
  while (!wide.isDone()) {
    if (wide.step().step == 250) state = trainer.state();
    trainer.step();
  }
  const double of_wide = wide.loss(wide.meanValues(), *objects, 16, 5);
  const double of_narrow = trainer.loss(trainer.meanValues(), *objects, 16, 5);
  EXPECT_LT(of_wide, 0.1 * before);
  // Both have learned 95 % of it. Trainings part with their first rounding, so that what is left of
  // the loss differs by some of itself, either way; by a hundredth of what was learned is no less.
  EXPECT_NEAR(of_narrow, of_wide, 0.02 * before);
  FlowTrainer again(smallSizes(), scheduleOf(300), 1, objects, narrow);
  again.resume(state);
  withThreads(1, [&] {
    while (!again.isDone()) again.step();
  });
  EXPECT_EQ(again.values(), trainer.values());
  EXPECT_NE(trainer.values(), wide.values());
}

TEST(FlowTrainer, WhatIsNotFiniteIsSkippedAndWhatCannotBeIsRefused) {
  const auto objects = std::make_shared<TwoObjects>();
  objects->is_broken = true;
  FlowTrainer trainer(smallSizes(), scheduleOf(12), 3, objects);
  const std::vector<float> before = trainer.values();
  EXPECT_TRUE(trainer.step().weights.is_skipped);  // Both objects are in each batch.
  EXPECT_EQ(trainer.values(), before);
  FlowSizes odd = smallSizes();
  odd.block.head_width = 7;
  EXPECT_THROW(FlowTrainer(odd, scheduleOf(12), 3, objects), Error);
  FlowSchedule none = scheduleOf(12);
  none.batch = 0;
  EXPECT_THROW(FlowTrainer(smallSizes(), none, 3, objects), Error);
  none = scheduleOf(12);
  none.image_dropout = 1.5;
  EXPECT_THROW(FlowTrainer(smallSizes(), none, 3, objects), Error);
}

}  // namespace
}  // namespace stipple
