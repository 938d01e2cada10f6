#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "splat/random_scene.h"
#include "splat/ray_render.h"
#include "splat/sampled_render.h"

// Cameras, lenses, shutters and passes on hard cases, with traps on: nothing is NaN, alpha stays
// within 0..1 and colours within the hull of those of the splats, 0 among them.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::oneSplat;
using testing::randomCloud;

constexpr double kPi = std::numbers::pi;
constexpr CameraModel kWide[] = {CameraModel::kEquirectangular, CameraModel::kFisheyeEquidistant,
                                 CameraModel::kFisheyeEquisolid};

RenderOptions everything() {
  RenderOptions options;
  options.with_median_depth = true;
  options.with_counts = true;
  options.with_transmittance = true;
  options.with_normal = true;
  options.with_objects = true;
  return options;
}

Camera around(CameraModel model, uint32_t side) {
  Camera camera = frontCamera(side, side, side / (2 * kPi), 0);
  camera.model = model;
  if (model == CameraModel::kEquirectangular) camera.fy = side / kPi;
  if (model == CameraModel::kFisheyeEquisolid) camera.fx = camera.fy = side / 4.0;
  return camera;
}

/// Colours of splats here are at most 0.5 + 0.2821 dc.
void expectWithinTheHull(const RenderResult& picture, float brightest) {
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
SplatCloud hardCloud() {
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

float brightestOf(const SplatCloud& cloud) {
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

TEST(EffectsStability, WideCamerasSeeHardSplatsAtPolesSeamAndAllAround) {
  const SplatCloud cloud = hardCloud();
  SplatInstance instance;
  instance.cloud = &cloud;
  for (const CameraModel model : kWide) {
    for (const uint32_t side : {1u, 2u, 33u, 64u}) {
      for (const RayOptions& rays : {RayOptions{}, rayYardstick()}) {
        for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
          RenderOptions options = everything();
          options.low_pass = low_pass;
          const RenderResult picture =
              renderRays({&instance, 1}, around(model, side), options, rays);
          EXPECT_GT(picture.visible_count, 0u);
          expectWithinTheHull(picture, brightestOf(cloud));
        }
      }
    }
    // A field of view of nothing, and of all.
    Camera camera = around(model, 9);
    if (model == CameraModel::kEquirectangular) continue;
    camera.field_of_view = 1e-300;
    expectWithinTheHull(renderRays({&instance, 1}, camera, everything(), {}), brightestOf(cloud));
    camera.field_of_view = 2 * kPi;
    expectWithinTheHull(renderRays({&instance, 1}, camera, everything(), {}), brightestOf(cloud));
  }
}

TEST(EffectsStability, PassesOfHardSplatsAreUnitOrNothing) {
  const SplatCloud cloud = hardCloud();
  SplatInstance instance;
  instance.cloud = &cloud;
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    Camera camera = frontCamera(33, 33, 20, 2);
    camera.model = model;
    expectWithinTheHull(renderTiled({&instance, 1}, camera, everything()), brightestOf(cloud));
    expectWithinTheHull(renderRays({&instance, 1}, camera, everything(), {}), brightestOf(cloud));
  }
}

TEST(EffectsStability, LensesOfNothingAndOfAKilometre) {
  const SplatCloud cloud = hardCloud();
  SplatInstance instance;
  instance.cloud = &cloud;
  const DrawMoment tiled = [](std::span<const SplatInstance> instances, const Camera& camera,
                              const RenderOptions& options, RenderResult& result,
                              Progress* progress) {
    result = renderTiled(instances, camera, options, progress);
  };
  const DrawMoment rays = [](std::span<const SplatInstance> instances, const Camera& camera,
                             const RenderOptions& options, RenderResult& result,
                             Progress* progress) {
    result = renderRays(instances, camera, options, {}, progress);
  };
  for (const double radius : {0.0, 1e-300, 0.3, 1e3, 1e6}) {
    for (const double focus : {1e-6, 2.0, 1e15}) {
      for (const uint32_t blades : {0u, 3u}) {
        Sampling sampling;
        sampling.aperture = {radius, focus, blades, 1.0, 1e-3};
        sampling.samples = 3;
        if (radius > 1e6 * focus) {
          EXPECT_THROW(validate(sampling, 1), Error);
          continue;
        }
        RenderResult result;
        for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
          Camera camera = frontCamera(17, 17, 20, 2);
          camera.model = model;
          renderSampled({&instance, 1}, camera, everything(), sampling, tiled, result);
          expectWithinTheHull(result, brightestOf(cloud));
        }
        for (const CameraModel model : kWide) {
          renderSampled({&instance, 1}, around(model, 9), everything(), sampling, rays, result);
          expectWithinTheHull(result, brightestOf(cloud));
        }
        sampling.samples = 0;
        const uint32_t samples =
            automaticSamples({&instance, 1}, frontCamera(17, 17, 20, 2), sampling);
        EXPECT_GE(samples, 16u);
        EXPECT_LE(samples, 256u);
      }
    }
  }
}

TEST(EffectsStability, ShuttersOfNoTimeAndOfFarJumps) {
  const SplatCloud cloud = hardCloud();
  SplatInstance instance;
  instance.cloud = &cloud;
  Mat4d far = Mat4d::Identity(), turned = Mat4d::Identity(), small = Mat4d::Identity();
  far(0, 3) = 1e6;
  turned(0, 0) = turned(1, 1) = -1;  // half a turn: every way is as short
  small.topLeftCorner<3, 3>() *= 1e-5;
  const Camera camera = frontCamera(17, 17, 20, 2);
  for (const Mat4d& last : {Mat4d(Mat4d::Identity()), far, turned, small}) {
    for (const std::vector<double>& curve :
         {std::vector<double>{}, {0.0, 1.0}, {0.0, 0.0, 1.0, 0.0}, {1e-300, 1e-300}}) {
      Sampling sampling;
      sampling.shutter.step_count = 2;
      sampling.shutter.instances = {Mat4d::Identity(), last};
      sampling.shutter.camera = {camera.world_to_camera, camera.world_to_camera};
      sampling.shutter.curve = curve;
      sampling.samples = 5;
      RenderResult result;
      renderSampled(
          {&instance, 1}, camera, everything(), sampling,
          [](std::span<const SplatInstance> instances, const Camera& at,
             const RenderOptions& options, RenderResult& out,
             Progress* progress) { out = renderTiled(instances, at, options, progress); },
          result);
      expectWithinTheHull(result, brightestOf(cloud));
    }
  }
}

TEST(EffectsStability, EqualDepthsAndTenThousandLayersAreAveragedSoundly) {
  SplatCloud cloud = oneSplat(1.0f, 0.9f);
  cloud.resize(10000);
  for (size_t i = 0; i < 10000; ++i) {
    cloud.rotations[i * 4] = 1;
    std::fill_n(&cloud.scales[i * 3], 3, 0.5f);
    cloud.opacities[i] = i % 2 == 0 ? 1.0f : 0.01f;
    std::fill_n(&cloud.sh[i * 3], 3, 1.0f);
  }
  SplatInstance instance;
  instance.cloud = &cloud;
  for (const CameraModel model : kWide) {
    Camera camera = around(model, 5);
    camera.world_to_camera(2, 3) = 2;
    expectWithinTheHull(renderRays({&instance, 1}, camera, everything(), rayYardstick()), 1.7f);
  }
}

}  // namespace
}  // namespace stipple
