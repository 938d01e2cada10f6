#include <gtest/gtest.h>

#include "base/error.h"
#include "effect_cases.h"
#include "shot/sampled_render.h"

// Cameras, lenses, shutters and passes on hard cases, with traps on: nothing is NaN, alpha stays
// within 0..1 and colours within the hull of those of the splats, 0 among them.

namespace stipple {
namespace {

using namespace testing;

TEST(EffectsStability, WideCamerasSeeHardSplatsAtPolesSeamAndAllAround) {
  const SplatCloud cloud = hardCloud();
  SplatInstance instance;
  instance.cloud = &cloud;
  for (const CameraModel model : kWide) {
    for (const uint32_t side : {1u, 2u, 33u, 64u}) {
      for (const RayOptions& rays : {RayOptions{}, unlimitedRays()}) {
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
          EXPECT_THROW(validate(sampling, {&instance, 1}), Error);
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

TEST(EffectsStability, SplatsThatChangeIntoAnythingAreSplatsOnTheWay) {
  const SplatCloud hard = hardCloud();
  std::vector<SplatCloud> others(6, hard);
  for (float& value : others[0].rotations) value = -value;
  std::fill(others[1].scales.begin(), others[1].scales.end(), 0.0f);
  std::fill(others[2].opacities.begin(), others[2].opacities.end(), 0.0f);
  for (float& value : others[3].positions) value = value < 0 ? 3e38f : -3e38f;
  for (float& value : others[4].rotations) value *= 1e-30f;
  for (size_t i = 0; i + 3 < others[5].rotations.size(); i += 4) {
    float* q = &others[5].rotations[i];  // half a turn about x, from anything
    const float turned[4] = {-q[1], q[0], q[3], -q[2]};
    std::copy_n(turned, 4, q);
  }
  const Camera camera = frontCamera(17, 17, 20, 2);
  for (const SplatCloud& other : others) {
    for (const SplatCloud& first : {hard, other}) {
      SplatInstance instance;
      instance.cloud = &hard;
      Sampling sampling;
      sampling.shutter.step_count = 3;
      sampling.shutter.clouds = {std::make_shared<const SplatCloud>(first), nullptr,
                                 std::make_shared<const SplatCloud>(other)};
      sampling.samples = 5;
      RenderResult result;
      renderSampled(
          {&instance, 1}, camera, everything(), sampling,
          [](std::span<const SplatInstance> instances, const Camera& at,
             const RenderOptions& options, RenderResult& out, Progress* progress) {
            validate(*instances[0].cloud, "between");
            out = renderTiled(instances, at, options, progress);
          },
          result);
      expectWithinTheHull(result, brightestOf(hard));
      const uint32_t samples = automaticSamples({&instance, 1}, camera, sampling);
      EXPECT_GE(samples, 16u);
      EXPECT_LE(samples, 256u);
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
    expectWithinTheHull(renderRays({&instance, 1}, camera, everything(), unlimitedRays()), 1.7f);
  }
}

TEST(EffectsStability, HardObjectsAreDrawnApart) {
  const SplatCloud cloud = hardCloud(), empty;
  // Twice at one place, nothing, a million metres away, and as large.
  std::vector<SplatInstance> instances(5, SplatInstance{&cloud});
  instances[2].cloud = &empty;
  instances[3].object_to_world(1, 3) = 1e6;
  instances[4].object_to_world.topLeftCorner<3, 3>() *= 1e6;
  RenderOptions options = everything();
  options.object_order = ObjectOrder::kApart;
  RayOptions rays;
  rays.order = RayOrder::kCentre;
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    Camera camera = frontCamera(33, 33, 20, 2);
    camera.model = model;
    expectWithinTheHull(renderTiled(instances, camera, options), brightestOf(cloud));
    expectWithinTheHull(renderRays(instances, camera, options, rays), brightestOf(cloud));
  }
  expectWithinTheHull(
      renderRays(instances, around(CameraModel::kEquirectangular, 33), options, rays),
      brightestOf(cloud));
}

}  // namespace
}  // namespace stipple
