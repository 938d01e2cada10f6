#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "decode/latent/gaussian_network.h"
#include "train/networks/autoencoder_losses.h"
#include "train/networks/trained_encoder.h"
#include "train/networks/trained_gaussians.h"

namespace stipple {
namespace {

constexpr NetworkShape kShape = {2, 16, 5, 2, 4};

std::vector<float> numbers(size_t count, uint64_t seed, float from, float to) {
  std::vector<float> made(count);
  for (size_t i = 0; i < count; ++i) {
    made[i] = from + (to - from) * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i));
  }
  return made;
}

TEST(FarthestPoints, BeginsWithTheFirstAndSpreads) {
  // Along a line; of equally far ones the first.
  const std::vector<float> points = {0, 0, 0, 1, 0, 0, 4, 0, 0, 2, 0, 0, 3, 0, 0, 4, 0, 0};
  EXPECT_EQ(farthestPoints(points, 6), (std::vector<uint32_t>{0, 2, 3, 1, 4, 5}));
}

TEST(FarthestPoints, AreTheSameForAnyNumberOfThreads) {
  const std::vector<float> points = numbers(3 * 20000, 1, 0, 1);
  const std::vector<uint32_t> together = farthestPoints(points, 40);
  std::vector<uint32_t> alone;
  withThreads(1, [&] { alone = farthestPoints(points, 40); });
  EXPECT_EQ(together, alone);
}

TEST(FarthestPoints, OfTooFewAreRefused) {
  EXPECT_THROW(farthestPoints({}, 1), Error);
  EXPECT_THROW(farthestPoints(std::vector<float>(6), 3), Error);
}

struct Clusters {
  static constexpr uint32_t kGaussians = 4;
  std::vector<float> anchors = numbers(3 * 6, 1, 0.4f, 0.6f);
  SplatCloud cloud, gradient;

  Clusters() {
    cloud.sh_degree = gradient.sh_degree = 0;
    cloud.resize(6 * kGaussians);
    gradient.resize(cloud.size());
    const std::vector<float> offsets = numbers(cloud.size() * 3, 2, -0.03f, 0.12f);
    for (size_t i = 0; i < offsets.size(); ++i) {
      cloud.positions[i] = anchors[i / (3 * kGaussians) * 3 + i % 3] + offsets[i];
    }
    cloud.scales = numbers(cloud.size() * 3, 3, 0.1f, 0.4f);
    cloud.opacities = numbers(cloud.size(), 4, 0.1f, 0.9f);
    clear();
  }
  void clear() {
    std::fill(gradient.positions.begin(), gradient.positions.end(), 0.0f);
    std::fill(gradient.scales.begin(), gradient.scales.end(), 0.0f);
    std::fill(gradient.opacities.begin(), gradient.opacities.end(), 0.0f);
  }
  double loss() {
    const SplatLossWeights weights = {2, 3, 5};
    const SplatLosses found = addSplatLosses(weights, 7, anchors, kGaussians, cloud, gradient);
    return 7 * (2 * found.volume + 3 * found.opacity + 5 * (found.off_centre + found.overlap));
  }
};

TEST(AutoencoderLosses, DerivativesOfSplats) {
  Clusters made;
  const double at = made.loss();
  EXPECT_GT(at, 0);
  const SplatCloud gradient = made.gradient;
  const auto compare = [&](std::vector<float>& numbers, const std::vector<float>& seen) {
    const float largest = std::abs(*std::max_element(
        seen.begin(), seen.end(), [](float a, float b) { return std::abs(a) < std::abs(b); }));
    EXPECT_GT(largest, 0.0f);
    for (size_t i = 0; i < numbers.size(); ++i) {
      // Small enough that no radius passes a distance; a loss of order 10 keeps 1e-15 in double.
      const float kept = numbers[i], before = kept - 1e-4f, after = kept + 1e-4f;
      numbers[i] = after;
      const double above = made.loss();
      numbers[i] = before;
      const double below = made.loss();
      numbers[i] = kept;
      const double expected =
          (above - below) / (static_cast<double>(after) - static_cast<double>(before));
      EXPECT_NEAR(static_cast<double>(seen[i]), expected, 2e-4 * static_cast<double>(largest)) << i;
    }
  };
  compare(made.cloud.positions, gradient.positions);
  compare(made.cloud.scales, gradient.scales);
  compare(made.cloud.opacities, gradient.opacities);
}

TEST(AutoencoderLosses, ClustersOfNoExtentStayFinite) {
  Clusters made;
  for (size_t i = 0; i < made.cloud.positions.size(); ++i) {
    made.cloud.positions[i] = made.anchors[i % 3];
  }
  made.anchors.assign(made.anchors.size(), 0.5f);
  EXPECT_TRUE(std::isfinite(made.loss()));
  for (size_t i = 0; i < made.cloud.positions.size(); ++i) made.cloud.positions[i] = 0.5f;
  EXPECT_TRUE(std::isfinite(made.loss()));
  for (const float value : made.gradient.positions) EXPECT_TRUE(std::isfinite(value));
}

TEST(AutoencoderLosses, DivergenceIsLeastAtTheNormalDistribution) {
  EncodedLatent normal = {{0, 0}, {0, 0}}, by = {{0, 0}, {0, 0}};
  EXPECT_EQ(addDivergence(normal, 2, 1, by), 0);
  EXPECT_EQ(by.mean, (std::vector<float>{0, 0}));
  EXPECT_EQ(by.log_variance, (std::vector<float>{0, 0}));
  const EncodedLatent other = {{1, 0}, {0, 2}};
  EXPECT_NEAR(addDivergence(other, 2, 3, by), 0.25 + 0.25 * (std::exp(2.0) - 3), 1e-12);
  EXPECT_NEAR(by.mean[0], 1.5f, 1e-6f);
  EXPECT_NEAR(by.log_variance[1], 0.75f * (std::exp(2.0f) - 1), 1e-5f);
}

TEST(TrainedGaussians, SayWhatTheNetworkThatIsOnlyRunSays) {
  ParameterLayout layout;
  const TrainedGaussians gaussians(layout, "gs.", kShape, 4);
  const size_t lattice = layout.add("gs.points_offset_perturbation", {4, 3});
  const size_t spread = layout.add("gs.base_offset_scale", {1});
  const std::vector<float> values = numbers(layout.size(), 1, -0.3f, 0.3f);
  EXPECT_LT(lattice, spread);
  const std::vector<float> points = numbers(3 * 20, 2, 0, 1);
  Latent latent;
  latent.token_count = 9;
  latent.width = kShape.latent_width;
  latent.tokens = numbers(9 * kShape.latent_width, 3, -1, 1);
  TrainedGaussians::Tape tape;
  const std::vector<float> seen =
      gaussians.forward(values, {9, latent.tokens.data()}, 20, points.data(), tape);
  const WeightTable table =
      layout.table("trained", std::make_shared<const std::vector<float>>(values));
  const GaussianNetwork network(table.under("gs."));
  const std::vector<float> expected =
      network.features({}, network.keysOf({}, latent), 20, points.data());
  ASSERT_EQ(seen.size(), expected.size());
  for (size_t i = 0; i < seen.size(); ++i) EXPECT_NEAR(seen[i], expected[i], 2e-5f);
}

TEST(TrainedEncoder, HasTheSameDerivativesForAnyNumberOfThreads) {
  ParameterLayout layout;
  const size_t widths[] = {6, 3};
  const TrainedEncoder encoder(layout, "encoder.", kShape, widths);
  const std::vector<float> values = numbers(layout.size(), 1, -0.3f, 0.3f);
  const std::vector<float> points = numbers(3 * 200, 2, 0, 1), first = numbers(6 * 200, 3, -1, 1),
                           second = numbers(3 * 200, 4, -1, 1);
  const std::vector<FeaturePoints> given = {{200, points.data(), first.data()},
                                            {200, points.data(), second.data()}};
  const auto derivatives = [&] {
    TrainedEncoder::Tape tape;
    const EncodedLatent encoded = encoder.forward(values, given, farthestPoints(points, 12), tape);
    std::vector<float> gradients(layout.size(), 0.0f);
    float* const nobody[] = {nullptr, nullptr};
    encoder.backward(values, given, tape, encoded, gradients, nobody);
    return gradients;
  };
  const std::vector<float> together = derivatives();
  std::vector<float> alone;
  withThreads(1, [&] { alone = derivatives(); });
  EXPECT_EQ(together, alone);
}

}  // namespace
}  // namespace stipple
