#pragma once

#include <random>
#include <vector>

#include "splat/random_scene.h"
#include "splat/render/render_backward.h"

namespace stipple::testing {

/// A loss that is linear in the picture, with random weights [H,W,4].
inline std::vector<float> randomWeights(size_t count, uint32_t seed, float low = -1.0f,
                                        float high = 1.0f) {
  std::mt19937 random(seed);
  std::vector<float> weights(count);
  for (float& weight : weights) {
    weight = low + (high - low) * static_cast<float>(random() >> 8) * 0x1.0p-24f;
  }
  return weights;
}

inline size_t pixelCount(const Camera& camera) {
  return static_cast<size_t>(camera.width) * camera.height;
}

/// Sum of weights times the reference picture.
inline double linearLoss(const ReferenceResult& picture, const std::vector<float>& weights) {
  double sum = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    sum += static_cast<double>(weights[i]) * picture.colour[i];
  }
  return sum;
}

/// The same, and weights [H,W] times the expected depth where a pixel has one.
inline double linearLoss(const ReferenceResult& picture, const std::vector<float>& weights,
                         const std::vector<float>& depth_weights) {
  double sum = linearLoss(picture, weights);
  for (size_t i = 0; i < depth_weights.size(); ++i) {
    if (picture.counts[i] > 0) sum += static_cast<double>(depth_weights[i]) * picture.depth[i];
  }
  return sum;
}

/// Few splats of many sizes, in view of `smallCamera`.
inline SplatCloud smallCloud(size_t count, int degree, uint32_t seed) {
  CloudRecipe recipe;
  recipe.count = count;
  recipe.degree = degree;
  recipe.size_min = 0.05;
  recipe.size_max = 0.5;
  recipe.opacity_min = 0.1;
  return randomCloud(recipe, seed);
}

/// Neither square nor a whole number of tiles, with the axis off its middle.
inline Camera smallCamera() {
  Camera camera = frontCamera(27, 21, 20, 3);
  camera.fy = 23;
  camera.cx = 12.5;
  camera.cy = 11.25;
  return camera;
}

}  // namespace stipple::testing
