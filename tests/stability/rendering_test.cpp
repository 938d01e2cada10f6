#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "base/error.h"
#include "splat/cpu/tiles/tile_kernel.h"
#include "splat/random_scene.h"

// Every hard case is rendered by both renderers, with traps on, and the tiled picture is judged by
// the double one at every pixel.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::Difference;
using testing::frontCamera;
using testing::oneSplat;
using testing::randomCloud;
using testing::withScales;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

RenderOptions everything(LowPass low_pass = LowPass::kClassic) {
  RenderOptions options;
  options.low_pass = low_pass;
  options.with_median_depth = true;
  options.with_counts = true;
  return options;
}

/// 1e-4 is what the renderer promises. For depth it is the division by 1 - T that costs
/// digits: 1.5e-5 and more where only splats of alpha near 1/255 cover a pixel.
RenderResult expectSound(const std::vector<SplatInstance>& instances, const Camera& camera,
                         const RenderOptions& options) {
  const RenderResult tiled = renderTiled(instances, camera, options);
  for (const float value : tiled.colour) EXPECT_TRUE(std::isfinite(value));
  const Difference difference =
      testing::compare(tiled, renderReference(instances, camera, options));
  EXPECT_LT(difference.colour, 1e-4);
  EXPECT_LT(difference.depth, 1e-4);
  EXPECT_LT(difference.median_depth, 1e-6);
  EXPECT_EQ(difference.count_mismatches, 0u);
  return tiled;
}

void expectSoundForEveryLowPass(const SplatCloud& cloud, const Camera& camera) {
  for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
    SCOPED_TRACE(::testing::Message() << "low-pass " << static_cast<int>(low_pass));
    const RenderResult picture = expectSound({{&cloud}}, camera, everything(low_pass));
    // An empty picture would show nothing about the case.
    if (low_pass == LowPass::kClassic) {
      EXPECT_GT(picture.visible_count, 0u);
    }
  }
}

TEST(RenderStability, Needles) {
  const Camera camera = frontCamera(83, 61, 60, 3);
  for (const auto& [length, width] :
       {std::pair(1.0f, 1e-6f), std::pair(1000.0f, 1e-3f), std::pair(1e6f, 1.0f)}) {
    expectSoundForEveryLowPass(withScales(200, length, width, width, 1), camera);
    expectSoundForEveryLowPass(withScales(200, length, width, 0, 2), camera);
  }
}

TEST(RenderStability, NearZeroScales) {
  const Camera camera = frontCamera(40, 40, 30, 3);
  for (const float scale : {0.0f, 1e-38f, 1e-20f, 1e-9f, 1e-5f}) {
    expectSoundForEveryLowPass(withScales(300, scale, scale, scale, 3), camera);
  }
  // A point is a blot of the low-pass, and nothing without it.
  const SplatCloud point = withScales(300, 0, 0, 0, 3);
  const SplatInstance instance{&point};
  EXPECT_GT(renderTiled({&instance, 1}, camera, everything()).visible_count, 0u);
  EXPECT_EQ(renderTiled({&instance, 1}, camera, everything(LowPass::kNone)).visible_count, 0u);
  EXPECT_EQ(renderTiled({&instance, 1}, camera, everything(LowPass::kMip)).visible_count, 0u);
}

TEST(RenderStability, HugeScales) {
  const Camera camera = frontCamera(40, 30, 30, 3);
  for (const float scale : {1e3f, 1e9f, 1e30f, 3e38f}) {
    expectSoundForEveryLowPass(withScales(20, scale, scale, scale, 4), camera);
    expectSoundForEveryLowPass(withScales(20, scale, 0.01f, 0.1f, 5), camera);
  }
}

TEST(RenderStability, SubPixelAndScreenFillingTogether) {
  CloudRecipe recipe;
  recipe.count = 1500;
  recipe.size_min = 1e-5;
  recipe.size_max = 50;
  recipe.opacity_max = 0.2;
  expectSoundForEveryLowPass(randomCloud(recipe, 6), frontCamera(70, 50, 60, 3));
}

TEST(RenderStability, AtAndBehindTheNearPlane) {
  CloudRecipe recipe;
  recipe.count = 400;
  recipe.degree = 3;
  recipe.size_max = 2;
  SplatCloud cloud = randomCloud(recipe, 7);
  Camera camera = frontCamera(50, 50, 40, 0);
  camera.near_plane = 0.25;
  // Exactly at the plane, at the camera's centre, just before and just behind both.
  const float depths[] = {
      0.25f,  0.0f,   std::nextafter(0.25f, 0.0f), std::nextafter(0.25f, 1.0f), -0.25f,
      1e-30f, -1e-30f};
  for (size_t i = 0; i < 70; ++i) cloud.positions[i * 3 + 1] = depths[i % 7];
  for (size_t i = 0; i < 7; ++i) cloud.positions[i * 3] = cloud.positions[i * 3 + 2] = 0;
  expectSoundForEveryLowPass(cloud, camera);
  camera.near_plane = 1e-9;
  expectSoundForEveryLowPass(cloud, camera);
}

TEST(RenderStability, AMillionUnitsFromTheOrigin) {
  CloudRecipe recipe;
  recipe.count = 300;
  recipe.degree = 2;
  const SplatCloud cloud = randomCloud(recipe, 8);
  const Camera home = frontCamera(60, 60, 50, 3);
  const RenderResult expected = expectSound({{&cloud}}, home, everything());
  SplatInstance far{&cloud};
  far.object_to_world.topRightCorner<3, 1>() = Vec3d(1e6, -1e6, 1e6);
  Camera there = home;
  const Mat3d turn = home.world_to_camera.topLeftCorner<3, 3>();
  there.world_to_camera.topRightCorner<3, 1>() -= turn * Vec3d(1e6, -1e6, 1e6);
  const RenderResult seen = expectSound({far}, there, everything());
  // The positions are those of an object; doubles at 1e6 are exact to 1e-10 m.
  for (size_t i = 0; i < expected.colour.size(); ++i) {
    EXPECT_NEAR(seen.colour[i], expected.colour[i], 1e-5);
  }
  // Stored at 1e6, positions are only known to 0.06 m, but both renderers see the same.
  SplatCloud baked = cloud;
  for (size_t i = 0; i < cloud.size(); ++i) {
    baked.positions[i * 3] += 1e6f;
    baked.positions[i * 3 + 1] -= 1e6f;
    baked.positions[i * 3 + 2] += 1e6f;
  }
  expectSoundForEveryLowPass(baked, there);
}

TEST(RenderStability, FarToTheSide) {
  SplatCloud cloud = withScales(200, 5, 0.1f, 1, 9);
  for (size_t i = 0; i < cloud.size(); ++i) {
    cloud.positions[i * 3] *= i % 3 == 0 ? 1e30f : i % 3 == 1 ? 1e3f : 10.0f;
    cloud.positions[i * 3 + 1] = -2.9f;
  }
  expectSoundForEveryLowPass(cloud, frontCamera(60, 60, 50, 3));
}

TEST(RenderStability, AlphaTowardsOneAndTransmittanceTowardsZero) {
  for (const float opacity : {0.98f, 0.99f, std::nextafter(0.99f, 1.0f), 1.0f}) {
    CloudRecipe recipe;
    recipe.count = 2000;
    recipe.size_min = 0.05;
    SplatCloud cloud = randomCloud(recipe, 10);
    for (float& o : cloud.opacities) o = opacity;
    expectSoundForEveryLowPass(cloud, frontCamera(48, 48, 40, 3));
  }
}

TEST(RenderStability, TenThousandLayers) {
  for (const float opacity : {1.0f / 255.0f, std::nextafter(1.0f / 255.0f, 1.0f), 0.004f, 0.02f}) {
    SplatCloud cloud = withScales(10000, 2, 2, 2, 11);
    for (float& o : cloud.opacities) o = opacity;
    const RenderResult picture =
        expectSound({{&cloud}}, frontCamera(12, 12, 10, 3), everything(LowPass::kClassic));
    if (opacity > 0.004f) {
      EXPECT_GT(picture.colour[3], 0.99f);
    }
  }
}

TEST(RenderStability, EqualDepthsGoByIndex) {
  CloudRecipe recipe;
  recipe.count = 500;
  SplatCloud cloud = randomCloud(recipe, 12);
  for (size_t i = 0; i < cloud.size(); ++i) cloud.positions[i * 3 + 1] = 0;
  const Camera camera = frontCamera(50, 50, 40, 3);
  expectSound({{&cloud}, {&cloud}}, camera, everything());
  // Depths that only double tells apart tie as well.
  SplatInstance behind{&cloud};
  behind.object_to_world(1, 3) = 1e-12;
  expectSound({behind, {&cloud}}, camera, everything());
}

TEST(RenderStability, TinyAndHugePictures) {
  CloudRecipe recipe;
  const SplatCloud cloud = randomCloud(recipe, 13);
  expectSoundForEveryLowPass(cloud, frontCamera(1, 1, 1, 3));
  expectSoundForEveryLowPass(cloud, frontCamera(1, 1, 1e6, 3));
  expectSoundForEveryLowPass(cloud, frontCamera(65536, 1, 20000, 3));
  expectSoundForEveryLowPass(cloud, frontCamera(1, 2000, 1e-3, 3));
  expectSoundForEveryLowPass(cloud, frontCamera(16, 16, 1e9, 3));
}

TEST(RenderStability, ScaledInstancesFromTinyToHuge) {
  CloudRecipe recipe;
  recipe.degree = 4;
  const SplatCloud cloud = randomCloud(recipe, 14);
  for (const double scale : {1e-12, 1e-3, 1e6, 1e14}) {
    SplatInstance instance{&cloud};
    instance.object_to_world.topLeftCorner<3, 3>() *= scale;
    expectSound({instance}, frontCamera(40, 40, 30, 3), everything());
  }
}

TEST(RenderStability, ExtremeQuaternionsAndColours) {
  CloudRecipe recipe;
  recipe.degree = 1;
  SplatCloud cloud = randomCloud(recipe, 15);
  for (size_t i = 0; i < cloud.size(); ++i) {
    for (size_t c = 0; c < 4; ++c) cloud.rotations[i * 4 + c] *= i % 2 ? 1e-38f : 1e38f;
  }
  expectSoundForEveryLowPass(cloud, frontCamera(40, 40, 30, 3));
  for (float& value : cloud.sh) value *= 1e30f;
  const SplatInstance instance{&cloud};
  RenderOptions options = everything();
  options.blend_space = BlendSpace::kSceneLinear;
  for (const float value :
       renderTiled({&instance, 1}, frontCamera(40, 40, 30, 3), options).colour) {
    EXPECT_TRUE(std::isfinite(value));
  }
}

TEST(RenderStability, EveryKernelKeepsDeadLanesQuiet) {
  // One pixel of the tile is hit; the exponents of the others reach -1e13.
  TileSplat splat{};
  splat.l00 = splat.l11 = 1e5f;
  splat.g0 = splat.g1 = -3e5f;
  splat.l10 = 1e5f;
  splat.g1 -= 3e5f;
  splat.doubt_low = splat.doubt_high = 1e-3f;
  splat.depth = 1;
  splat.row_end = kTileSide;
  for (const NamedTileKernel& named : tileKernels()) {
    SCOPED_TRACE(named.target);
    TilePixels pixels{};
    for (uint32_t i = 0; i < kTilePixelCount; ++i) {
      pixels.transmittance[i] = 1;
      pixels.cut[i] = kLog2MinAlpha;
    }
    pixels.unfinished = kTilePixelCount;
    named.kernel(&splat, 1, {true, true}, pixels);
    EXPECT_NEAR(pixels.transmittance[3 * kTileSide + 3], 0.01f, 1e-6);
    EXPECT_EQ(pixels.transmittance[0], 1.0f);
    EXPECT_EQ(pixels.unfinished, kTilePixelCount);
  }
}

TEST(RenderStability, SurfacesAtSplatsDepthsAtInfinityAndAtTheEnds) {
  CloudRecipe recipe;
  recipe.count = 800;
  const SplatCloud cloud = randomCloud(recipe, 31);
  const Camera camera = frontCamera(40, 30, 30, 3);
  const size_t pixel_count = 40 * 30;
  std::vector<float> depth(pixel_count), colour(pixel_count * 4);
  // Exactly at a splat's depth, one float beside it, at the ends of float, behind everything.
  const float odd[] = {kInfinity, 1e10f, 3e38f, -3e38f, 0.0f, -0.0f, 1e-40f, 1e38f};
  const float alphas[] = {0.0f, 1.0f, 0.5f, 1e-38f, 0.99999994f, 0.9999f, 1e-4f};
  for (size_t i = 0; i < pixel_count; ++i) {
    const float at =
        static_cast<float>(3.0 + static_cast<double>(cloud.positions[i % 800 * 3 + 1]));
    depth[i] = i % 4 == 0   ? odd[i / 4 % std::size(odd)]
               : i % 4 == 1 ? at
                            : std::nextafter(at, i % 4 == 2 ? 0.0f : 9.0f);
    colour[i * 4 + 3] = alphas[i % std::size(alphas)];
    colour[i * 4] = i % 5 == 0 ? -1e30f : i % 3 == 0 ? 1e30f * colour[i * 4 + 3] : 0.25f;
  }
  const SurfaceLayer layers[] = {{40, 30, depth.data(), nullptr, nullptr},
                                 {40, 30, depth.data(), colour.data(), nullptr}};
  for (const SurfaceLayer& layer : layers) {
    RenderOptions options = everything();
    options.surface = layer;
    const SplatInstance instance{&cloud};
    const RenderResult tiled = renderTiled({&instance, 1}, camera, options);
    const ReferenceResult reference = renderReference({&instance, 1}, camera, options);
    for (size_t i = 0; i < pixel_count; ++i) {
      SCOPED_TRACE(::testing::Message() << "pixel " << i);
      EXPECT_EQ(tiled.counts[i], reference.counts[i]);
      for (size_t c = 0; c < 4; ++c) {
        const double expected = reference.colour[i * 4 + c];
        EXPECT_NEAR(static_cast<double>(tiled.colour[i * 4 + c]), expected,
                    1e-4 * std::max(1.0, std::abs(expected)));
      }
      EXPECT_NEAR(static_cast<double>(tiled.depth[i]), reference.depth[i],
                  1e-4 * std::abs(reference.depth[i]) + 1e-30);
    }
    for (const float bad : {kNan, -kInfinity}) {
      std::vector<float> spoilt = depth;
      spoilt[77] = bad;
      options.surface.depth = spoilt.data();
      EXPECT_THROW(renderTiled({&instance, 1}, camera, options), Error);
      EXPECT_THROW(renderReference({&instance, 1}, camera, options), Error);
    }
  }
}

TEST(RenderStability, RefusesWhatIsNotFinite) {
  const Camera camera = frontCamera(8, 8, 8, 3);
  const auto refused = [](const SplatCloud& cloud, const Camera& by) {
    const SplatInstance instance{&cloud};
    EXPECT_THROW(renderTiled({&instance, 1}, by, {}), Error);
    EXPECT_THROW(renderReference({&instance, 1}, by, {}), Error);
  };
  const SplatCloud good = oneSplat(0.1f, 0.5f);
  for (const float bad : {kNan, kInfinity, -kInfinity}) {
    for (std::vector<float> SplatCloud::*array :
         {&SplatCloud::positions, &SplatCloud::rotations, &SplatCloud::scales,
          &SplatCloud::opacities, &SplatCloud::sh}) {
      SplatCloud cloud = good;
      (cloud.*array).back() = bad;
      refused(cloud, camera);
    }
    for (double Camera::*value : {&Camera::fx, &Camera::fy, &Camera::cx, &Camera::cy,
                                  &Camera::near_plane, &Camera::far_plane}) {
      Camera broken = camera;
      broken.*value = static_cast<double>(bad);
      refused(good, broken);
    }
    Camera broken = camera;
    broken.world_to_camera(1, 3) = static_cast<double>(bad);
    refused(good, broken);
    SplatInstance placed{&good};
    placed.object_to_world(2, 1) = static_cast<double>(bad);
    EXPECT_THROW(renderTiled({&placed, 1}, camera, {}), Error);
  }
  SplatCloud zero = good;
  zero.rotations = {0, 0, 0, 0};
  refused(zero, camera);
  Camera tiny_near = camera;
  tiny_near.near_plane = 1e-300;
  refused(good, tiny_near);
}

}  // namespace
}  // namespace stipple
