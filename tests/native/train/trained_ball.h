#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "base/random.h"
#include "train/networks/density_autoencoder.h"
#include "train/sphere_views.h"

// A ball with a pattern for networks to learn, and networks that are small enough for it.

namespace stipple {

constexpr double kRadius = 0.35;

inline Vec3d colourAt(const Vec3d& p) {
  return testing::pattern(2 * p);
}

/// Cameras all around, two metres away, as data sets of objects have them.
inline Camera around(size_t i, size_t count, uint32_t side) {
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

/// A ball with a pattern: its surface with colours as features, and views of it. In: side of their
/// images, pixels.
inline TrainingObject ball(uint32_t side = 32) {
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
  std::vector<ObjectView> views;
  for (size_t view = 0; view < 12; ++view) {
    ObjectView made;
    made.camera = around(view, 12, side);
    for (uint32_t y = 0; y < side; ++y) {
      for (uint32_t x = 0; x < side; ++x) {
        const Vec3d from = placeOf(made.camera);
        const Vec3d along = (unproject(made.camera, x + 0.5, y + 0.5, 1) - from).normalized();
        const double at = testing::crossing(from, along, kRadius);
        const Vec3d colour = at > 0 ? colourAt(from + at * along) : Vec3d(0, 0, 0);
        for (int c = 0; c < 3; ++c) made.image.push_back(static_cast<float>(colour[c]));
        made.alpha.push_back(at > 0 ? 1.0f : 0.0f);
      }
    }
    views.push_back(std::move(made));
  }
  object.views = std::make_shared<const KeptViews>(std::move(views));
  return object;
}

inline AutoencoderSizes smallSizes() {
  AutoencoderSizes sizes;
  sizes.heads = 2;
  sizes.head_width = 16;
  sizes.latent_width = 8;
  sizes.encoder_blocks = sizes.octree_blocks = sizes.splat_blocks = 1;
  sizes.gaussians = 4;
  sizes.leaf_level = 4;
  return sizes;
}

/// Weights whose splats differ with the latent from the first step on, in an even density: what
/// begins with 0 in the last layer of splats is drawn.
inline std::vector<float> speakingValues(const DensityAutoencoder& networks) {
  std::vector<float> values = networks.startValues(1);
  const Parameter& last = networks.layout().find("gs.out_proj.weight");
  for (size_t i = 0; i < last.count; ++i) {
    const double u = unitDouble(keyedBits(9, RandomUse::kTokenNoise, i));
    values[last.first + i] = static_cast<float>(2 * (u - 0.5));
  }
  return values;
}

}  // namespace stipple
