#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "math/camera.h"
#include "splat/render/render.h"

namespace stipple::testing {

struct CloudRecipe {
  size_t count = 400;
  int degree = 0;
  double size_min = 0.005;  ///< metres; log-uniform
  double size_max = 0.3;
  double opacity_min = 0.02;
  double opacity_max = 1.0;
  Antialias antialias = Antialias::kClassic;
  ColourSpace colour_space = ColourSpace::kDisplay;
};

/// A cloud in the cube -1..1 whose colours stay about 0..1.
inline SplatCloud randomCloud(const CloudRecipe& recipe, uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  SplatCloud cloud;
  cloud.sh_degree = recipe.degree;
  cloud.antialias = recipe.antialias;
  cloud.colour_space = recipe.colour_space;
  cloud.resize(recipe.count);
  for (float& value : cloud.positions) value = static_cast<float>(uniform(-1, 1));
  for (float& value : cloud.rotations) value = static_cast<float>(uniform(-1, 1));
  for (float& value : cloud.scales) {
    value =
        static_cast<float>(std::exp(uniform(std::log(recipe.size_min), std::log(recipe.size_max))));
  }
  for (float& value : cloud.opacities) {
    value = static_cast<float>(uniform(recipe.opacity_min, recipe.opacity_max));
  }
  const size_t stride = cloud.shStride();
  for (size_t i = 0; i < cloud.sh.size(); ++i) {
    cloud.sh[i] = static_cast<float>(i % stride < 3 ? uniform(-1.7, 1.7) : uniform(-0.15, 0.15));
  }
  return cloud;
}

/// The same cloud with scales of a, b, c metres.
inline SplatCloud withScales(size_t count, float a, float b, float c, uint32_t seed) {
  CloudRecipe recipe;
  recipe.count = count;
  SplatCloud cloud = randomCloud(recipe, seed);
  for (size_t i = 0; i < count; ++i) {
    cloud.scales[i * 3] = a;
    cloud.scales[i * 3 + 1] = b;
    cloud.scales[i * 3 + 2] = c;
  }
  return cloud;
}

/// Looks along +y of the world at the origin from `distance` metres: camera x = world x, y = -z.
inline Camera frontCamera(uint32_t width, uint32_t height, double focal, double distance) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = focal;
  camera.fy = focal;
  camera.cx = width / 2.0;
  camera.cy = height / 2.0;
  camera.world_to_camera << 1, 0, 0, 0,  //
      0, 0, -1, 0,                       //
      0, 1, 0, distance,                 //
      0, 0, 0, 1;
  return camera;
}

/// One splat at the origin.
inline SplatCloud oneSplat(float scale, float opacity, float dc = 1.0f) {
  SplatCloud cloud;
  cloud.resize(1);
  cloud.positions = {0, 0, 0};
  cloud.rotations = {1, 0, 0, 0};
  cloud.scales = {scale, scale, scale};
  cloud.opacities = {opacity};
  cloud.sh = {dc, dc, dc};
  return cloud;
}

/// Where the cloud stands.
inline SplatInstance instanceOf(const SplatCloud& cloud) {
  SplatInstance instance;
  instance.cloud = &cloud;
  return instance;
}

/// Options for every buffer that a picture has.
inline RenderOptions everyBuffer(LowPass low_pass = LowPass::kNone) {
  RenderOptions options;
  options.low_pass = low_pass;
  options.with_median_depth = true;
  options.with_counts = true;
  options.with_transmittance = true;
  return options;
}

struct Difference {
  double colour = 0;        ///< largest, alpha included
  double depth = 0;         ///< largest relative
  double median_depth = 0;  ///< largest relative
  size_t count_mismatches = 0;
};

inline Difference compare(const RenderResult& tiled, const ReferenceResult& reference) {
  Difference d;
  for (size_t i = 0; i < reference.colour.size(); ++i) {
    d.colour =
        std::max(d.colour, std::abs(static_cast<double>(tiled.colour[i]) - reference.colour[i]));
  }
  const auto relative = [](const std::vector<float>& a, const std::vector<double>& b) {
    double largest = 0;
    for (size_t i = 0; i < b.size(); ++i) {
      largest = std::max(largest, std::abs(static_cast<double>(a[i]) - b[i]) / std::abs(b[i]));
    }
    return largest;
  };
  d.depth = relative(tiled.depth, reference.depth);
  d.median_depth = relative(tiled.median_depth, reference.median_depth);
  for (size_t i = 0; i < reference.counts.size(); ++i) {
    d.count_mismatches += tiled.counts[i] != reference.counts[i];
  }
  return d;
}

}  // namespace stipple::testing
