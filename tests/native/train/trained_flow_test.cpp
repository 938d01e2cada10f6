#include "train/networks/trained_flow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"

namespace stipple {
namespace {

std::vector<float> numbers(size_t count, uint64_t seed, float size) {
  std::vector<float> made(count);
  for (size_t i = 0; i < count; ++i) {
    made[i] = size * (2 * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i)) - 1);
  }
  return made;
}

struct Case {
  FlowSizes sizes = {
      .block = {.channels = 32, .heads = 2, .head_width = 16, .mlp_width = 128, .rotary_width = 4},
      .block_count = 2,
      .noise_refiner_count = 1,
      .context_refiner_count = 1,
      .token_width = 6,
      .structure_width = 7,
      .colour_width = 3,
      .time_width = 16};
  ParameterLayout layout;
  TrainedFlow flow{layout, sizes};
  std::vector<float> values = numbers(layout.size(), 1, 0.3f);
  Latent object, noise;
  ImageCondition condition;

  Case() {
    for (Latent* latent : {&object, &noise}) {
      latent->token_count = 11;
      latent->width = 6;
      latent->tokens = numbers(66, latent == &object ? 2 : 3, 1.0f);
      const std::vector<float> camera = numbers(kCameraWidth, 4, 1.0f);
      std::copy(camera.begin(), camera.end(), latent->camera.begin());
    }
    condition.rows = 5;
    condition.structure_width = 7;
    condition.colour_width = 3;
    condition.structure = numbers(35, 5, 1.0f);
    condition.colour = numbers(15, 6, 1.0f);
  }
  double loss(std::vector<float>* gradients) const {
    const FlowExample example = flowExample(object, noise, 0.4);
    TrainedFlow::Tape tape;
    const Latent seen = flow.forward(values, example.state, 0.4, condition, tape);
    Latent by;
    const double found = flowLoss(seen, example.velocity, 71, by);
    if (gradients != nullptr) {
      gradients->assign(layout.size(), 0.0f);
      flow.backward(values, example.state, condition, tape, by, *gradients);
    }
    return found;
  }
};

TEST(TrainedFlow, SaysWhatTheNetworkThatIsOnlyRunSays) {
  const Case c;
  TrainedFlow::Tape tape;
  const Latent seen = c.flow.forward(c.values, c.noise, 0.7, c.condition, tape);
  const FlowNetwork network(
      c.layout.table("trained", std::make_shared<const std::vector<float>>(c.values)));
  Latent expected;
  network.velocity({}, c.noise, 0.7, network.context({}, c.condition), expected);
  for (size_t i = 0; i < seen.tokens.size(); ++i) {
    EXPECT_NEAR(seen.tokens[i], expected.tokens[i], 2e-5f);
  }
  for (size_t i = 0; i < kCameraWidth; ++i) {
    EXPECT_NEAR(seen.camera[i], expected.camera[i], 2e-5f);
  }
}

TEST(TrainedFlow, HasTheSameDerivativesForAnyNumberOfThreads) {
  const Case c;
  std::vector<float> together, alone;
  c.loss(&together);
  withThreads(1, [&] { c.loss(&alone); });
  EXPECT_EQ(together, alone);
}

TEST(TrainedFlow, ALossFallsAlongItsDerivative) {
  Case c;
  std::vector<float> gradients;
  const double first = c.loss(&gradients);
  for (int step = 0; step < 60; ++step) {
    double squared = 0;
    for (const float value : gradients) {
      squared += static_cast<double>(value) * static_cast<double>(value);
    }
    const auto rate = static_cast<float>(0.05 / std::sqrt(squared));
    for (size_t i = 0; i < gradients.size(); ++i) c.values[i] -= rate * gradients[i];
    c.loss(&gradients);
  }
  EXPECT_LT(c.loss(nullptr), 0.3 * first);  // One example, which many weights can learn.
}

TEST(TrainedFlow, AnExampleEndsInItsObjectAndBeginsInNoise) {
  const Case c;
  const FlowExample start = flowExample(c.object, c.noise, 1.0);
  const FlowExample end = flowExample(c.object, c.noise, 0.0);
  for (size_t i = 0; i < c.object.tokens.size(); ++i) {
    EXPECT_NEAR(start.state.tokens[i], c.noise.tokens[i], 1e-6f);
    EXPECT_NEAR(end.state.tokens[i], c.object.tokens[i], 2e-5f);  // A hundred thousandth is noise.
    EXPECT_NEAR(start.velocity.tokens[i], start.state.tokens[i] - end.state.tokens[i], 1e-6f);
  }
}

}  // namespace
}  // namespace stipple
