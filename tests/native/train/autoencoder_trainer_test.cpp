#include "train/networks/autoencoder_trainer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/matrix_backend.h"
#include "train/trained_balls.h"

namespace stipple {
namespace {

/// And which of them were asked for.
class AskedBalls final : public Balls {
 public:
  using Balls::Balls;
  std::shared_ptr<const TrainingObject> object(size_t index) const override {
    asked.push_back(index);
    return Balls::object(index);
  }

  mutable std::vector<size_t> asked;
};

AutoencoderSchedule partOf(AutoencoderStage stage, uint64_t steps) {
  AutoencoderSchedule part;
  part.stage = stage;
  part.batch = 2;
  part.most_tokens = 24;
  part.token_halvings = 1;
  part.least_anchors = 16;
  part.most_anchors = 64;
  part.views = 1;
  part.optimiser.learning_rate = 3e-3;
  part.optimiser.warm_up = 2;
  part.optimiser.total_steps = steps;
  part.optimiser.clip_buffer = 4;
  return part;
}

std::vector<AutoencoderSchedule> threeParts() {
  return {partOf(AutoencoderStage::kStructure, 5), partOf(AutoencoderStage::kAttributes, 6),
          partOf(AutoencoderStage::kJoint, 7)};
}

AutoencoderTrainer trainerOf(std::shared_ptr<const ObjectSource> objects,
                             std::vector<AutoencoderSchedule> parts = threeParts(),
                             TrainerRun run = {}) {
  return {smallSizes(), std::move(parts), 7, std::move(objects), cpuBackends(), std::move(run)};
}

const TrainerRun kNarrow = {nullptr, FactorPrecision::kBfloat16};

bool hasNarrow() {
  return defaultMatrixBackend().has(FactorPrecision::kBfloat16);
}

TEST(AutoencoderTrainer, GoesThroughAllPartsAndSeesEveryObjectInARound) {
  const auto objects = std::make_shared<AskedBalls>(3);
  AutoencoderTrainer trainer = trainerOf(objects);
  std::vector<size_t> steps_of_part(3);
  while (!trainer.isDone()) {
    const AutoencoderStep done = trainer.step();
    ++steps_of_part[done.part];
    EXPECT_TRUE(std::isfinite(done.losses.total));
    EXPECT_FALSE(done.weights.is_skipped);
  }
  EXPECT_EQ(steps_of_part, (std::vector<size_t>{5, 6, 7}));
  ASSERT_EQ(objects->asked.size(), 36u);
  for (size_t round = 0; round < 12; ++round) {
    std::vector<size_t> of_round(objects->asked.begin() + static_cast<long>(round * 3),
                                 objects->asked.begin() + static_cast<long>(round * 3 + 3));
    std::sort(of_round.begin(), of_round.end());
    EXPECT_EQ(of_round, (std::vector<size_t>{0, 1, 2})) << round;
  }
}

TEST(AutoencoderTrainer, GoesOnBitForBitFromWhereverItWasStopped) {
  const auto objects = std::make_shared<AskedBalls>(2);
  AutoencoderTrainer whole = trainerOf(objects);
  std::vector<TensorTable> states;
  while (!whole.isDone()) {
    states.push_back(whole.state());
    whole.step();
  }
  for (const size_t at : {size_t{3}, size_t{5}, size_t{9}, size_t{17}}) {  // 5: between two parts
    AutoencoderTrainer again = trainerOf(objects);
    again.resume(states[at]);
    while (!again.isDone()) again.step();
    EXPECT_EQ(again.values(), whole.values()) << at;
    EXPECT_EQ(again.meanValues(), whole.meanValues()) << at;
  }
}

TEST(AutoencoderTrainer, KeepsTheEncoderWhereItIsAskedTo) {
  const auto objects = std::make_shared<AskedBalls>(2);
  std::vector<AutoencoderSchedule> parts = {partOf(AutoencoderStage::kAttributes, 4),
                                            partOf(AutoencoderStage::kJoint, 6)};
  parts[1].keeps_encoder = true;
  AutoencoderTrainer trainer = trainerOf(objects, parts);
  while (trainer.part() == 0) trainer.step();
  const std::vector<float> before = trainer.values();
  const std::shared_ptr<const TrainingObject> object = objects->object(1);
  const std::vector<float> latent = trainer.networks().encode(before, *object, 24);
  while (!trainer.isDone()) trainer.step();
  size_t kept = 0, learned = 0;
  for (const Parameter& parameter : trainer.networks().layout().parameters()) {
    const auto first = static_cast<long>(parameter.first);
    const auto end = static_cast<long>(parameter.first + parameter.count);
    const bool is_same =
        std::equal(before.begin() + first, before.begin() + end, trainer.values().begin() + first);
    const bool is_of_encoder = parameter.name.rfind("encoder.", 0) == 0;
    EXPECT_TRUE(is_same || !is_of_encoder) << parameter.name;
    kept += is_of_encoder;
    learned += !is_same;
  }
  EXPECT_GT(kept, 10u);
  EXPECT_GT(learned, 20u);
  // Its mean over steps is the same number, too.
  EXPECT_EQ(trainer.networks().encode(trainer.meanValues(), *object, 24), latent);

  parts[1].optimiser.weight_decay = 0.1;
  EXPECT_THROW(trainerOf(objects, parts), Error);
}

TEST(AutoencoderTrainer, ALossThatIsNotFiniteIsSkippedAndCounted) {
  const auto objects = std::make_shared<AskedBalls>(2);
  objects->at(1).features[0][5] = std::numeric_limits<float>::quiet_NaN();
  std::vector<AutoencoderSchedule> parts = {partOf(AutoencoderStage::kStructure, 8)};
  parts[0].batch = 1;
  AutoencoderTrainer trainer = trainerOf(objects, parts);
  size_t skipped = 0;
  while (!trainer.isDone()) skipped += trainer.step().weights.is_skipped;
  EXPECT_EQ(skipped, 4u);
  for (const float value : trainer.values()) ASSERT_TRUE(std::isfinite(value));
}

std::vector<AutoencoderSchedule> scaledParts(double start) {
  std::vector<AutoencoderSchedule> parts = threeParts();
  for (AutoencoderSchedule& part : parts) {
    part.optimiser.loss_scaling = LossScaling::kDynamic;
    part.optimiser.loss_scale_start = start;
    part.optimiser.loss_scale_growth = 0.4;  // so that it changes within these few steps
  }
  return parts;
}

TEST(AutoencoderTrainer, AScaleOfLossesChangesNoBit) {
  const auto objects = std::make_shared<AskedBalls>(2);
  AutoencoderTrainer plain = trainerOf(objects), scaled = trainerOf(objects, scaledParts(20));
  std::vector<double> scales;
  while (!scaled.isDone()) {
    const AutoencoderStep one = plain.step(), other = scaled.step();
    scales.push_back(other.weights.loss_scale);
    EXPECT_EQ(one.losses.total, other.losses.total);
    EXPECT_EQ(one.weights.gradient_norm, other.weights.gradient_norm);
  }
  // Powers of two round nothing, whatever comes between the loss and a derivative.
  EXPECT_EQ(scaled.values(), plain.values());
  EXPECT_EQ(scales[0], std::exp2(20));
  EXPECT_EQ(scales[4], std::exp2(21));
  EXPECT_EQ(scales[5], std::exp2(20)) << "each part begins anew";
}

TEST(AutoencoderTrainer, AScaleOfLossesThatOverflowsFallsAndGoesOnFromACheckpoint) {
  const auto objects = std::make_shared<AskedBalls>(2);
  std::vector<AutoencoderSchedule> parts = {scaledParts(100)[0]};
  parts[0].optimiser.loss_scale_growth = 1;
  parts[0].optimiser.total_steps = 60;
  AutoencoderTrainer whole = trainerOf(objects, parts);
  std::vector<TensorTable> states;
  uint64_t skipped = 0;
  while (!whole.isDone()) {
    states.push_back(whole.state());
    const std::vector<float> values = whole.values();
    const double scale = std::exp2(100.0 + static_cast<double>(states.size() - 1 - 2 * skipped));
    const WeightStep done = whole.step().weights;
    EXPECT_EQ(done.loss_scale, scale);
    EXPECT_EQ(done.is_skipped || states.size() == 1, whole.values() == values) << "rate 0 at first";
    skipped += done.is_skipped;
  }
  // About 28 steps until derivatives, which are below 1, pass 2^128; then it goes up and down.
  EXPECT_GT(skipped, 5u);
  EXPECT_LT(skipped, 17u);
  AutoencoderTrainer again = trainerOf(objects, parts);
  again.resume(states[41]);
  while (!again.isDone()) again.step();
  EXPECT_EQ(again.values(), whole.values());
  EXPECT_EQ(std::get<std::vector<double>>(again.state()["optimiser.loss_scale"].values),
            std::get<std::vector<double>>(whole.state()["optimiser.loss_scale"].values));
  TensorTable none = states[41];
  none.erase("optimiser.loss_scale");
  EXPECT_THROW(again.resume(none), Error);
}

TEST(AutoencoderTrainer, InBfloat16GoesOnBitForBitWhateverTheThreads) {
  if (!hasNarrow()) GTEST_SKIP() << "no products in bfloat16 here";
  const auto objects = std::make_shared<AskedBalls>(2);
  AutoencoderTrainer whole = trainerOf(objects, scaledParts(20), kNarrow);
  std::vector<TensorTable> states;
  withThreads(1, [&] {
    while (!whole.isDone()) {
      states.push_back(whole.state());
      EXPECT_FALSE(whole.step().weights.is_skipped);
    }
  });
  for (const size_t at : {size_t{0}, size_t{3}, size_t{9}}) {
    AutoencoderTrainer again = trainerOf(objects, scaledParts(20), kNarrow);
    again.resume(states[at]);
    withThreads(3, [&] {
      while (!again.isDone()) again.step();
    });
    EXPECT_EQ(again.values(), whole.values()) << at;
    EXPECT_EQ(again.meanValues(), whole.meanValues()) << at;
  }
  // A scale of losses changes no bit here either: bfloat16 has the exponents of float32.
  AutoencoderTrainer plain = trainerOf(objects, threeParts(), kNarrow);
  while (!plain.isDone()) plain.step();
  EXPECT_EQ(plain.values(), whole.values());
  AutoencoderTrainer wide = trainerOf(objects);
  while (!wide.isDone()) wide.step();
  EXPECT_NE(wide.values(), whole.values());
}

TEST(AutoencoderTrainer, InBfloat16LearnsAboutAsMuch) {
  if (!hasNarrow()) GTEST_SKIP() << "no products in bfloat16 here";
  const auto objects = std::make_shared<AskedBalls>(2);
  std::vector<AutoencoderSchedule> parts = {partOf(AutoencoderStage::kStructure, 60),
                                            partOf(AutoencoderStage::kAttributes, 140)};
  const auto learned = [&](const TrainerRun& run) {
    AutoencoderTrainer trainer = trainerOf(objects, parts, run);
    std::vector<double> losses;
    while (!trainer.isDone()) losses.push_back(trainer.step().losses.total);
    double first = 0, structure = 0, last = 0;
    for (size_t i = 0; i < 20; ++i) {
      structure += losses[40 + i] / 20;
      first += losses[60 + i] / 20;
      last += losses[180 + i] / 20;
    }
    EXPECT_LT(last, 0.75 * first) << "it learns";
    return std::pair(structure, last);
  };
  const auto wide = learned({}), narrow = learned(kNarrow);
  // Rounding of 2^-9 is noise: of four seeds it moved these losses by up to 1.3 %, and the seeds'
  // own were up to 29 % apart.
  EXPECT_NEAR(narrow.first, wide.first, 0.05 * wide.first);
  EXPECT_NEAR(narrow.second, wide.second, 0.05 * wide.second);
}

TEST(AutoencoderTrainer, StatesOfOtherTrainingsAreRefused) {
  const auto objects = std::make_shared<AskedBalls>(1);
  AutoencoderTrainer trainer = trainerOf(objects);
  const TensorTable state = trainer.state();
  const std::vector<float> before = trainer.values();
  const auto refuses = [&](auto&& change) {
    TensorTable table = state;
    change(table);
    EXPECT_THROW(trainer.resume(table), Error);
    EXPECT_EQ(trainer.values(), before);
  };
  refuses([](TensorTable& table) { table.erase("weights"); });
  refuses([](TensorTable& table) { std::get<0>(table["weights"].values).pop_back(); });
  refuses([](TensorTable& table) { std::get<0>(table["weights"].values)[3] = std::nanf(""); });
  refuses([](TensorTable& table) { table["counts"] = {{1}, std::vector<uint64_t>{1}}; });
  refuses([](TensorTable& table) {
    table["counts"] = {{6}, std::vector<uint64_t>{0, 0, 9, 0, 0, 0}};
  });
  refuses([](TensorTable& table) {
    table["optimiser.norms"] = {{9}, std::vector<float>(9, 1.0f)};
  });
}

TEST(AutoencoderTrainer, WhatCannotBeTrainedIsRefused) {
  EXPECT_THROW(trainerOf(std::make_shared<AskedBalls>(0)), Error);
  const auto objects = std::make_shared<AskedBalls>(1);
  EXPECT_THROW(trainerOf(objects, {}), Error);
  const auto refuses = [&](auto&& change) {
    std::vector<AutoencoderSchedule> parts = threeParts();
    change(parts[1]);
    EXPECT_THROW(trainerOf(objects, parts), Error);
  };
  refuses([](AutoencoderSchedule& part) { part.batch = 0; });
  refuses([](AutoencoderSchedule& part) { part.most_tokens = 0; });
  refuses([](AutoencoderSchedule& part) { part.token_halvings = 5; });
  refuses([](AutoencoderSchedule& part) { part.least_anchors = 65; });
  refuses([](AutoencoderSchedule& part) { part.views = 0; });
  refuses([](AutoencoderSchedule& part) { part.optimiser.learning_rate = 0; });
}

}  // namespace
}  // namespace stipple
