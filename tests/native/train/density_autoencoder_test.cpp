#include "train/networks/density_autoencoder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "train/optimiser/weight_optimiser.h"
#include "train/sphere_views.h"

namespace stipple {
namespace {

constexpr double kRadius = 0.35;

Vec3d colourAt(const Vec3d& p) {
  return testing::pattern(2 * p);
}

/// Cameras all around, two metres away, as data sets of objects have them.
Camera around(size_t i, size_t count, uint32_t side) {
  const double height = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
  const double turn = 2.4 * static_cast<double>(i), flat = std::sqrt(1 - height * height);
  const Vec3d back(flat * std::cos(turn), flat * std::sin(turn), height);
  const Vec3d right = Vec3d(-std::sin(turn), std::cos(turn), 0);
  const Vec3d down = Vec3d(-back).cross(right);
  Camera camera;
  camera.width = camera.height = side;
  camera.fx = camera.fy = 1.9 * side;
  camera.cx = camera.cy = 0.5 * side;
  camera.world_to_camera.setIdentity();
  camera.world_to_camera.block<1, 3>(0, 0) = right.transpose();
  camera.world_to_camera.block<1, 3>(1, 0) = down.transpose();
  camera.world_to_camera.block<1, 3>(2, 0) = -back.transpose();
  camera.world_to_camera.block<3, 1>(0, 3) = -camera.world_to_camera.block<3, 3>(0, 0) * (2 * back);
  return camera;
}

/// A ball with a pattern: its surface with colours as features, and views of it.
TrainingObject ball() {
  TrainingObject object;
  object.points.resize(1);
  object.features.resize(1);
  constexpr int kPoints = 600;
  for (int i = 0; i < kPoints; ++i) {
    const double z = 1 - 2 * (i + 0.5) / kPoints, turn = 2.399963229728653 * i;
    const double flat = std::sqrt(1 - z * z);
    const Vec3d p = kRadius * Vec3d(flat * std::cos(turn), flat * std::sin(turn), z);
    const Vec3d colour = colourAt(p);
    for (int axis = 0; axis < 3; ++axis) {
      object.points[0].push_back(static_cast<float>(p[axis] + 0.5));
      object.features[0].push_back(static_cast<float>(colour[axis]));
    }
  }
  object.surface = object.points[0];
  for (size_t view = 0; view < 12; ++view) {
    ObjectView made;
    made.camera = around(view, 12, 32);
    for (uint32_t y = 0; y < 32; ++y) {
      for (uint32_t x = 0; x < 32; ++x) {
        const Vec3d from = placeOf(made.camera);
        const Vec3d along = (unproject(made.camera, x + 0.5, y + 0.5, 1) - from).normalized();
        const double at = testing::crossing(from, along, kRadius);
        const Vec3d colour = at > 0 ? colourAt(from + at * along) : Vec3d(0, 0, 0);
        for (int c = 0; c < 3; ++c) made.image.push_back(static_cast<float>(colour[c]));
        made.alpha.push_back(at > 0 ? 1.0f : 0.0f);
      }
    }
    object.views.push_back(std::move(made));
  }
  return object;
}

AutoencoderSizes smallSizes() {
  AutoencoderSizes sizes;
  sizes.heads = 2;
  sizes.head_width = 16;
  sizes.latent_width = 8;
  sizes.encoder_blocks = sizes.octree_blocks = sizes.splat_blocks = 1;
  sizes.gaussians = 4;
  sizes.leaf_level = 4;
  return sizes;
}

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
  refuses([](TrainingObject& object) { object.views.clear(); });
}

}  // namespace
}  // namespace stipple
