#include "train/networks/density_autoencoder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "decode/latent/latent_decoder.h"
#include "decode/latent/latent_density.h"
#include "decode/latent/latent_networks.h"
#include "density/anchor_sampling.h"
#include "train/optimiser/weight_optimiser.h"
#include "train/trained_ball.h"

namespace stipple {
namespace {

AutoencoderExample exampleOf(const TrainingObject& object, AutoencoderStage stage, uint64_t seed) {
  AutoencoderExample example;
  example.object = &object;
  example.stage = stage;
  example.tokens = 24;
  example.anchors = 128;
  example.views = 2;
  example.seed = seed;
  return example;
}

TEST(DensityAutoencoder, BeginsWithAnEvenDensityAndSplatsOnTheirLattice) {
  const DensityAutoencoder networks(smallSizes());
  const std::vector<float> values = networks.startValues(1);
  const TrainingObject object = ball();
  const std::vector<float> latent = networks.encode(values, object, 24);
  EXPECT_EQ(latent.size(), 24u * 8u);
  const SplatCloud cloud = networks.decode(values, latent, 512, 3);
  ASSERT_EQ(cloud.size(), 2048u);
  // 512 anchors in the 4,096 cells of an even density: each eighth of the cube has 64.
  size_t eighth = 0;
  for (size_t n = 0; n < cloud.size(); n += 4) {
    eighth += cloud.positions[n * 3] < 0 && cloud.positions[n * 3 + 1] < 0 &&
              cloud.positions[n * 3 + 2] < 0;
  }
  EXPECT_NEAR(static_cast<double>(eighth), 64, 12);  // Splats reach over the border by 0.025.
  for (const float opacity : cloud.opacities) EXPECT_NEAR(opacity, 0.1f, 1e-4f);
}

TEST(DensityAutoencoder, LearnsAnObjectStageByStage) {
  const DensityAutoencoder networks(smallSizes());
  std::vector<float> values = networks.startValues(1), gradients(values.size());
  const TrainingObject object = ball();
  AutoencoderLossWeights weights;
  AutoencoderLosses first_structure, structure, first_joint, joint;
  WeightOptimiserOptions options;
  options.learning_rate = 3e-3;
  options.warm_up = 10;
  options.total_steps = 1200;
  WeightOptimiser optimiser(options, values);
  for (uint64_t step = 0; step < 1200; ++step) {
    const AutoencoderStage stage = step < 150    ? AutoencoderStage::kStructure
                                   : step < 1000 ? AutoencoderStage::kAttributes
                                                 : AutoencoderStage::kJoint;
    weights.structure = stage == AutoencoderStage::kStructure ? 1 : 0.001;
    weights.divergence = stage == AutoencoderStage::kStructure ? 0.01 : 1e-4;
    std::fill(gradients.begin(), gradients.end(), 0.0f);
    const AutoencoderLosses losses = networks.addExample(values, exampleOf(object, stage, step),
                                                         weights, *cpuBackends(), gradients);
    if (step == 0) first_structure = losses;
    if (step == 149) structure = losses;
    if (step == 150) first_joint = losses;
    joint = losses;
    ASSERT_FALSE(optimiser.step(gradients, values).is_skipped) << step;
  }
  // An even density is 4 nats or so from a shell; images begin as grey fog.
  EXPECT_LT(structure.structure, 0.25 * first_structure.structure);
  EXPECT_LT(joint.l1, 0.4 * first_joint.l1);
  EXPECT_GT(joint.ssim, first_joint.ssim + 0.2);
  // Another budget and other draws of the same latent: anchors lie on the shell.
  const SplatCloud cloud = networks.decode(values, networks.encode(values, object, 24), 300, 77);
  size_t near = 0;
  for (size_t n = 0; n < cloud.size(); ++n) {
    const double radius =
        std::hypot(cloud.positions[n * 3], cloud.positions[n * 3 + 1], cloud.positions[n * 3 + 2]);
    near += std::abs(radius - kRadius) < 0.12;  // Two cells.
  }
  EXPECT_GT(static_cast<double>(near), 0.9 * static_cast<double>(cloud.size()));
}

/// Networks that learn the ball.
class Learning {
 public:
  Learning(const DensityAutoencoder& networks, uint64_t seed, uint64_t steps)
      : networks_(networks),
        seed_(seed),
        values_(networks.startValues(seed)),
        optimiser_(options(steps), values_) {}

  /// Steps up to that one. Returns the mean L1 of the last 200.
  double to(uint64_t end, AutoencoderStage stage) {
    constexpr uint64_t kJudged = 200;
    const bool is_first = stage == AutoencoderStage::kStructure;
    AutoencoderLossWeights weights;
    weights.structure = is_first ? 1 : 0.001;
    weights.divergence = is_first ? 0.01 : 1e-4;
    double sum = 0;
    for (; step_ < end; ++step_) {
      std::vector<float> gradients(values_.size(), 0.0f);
      const AutoencoderExample example = exampleOf(object_, stage, step_ + 100000 * seed_);
      const double l1 =
          networks_.addExample(values_, example, weights, *cpuBackends(), gradients).l1;
      if (step_ + kJudged >= end) sum += l1 / kJudged;
      optimiser_.step(gradients, values_);
    }
    return sum;
  }

 private:
  static WeightOptimiserOptions options(uint64_t steps) {
    WeightOptimiserOptions options;
    options.learning_rate = 3e-3;
    options.warm_up = 10;
    options.total_steps = steps;
    return options;
  }

  const DensityAutoencoder& networks_;
  TrainingObject object_ = ball();
  uint64_t seed_;
  std::vector<float> values_;
  WeightOptimiser optimiser_;
  uint64_t step_ = 0;
};

TEST(DensityAutoencoder, LearnsMoreWhereAnchorsTellTheDensityWhatTheyDoToImages) {
  const DensityAutoencoder networks(smallSizes());
  Learning with(networks, 1, 1500);
  with.to(150, AutoencoderStage::kStructure);
  with.to(700, AutoencoderStage::kAttributes);
  Learning without = with;
  const double l1 = with.to(1500, AutoencoderStage::kJoint);
  const double others = without.to(1500, AutoencoderStage::kAttributes);
  EXPECT_LT(l1, 0.96 * others);
}

TEST(DensityAutoencoder, HasTheSameDerivativesForAnyNumberOfThreads) {
  const DensityAutoencoder networks(smallSizes());
  const std::vector<float> values = networks.startValues(2);
  const TrainingObject object = ball();
  const auto derivatives = [&] {
    std::vector<float> gradients(values.size(), 0.0f);
    networks.addExample(values, exampleOf(object, AutoencoderStage::kJoint, 5), {}, *cpuBackends(),
                        gradients);
    return gradients;
  };
  const std::vector<float> together = derivatives();
  std::vector<float> alone;
  withThreads(1, [&] { alone = derivatives(); });
  EXPECT_EQ(together, alone);
}

/// L1 of a view, where shapes are those of one latent and colours those of another.
double lossOf(const DensityAutoencoder& networks, std::span<const float> values,
              std::span<const float> shapes, std::span<const float> colours, const ObjectView& view,
              const AnchorDraw& draw) {
  SplatCloud cloud = networks.decode(values, shapes, draw.anchors, draw.seed);
  cloud.sh = networks.decode(values, colours, draw.anchors, draw.seed).sh;
  RenderOptions options;
  options.with_depth = false;
  options.with_background = true;
  const std::unique_ptr<ViewPass> pass = cpuBackends()->makeViewPass();
  pass->forward(cloud, view.camera, options);
  return pass->loss(view.image, {}, lossFor({}, 0)).l1;
}

TEST(DensityAutoencoder, DerivativesByColoursAreThoseOfFiniteDifferences) {
  const DensityAutoencoder networks(smallSizes());
  const std::vector<float> values = speakingValues(networks);
  const TrainingObject object = ball();
  const std::vector<float> latent = networks.encode(values, object, 24);
  const ObjectView view = object.views->view(3);
  AnchorDraw draw = {128, 0};
  while (keyedBits(draw.seed, RandomUse::kBackground, 0) & 1) ++draw.seed;  // Before black.
  std::vector<float> by_latent(latent.size(), 0.0f);
  const double l1 =
      networks.addColours(values, latent, view, draw, 0, *cpuBackends(), by_latent).l1;
  EXPECT_NEAR(l1, lossOf(networks, values, latent, latent, view, draw), 1e-6);
  // Along what raises it most, and along another direction.
  for (const uint64_t seed : {0, 1}) {
    std::vector<float> ahead = latent, behind = latent;
    double slope = 0, squares = 0;
    std::vector<double> along(latent.size());
    for (size_t i = 0; i < latent.size(); ++i) {
      const double drawn = unitDouble(keyedBits(seed, RandomUse::kTokenNoise, i)) - 0.5;
      along[i] = seed == 0 ? static_cast<double>(by_latent[i])
                           : drawn + 20 * static_cast<double>(by_latent[i]);
      squares += along[i] * along[i];
    }
    constexpr double kStep = 0.1;  // Large, as float32 images tell 1e-7 of a loss of 0.1.
    for (size_t i = 0; i < latent.size(); ++i) {
      const double move = kStep * along[i] / std::sqrt(squares);
      slope += static_cast<double>(by_latent[i]) * along[i] / std::sqrt(squares);
      ahead[i] += static_cast<float>(move);
      behind[i] -= static_cast<float>(move);
    }
    const double difference = (lossOf(networks, values, latent, ahead, view, draw) -
                               lossOf(networks, values, latent, behind, view, draw)) /
                              (2 * kStep);
    EXPECT_NEAR(slope, difference, 0.03 * std::abs(difference)) << seed;
  }
}

/// What anchors do to images, as the derivative by the biases of the density's logits. In: side of
/// the images. Out: their L1.
std::vector<double> densityGradient(uint32_t side, double& l1) {
  const DensityAutoencoder networks(smallSizes());
  const std::vector<float> values = networks.startValues(2);
  const TrainingObject object = ball(side);
  AutoencoderLossWeights weights;
  weights.structure = weights.divergence = 0;
  const Parameter& bias = networks.layout().find("octree.out_proj.bias");
  std::vector<float> gradients(values.size(), 0.0f);
  AutoencoderExample example = exampleOf(object, AutoencoderStage::kJoint, 5);
  example.views = 12;
  l1 = networks.addExample(values, example, weights, *cpuBackends(), gradients).l1;
  return {gradients.begin() + static_cast<std::ptrdiff_t>(bias.first),
          gradients.begin() + static_cast<std::ptrdiff_t>(bias.first + bias.count)};
}

TEST(DensityAutoencoder, WhatAnchorsDoToImagesHasTheUnitOfTheirLoss) {
  double l1 = 0, fine_l1 = 0;
  const std::vector<double> coarse = densityGradient(32, l1), fine = densityGradient(64, fine_l1);
  double sum = 0, fine_sum = 0;
  for (const double value : coarse) sum += std::abs(value);
  for (const double value : fine) fine_sum += std::abs(value);
  // Four times as many pixels show the same image, with another outline. A sum over pixels would
  // be four times as large.
  EXPECT_NEAR(fine_sum / sum, 1, 0.5);
  // What all anchors take off the loss, three channels of L1, is of the loss's size; it comes back
  // at each of the four levels, twice at most.
  EXPECT_LT(sum, 4 * 2 * 3 * l1);
}

TEST(DensityAutoencoder, ExamplesAddUp) {
  const DensityAutoencoder networks(smallSizes());
  const std::vector<float> values = networks.startValues(2);
  const TrainingObject object = ball();
  std::vector<float> one(values.size(), 0.0f), two(values.size(), 0.0f);
  AutoencoderExample example = exampleOf(object, AutoencoderStage::kJoint, 5);
  networks.addExample(values, example, {}, *cpuBackends(), one);
  example.share = 0.5;
  networks.addExample(values, example, {}, *cpuBackends(), two);
  networks.addExample(values, example, {}, *cpuBackends(), two);
  double largest = 0, error = 0;
  for (size_t i = 0; i < one.size(); ++i) {
    largest = std::max(largest, static_cast<double>(std::abs(one[i])));
    error = std::max(error, static_cast<double>(std::abs(one[i] - two[i])));
  }
  EXPECT_LT(error, 1e-5 * largest);
}

TEST(DensityAutoencoder, ObjectsThatAreEmptyOrOfOtherFeaturesAreRefused) {
  const DensityAutoencoder networks(smallSizes());
  const std::vector<float> values = networks.startValues(2);
  std::vector<float> gradients(values.size(), 0.0f);
  const auto refuses = [&](auto&& change) {
    TrainingObject object = ball();
    change(object);
    EXPECT_THROW(networks.addExample(values, exampleOf(object, AutoencoderStage::kJoint, 5), {},
                                     *cpuBackends(), gradients),
                 Error);
  };
  refuses([](TrainingObject& object) { object.surface.clear(); });
  refuses([](TrainingObject& object) { object.points[0].clear(); });
  refuses([](TrainingObject& object) { object.features[0].resize(600 * 2); });
  refuses([](TrainingObject& object) { object.views = nullptr; });
  refuses([](TrainingObject& object) {
    object.views = std::make_shared<const KeptViews>(std::vector<ObjectView>());
  });
}

/// What a file of these tensors is read as. In: tensors, which must outlive it.
WeightTable tableOf(const TensorTable& tensors) {
  std::map<std::string, WeightTensor> found;
  for (const auto& [name, tensor] : tensors) {
    const auto& values = std::get<std::vector<float>>(tensor.values);
    found[name] = {WeightType::kFloat32, "F32", tensor.shape,
                   reinterpret_cast<const uint8_t*>(values.data())};
  }
  return {"trained", std::move(found), nullptr};
}

/// In: follows_spacing, of the sizes.
void expectTensorsAreRead(bool follows_spacing) {
  AutoencoderSizes sizes = smallSizes();
  sizes.follows_spacing = follows_spacing;
  const DensityAutoencoder networks(sizes);
  std::vector<float> values = networks.startValues(4);
  for (size_t i = 0; i < values.size(); ++i) {  // also what is silent at the start
    values[i] += 0.05f * static_cast<float>(unitDouble(mixBits(i)) - 0.5);
  }
  const auto latent = std::make_shared<Latent>();
  latent->width = 8;
  latent->tokens = networks.encode(values, ball(), 24);
  latent->token_count = 24;
  const SplatCloud own = networks.decode(values, latent->tokens, 200, 3);

  const TensorTable tensors = networks.tensors(values);
  const LatentNetworks read = readLatentNetworks(tableOf(tensors));
  const LatentDensity density(read.octree, latent, {}, smallSizes().leaf_level);
  const AnchorSet anchors = sampleAnchors(density, {.count = 200, .seed = 3});
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = 4;
  const SplatCloud cloud = LatentDecoder(read.gaussians, latent).decode(request);
  ASSERT_EQ(cloud.size(), own.size());
  double most = 0;
  for (size_t i = 0; i < cloud.positions.size(); ++i) {
    most = std::max(most, static_cast<double>(std::abs(cloud.positions[i] - own.positions[i])));
    most = std::max(most, static_cast<double>(std::abs(cloud.sh[i] - own.sh[i])));
    most = std::max(most, static_cast<double>(std::abs(cloud.scales[i] - own.scales[i])));
  }
  EXPECT_LT(most, 2e-5);  // Sums have another order.
}

TEST(DensityAutoencoder, ItsTensorsAreReadByTheNetworksThatDecodeLatents) {
  expectTensorsAreRead(false);
  expectTensorsAreRead(true);
}

TEST(DensityAutoencoder, ItsSplatsAreAsLargeAsTheirAnchorsStandApart) {
  AutoencoderSizes sizes = smallSizes();
  const TrainingObject object = ball();
  const auto meanScale = [&](uint64_t anchors) {
    const DensityAutoencoder networks(sizes);
    const std::vector<float> values = networks.startValues(1);
    const SplatCloud cloud =
        networks.decode(values, networks.encode(values, object, 24), anchors, 3);
    double sum = 0;
    for (const float scale : cloud.scales) sum += static_cast<double>(scale);
    return sum / static_cast<double>(cloud.scales.size());
  };
  EXPECT_NEAR(meanScale(64), meanScale(512), 1e-6);  // the published unit
  sizes.follows_spacing = true;
  // The density is even at first: eight times as many anchors stand half as far apart, but at the
  // cube's sides, where neighbours are missing.
  EXPECT_NEAR(meanScale(64) / meanScale(512), 2, 0.15);
}

}  // namespace
}  // namespace stipple
