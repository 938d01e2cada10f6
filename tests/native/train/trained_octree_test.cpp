#include "train/networks/trained_octree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "decode/latent/octree_network.h"
#include "math/morton.h"

namespace stipple {
namespace {

constexpr NetworkShape kShape = {2, 16, 5, 2, 4};
constexpr size_t kTokens = 9;
constexpr int kLeafLevel = 4;

std::vector<float> numbers(size_t count, uint64_t seed, float size) {
  std::vector<float> made(count);
  for (size_t i = 0; i < count; ++i) {
    made[i] = size * (2 * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i)) - 1);
  }
  return made;
}

struct Case {
  ParameterLayout layout;
  TrainedOctree octree{layout, "octree.", kShape};
  std::vector<float> values = numbers(layout.size(), 1, 0.3f);
  std::vector<float> latent = numbers(kTokens * kShape.latent_width, 2, 1.0f);
  std::vector<uint64_t> leaves;
  std::vector<OctreeLevel> levels;

  Case() {
    for (uint64_t i = 0; i < 30; ++i) leaves.push_back(mixBits(i) % 4096);
    levels = levelsAbove(leaves, kLeafLevel, std::vector<double>(leaves.size(), 1.0 / 30));
  }
};

TEST(TrainedOctree, SaysWhatTheNetworkThatIsOnlyRunSays) {
  const Case c;
  TrainedOctree::Tape tape;
  const std::vector<float> logits =
      c.octree.forward(c.values, kTokens, c.latent.data(), c.levels, tape);
  const WeightTable table =
      c.layout.table("trained", std::make_shared<const std::vector<float>>(c.values));
  const OctreeNetwork network(table.under("octree."));
  Latent latent;
  latent.token_count = kTokens;
  latent.width = kShape.latent_width;
  latent.tokens = c.latent;
  const LatentKeys keys = network.keysOf({}, latent);
  size_t row = 0;
  for (const OctreeLevel& level : c.levels) {
    std::vector<float> expected(level.cells.size() * 8);
    network.logits({}, keys, level.level, level.cells, expected);
    for (const float value : expected) EXPECT_NEAR(logits[row++], value, 2e-5f);
  }
  EXPECT_EQ(row, logits.size());
}

TEST(TrainedOctree, HasTheSameDerivativesForAnyNumberOfThreads) {
  const Case c;
  const auto derivatives = [&] {
    TrainedOctree::Tape tape;
    const std::vector<float> logits =
        c.octree.forward(c.values, kTokens, c.latent.data(), c.levels, tape);
    std::vector<float> by_logits(logits.size());
    weighLogProbabilities(c.levels, logits, -1.0, by_logits);
    std::vector<float> all(c.layout.size() + c.latent.size(), 0.0f);
    c.octree.backward(c.values, kTokens, c.latent.data(), c.levels, tape, by_logits,
                      std::span(all).first(c.layout.size()), &all[c.layout.size()]);
    return all;
  };
  const std::vector<float> parallel = derivatives();
  std::vector<float> alone;
  withThreads(1, [&] { alone = derivatives(); });
  EXPECT_EQ(parallel, alone);
}

TEST(TrainedOctree, ALossFallsAlongItsDerivative) {
  Case c;
  const auto loss = [&](std::span<const float> values, std::vector<float>* gradients) {
    TrainedOctree::Tape tape;
    const std::vector<float> logits =
        c.octree.forward(values, kTokens, c.latent.data(), c.levels, tape);
    std::vector<float> by_logits(logits.size()), by_latent(c.latent.size(), 0.0f);
    const double found = weighLogProbabilities(c.levels, logits, -1.0, by_logits);
    if (gradients != nullptr) {
      gradients->assign(c.layout.size(), 0.0f);
      c.octree.backward(values, kTokens, c.latent.data(), c.levels, tape, by_logits, *gradients,
                        by_latent.data());
    }
    return found;
  };
  std::vector<float> gradients;
  double first = 0, last = 0, least = 0;
  for (const OctreeLevel& level : c.levels) least += leastCrossEntropy(level);
  for (int step = 0; step < 60; ++step) {
    last = loss(c.values, &gradients);
    if (step == 0) first = last;
    double squared = 0;
    for (const float value : gradients) {
      squared += static_cast<double>(value) * static_cast<double>(value);
    }
    const auto rate = static_cast<float>(0.05 / std::sqrt(squared));
    for (size_t i = 0; i < gradients.size(); ++i) c.values[i] -= rate * gradients[i];
  }
  // 30 leaves of a network that begins at random; what no network can be below is taken off.
  EXPECT_GT(last, least - 1e-6);
  EXPECT_LT(last - least, 0.35 * (first - least));
}

TEST(OctreeLosses, DerivativesOfWeighedLogProbabilities) {
  const Case c;
  size_t rows = 0;
  for (const OctreeLevel& level : c.levels) rows += level.cells.size();
  const std::vector<float> logits = numbers(rows * 8, 3, 2.0f);
  std::vector<float> gradient(logits.size()), unused(logits.size());
  weighLogProbabilities(c.levels, logits, -2.0, gradient);
  for (size_t i = 0; i < logits.size(); i += 5) {
    std::vector<float> before = logits, after = logits;
    before[i] -= 0.01f;
    after[i] += 0.01f;
    const double step = static_cast<double>(after[i]) - static_cast<double>(before[i]);
    const double expected = (weighLogProbabilities(c.levels, after, -2.0, unused) -
                             weighLogProbabilities(c.levels, before, -2.0, unused)) /
                            step;
    EXPECT_NEAR(static_cast<double>(gradient[i]), expected, 1e-5);  // 0.01^2 / 6 of order one
  }
}

TEST(OctreeLosses, LeavesAreCountedBelowEveryCell) {
  const std::vector<uint64_t> leaves = {mortonEncode(3, 0, 0), mortonEncode(0, 0, 0),
                                        mortonEncode(3, 0, 0), mortonEncode(3, 3, 2)};
  const std::vector<double> weights = {1, 2, 4, 8};
  const std::vector<OctreeLevel> levels = levelsAbove(leaves, 2, weights);
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_EQ(levels[0].cells, (std::vector<uint64_t>{0}));
  EXPECT_EQ(levels[0].weights, (std::vector<double>{2, 5, 0, 0, 0, 0, 0, 8}));
  EXPECT_EQ(levels[1].cells, (std::vector<uint64_t>{0, 1, 7}));
  EXPECT_EQ(levels[1].weights[0], 2);
  EXPECT_EQ(levels[1].weights[8 + 1], 5);
  EXPECT_EQ(levels[1].weights[16 + 3], 8);
}

TEST(OctreeLosses, LogitsFarApartStayFinite) {
  const std::vector<OctreeLevel> levels = {{0, {0}, {0, 0, 0, 0, 0, 0, 0, 1}}};
  const std::vector<float> logits = {3e38f, 0, 0, 0, 0, 0, 0, -1e4f};
  std::vector<float> gradient(8);
  const double loss = weighLogProbabilities(levels, logits, -1.0, gradient);
  EXPECT_TRUE(std::isfinite(loss));
  EXPECT_FLOAT_EQ(gradient[0], 1.0f);
  EXPECT_FLOAT_EQ(gradient[7], -1.0f);
}

}  // namespace
}  // namespace stipple
