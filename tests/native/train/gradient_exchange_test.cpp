#include "train/networks/gradient_exchange.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <barrier>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "train/networks/autoencoder_trainer.h"
#include "train/trained_balls.h"

namespace stipple {
namespace {

/// What the threads of a test exchange by.
class Table {
 public:
  explicit Table(size_t size) : everyone(static_cast<ptrdiff_t>(size)), given(size) {}
  std::barrier<> everyone;
  std::vector<std::vector<double>> given;
};

class ThreadExchange final : public GradientExchange {
 public:
  ThreadExchange(std::shared_ptr<Table> table, size_t rank)
      : table_(std::move(table)), rank_(rank) {}
  size_t rank() const override { return rank_; }
  size_t size() const override { return table_->given.size(); }
  void sum(std::span<float> numbers) override { exchange(numbers, size()); }
  void sum(std::span<double> numbers) override { exchange(numbers, size()); }
  void share(std::span<float> numbers) override { exchange(numbers, 1); }

 private:
  /// The sum of the first ranks.
  template <class T>
  void exchange(std::span<T> numbers, size_t ranks) {
    table_->given[rank_].assign(numbers.begin(), numbers.end());
    table_->everyone.arrive_and_wait();
    for (size_t i = 0; i < numbers.size(); ++i) {
      double sum = 0;
      for (size_t rank = 0; rank < ranks; ++rank) sum += table_->given[rank][i];
      numbers[i] = static_cast<T>(sum);
    }
    table_->everyone.arrive_and_wait();
  }

  std::shared_ptr<Table> table_;
  size_t rank_;
};

/// Calls body(exchange of the rank) in a thread for each of `size` ranks.
template <class Body>
void together(size_t size, Body&& body) {
  const auto table = std::make_shared<Table>(size);
  std::vector<std::thread> threads;
  for (size_t rank = 0; rank < size; ++rank) {
    threads.emplace_back(
        [&body, table, rank] { body(std::make_shared<ThreadExchange>(table, rank)); });
  }
  for (std::thread& thread : threads) thread.join();
}

std::vector<AutoencoderSchedule> partsOf(size_t batch) {
  AutoencoderSchedule part;
  part.batch = batch;
  part.most_tokens = 24;
  part.token_halvings = 1;
  part.least_anchors = 16;
  part.most_anchors = 64;
  part.views = 1;
  part.optimiser.learning_rate = 1e-3;
  part.optimiser.warm_up = 2;
  part.optimiser.total_steps = 4;
  std::vector<AutoencoderSchedule> parts(3, part);
  parts[1].stage = AutoencoderStage::kAttributes;
  parts[2].stage = AutoencoderStage::kJoint;
  return parts;
}

AutoencoderTrainer trainerOf(std::shared_ptr<const ObjectSource> objects, size_t batch,
                             std::shared_ptr<GradientExchange> exchange = nullptr) {
  return {smallSizes(),       partsOf(batch), 7,
          std::move(objects), cpuBackends(),  {std::move(exchange)}};
}

double farthest(const std::vector<float>& a, const std::vector<float>& b) {
  double most = 0, largest = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    most = std::max(most, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
    largest = std::max(largest, std::abs(static_cast<double>(a[i])));
  }
  return most / largest;
}

TEST(GradientExchange, ProcessesThatShareStepsLearnWhatOneLearns) {
  const auto objects = std::make_shared<Balls>(5);
  AutoencoderTrainer alone = trainerOf(objects, 3);
  std::vector<double> losses;
  while (!alone.isDone()) losses.push_back(alone.step().losses.total);
  for (const size_t ranks : {size_t{2}, size_t{3}}) {  // one has two examples of a step, or all one
    std::vector<std::vector<float>> values(ranks), means(ranks);
    std::vector<std::vector<double>> seen(ranks);
    together(ranks, [&](const std::shared_ptr<GradientExchange>& exchange) {
      AutoencoderTrainer trainer = trainerOf(objects, 3, exchange);
      while (!trainer.isDone()) seen[exchange->rank()].push_back(trainer.step().losses.total);
      values[exchange->rank()] = trainer.values();
      means[exchange->rank()] = trainer.meanValues();
    });
    for (size_t rank = 1; rank < ranks; ++rank) {
      EXPECT_EQ(values[rank], values[0]);
      EXPECT_EQ(means[rank], means[0]);
      EXPECT_EQ(seen[rank], seen[0]);
    }
    // Sums of float32 in another order: 2e-7 of the largest weight is seen after these 12 steps.
    EXPECT_LT(farthest(alone.values(), values[0]), 1e-6);
    for (size_t i = 0; i < losses.size(); ++i) EXPECT_NEAR(seen[0][i], losses[i], 1e-5 * losses[i]);
  }
}

TEST(GradientExchange, AGradientThatIsNotFiniteIsSkippedByAll) {
  const auto objects = std::make_shared<Balls>(4);
  objects->at(1).features[0][5] = std::numeric_limits<float>::quiet_NaN();
  std::vector<std::vector<float>> values(2);
  std::vector<std::vector<bool>> skipped(2);
  together(2, [&](const std::shared_ptr<GradientExchange>& exchange) {
    // Densities that are not finite are drawn from in no other stage.
    AutoencoderTrainer trainer(smallSizes(), {partsOf(2).front()}, 7, objects, cpuBackends(),
                               TrainerRun{exchange});
    while (!trainer.isDone()) {
      skipped[exchange->rank()].push_back(trainer.step().weights.is_skipped);
    }
    values[exchange->rank()] = trainer.values();
  });
  EXPECT_EQ(std::count(skipped[0].begin(), skipped[0].end(), true), 2);  // one of each two steps
  EXPECT_EQ(skipped[1], skipped[0]);
  EXPECT_EQ(values[1], values[0]);
  for (const float value : values[0]) ASSERT_TRUE(std::isfinite(value));
}

TEST(GradientExchange, GoesOnAloneFromAStateOfMany) {
  const auto objects = std::make_shared<Balls>(3);
  TensorTable state;
  std::vector<float> whole;
  together(2, [&](const std::shared_ptr<GradientExchange>& exchange) {
    AutoencoderTrainer trainer = trainerOf(objects, 2, exchange);
    while (!trainer.isDone()) {
      const uint64_t step = trainer.step().step;
      if (exchange->rank() == 0 && step == 7) state = trainer.state();
    }
    if (exchange->rank() == 0) whole = trainer.values();
  });
  AutoencoderTrainer alone = trainerOf(objects, 2);
  alone.resume(state);
  while (!alone.isDone()) alone.step();
  EXPECT_LT(farthest(whole, alone.values()), 1e-6);
}

TEST(GradientExchange, WhatCannotBeSharedIsRefused) {
  const auto objects = std::make_shared<Balls>(2);
  std::vector<std::string> messages(3);
  together(3, [&](const std::shared_ptr<GradientExchange>& exchange) {
    try {
      trainerOf(objects, 2, exchange);
    } catch (const Error& error) {
      messages[exchange->rank()] = error.what();
    }
  });
  for (const std::string& message : messages) {
    EXPECT_EQ(
        message,
        "the number of objects in a step of part 0 is 2, and 3 processes share them; at least "
        "one for each is needed");
  }
}

TEST(GradientExchange, WeightsThatDriftApartAreRefused) {
  const auto objects = std::make_shared<Balls>(2);
  std::vector<std::string> messages(2);
  together(2, [&](const std::shared_ptr<GradientExchange>& exchange) {
    AutoencoderTrainer trainer = trainerOf(objects, 2, exchange);
    TensorTable state = trainer.state();
    std::get<std::vector<float>>(state["weights"].values)[4] +=
        1e-3f * static_cast<float>(exchange->rank());
    trainer.resume(state);
    try {
      trainer.step();
    } catch (const Error& error) {
      messages[exchange->rank()] = error.what();
    }
  });
  for (const std::string& message : messages) {
    EXPECT_EQ(message,
              "the weights of the 2 processes differ; they have to be the same on all machines");
  }
}

TEST(GradientExchange, AloneNothingChanges) {
  const std::shared_ptr<GradientExchange> alone = noExchange();
  std::vector<float> numbers = {1, -0.0f, 3};
  alone->sum(numbers);
  alone->share(numbers);
  requireSame(*alone, 5, "the numbers");
  requireExamples(*alone, 1, "the part");
  EXPECT_EQ(numbers, (std::vector<float>{1, -0.0f, 3}));
  EXPECT_NE(fingerprintOf(numbers), fingerprintOf(std::vector<float>{1, 0.0f, 3}));
}

}  // namespace
}  // namespace stipple
