#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/empty_depth.h"
#include "splat/random_scene.h"
#include "splat/render/ray_render.h"

namespace stipple::testing {

constexpr double kPi = std::numbers::pi;
constexpr CameraModel kWide[] = {CameraModel::kEquirectangular, CameraModel::kFisheyeEquidistant,
                                 CameraModel::kFisheyeEquisolid};

inline RenderOptions everything() {
  RenderOptions options;
  options.with_median_depth = true;
  options.with_counts = true;
  options.with_transmittance = true;
  options.with_normal = true;
  options.with_objects = true;
  return options;
}

/// At the origin, along +y of the world.
inline Camera around(CameraModel model, uint32_t side) {
  Camera camera = frontCamera(side, side, side / (2 * kPi), 0);
  camera.model = model;
  if (model == CameraModel::kEquirectangular) camera.fy = side / kPi;
  if (model == CameraModel::kFisheyeEquisolid) camera.fx = camera.fy = side / 4.0;
  return camera;
}

/// Colours of splats here are at most 0.5 + 0.2821 dc.
inline void expectWithinTheHull(const RenderResult& picture, float brightest) {
  // Sums of 1e4 rounded weights.
  constexpr float kRounding = 1e-4f;
  for (size_t i = 0; i < picture.colour.size() / 4; ++i) {
    const float alpha = picture.colour[i * 4 + 3];
    ASSERT_TRUE(alpha >= 0.0f && alpha <= 1.0f) << alpha;
    for (size_t c = 0; c < 3; ++c) {
      const float value = picture.colour[i * 4 + c];
      ASSERT_TRUE(value >= 0.0f && value <= brightest * alpha + kRounding) << value;
    }
  }
  for (const float depth : picture.depth) ASSERT_TRUE(depth > 0.0f && depth <= kEmptyDepth);
  for (const float share : picture.transmittance) ASSERT_TRUE(share >= 0.0f && share <= 1.0f);
  for (size_t i = 0; i < picture.normal.size() / 3; ++i) {
    const float* n = &picture.normal[i * 3];
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    ASSERT_TRUE(length == 0.0f || std::abs(length - 1.0f) < 1e-5f) << length;
  }
}

/// Around the camera, at the poles, at the seam, far behind and far away, equal depths, sizes from
/// needles of 1e6 to what fills all directions.
inline SplatCloud hardCloud() {
  CloudRecipe recipe;
  recipe.count = 60;
  recipe.degree = 2;
  recipe.size_min = 1e-3;
  SplatCloud cloud = randomCloud(recipe, 17);
  const float places[][3] = {{0, 0, 0},      {0, 0, 2},    {0, 0, -2},    {0, -2, 0},
                             {1e-7f, -2, 0}, {0, 1e6f, 0}, {1e-4f, 0, 0}, {0, 0, 1e-3f},
                             {0, 2, 0},      {0, 2, 0},    {2, 0, 0},     {-2, 0, 0},
                             {0, -0.02f, 0}, {0, -1e6f, 0}};
  size_t i = 0;
  for (const auto& place : places) {
    std::copy_n(place, 3, &cloud.positions[i * 3]);
    ++i;
  }
  const float scales[][3] = {{1e3f, 1e-3f, 1e-3f}, {1, 1, 1}, {5, 5, 5},
                             {0.5f, 0.5f, 0},      {0, 0, 0}, {1e5f, 1, 1},
                             {1e-9f, 1e-9f, 1e-9f}};
  i = 0;
  for (const auto& scale : scales) {
    std::copy_n(scale, 3, &cloud.scales[i * 3]);
    i += 2;
  }
  cloud.opacities[0] = cloud.opacities[2] = 1.0f;
  return cloud;
}

inline float brightestOf(const SplatCloud& cloud) {
  float sum = 0, largest = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) {
      sum = 0.5f;
      // The harmonics of degree 2 are at most 1.1 each.
      for (size_t k = c; k < cloud.shStride(); k += 3) {
        sum += 1.1f * std::abs(cloud.sh[i * cloud.shStride() + k]);
      }
      largest = std::max(largest, sum);
    }
  }
  return largest;
}

}  // namespace stipple::testing
