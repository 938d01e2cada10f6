#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "splat/random_scene.h"
#include "splat/render/ray_render.h"
#include "splat/render/render.h"

// Normal and object passes: closed forms of one and two splats, and the tiled renderer against the
// double reference.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::instanceOf;
using testing::oneSplat;
using testing::randomCloud;

RenderOptions withPasses() {
  RenderOptions options;
  options.with_normal = true;
  options.with_objects = true;
  return options;
}

TEST(Passes, TheNormalIsTheShortestAxisThatTurnsToTheCamera) {
  // A disc in the plane x + y = 0, seen along +y: its normal to the camera is (-1, -1, 0) / sqrt 2.
  SplatCloud cloud = oneSplat(0.5f, 0.9f);
  cloud.scales = {0.2f, 0.01f, 0.2f};
  const float half = std::numbers::pi_v<float> / 8;
  cloud.rotations = {std::cos(half), 0, 0, -std::sin(half)};  // -45 degrees about z
  const SplatInstance instance = instanceOf(cloud);
  for (const bool mirrors : {false, true}) {
    SplatInstance placed = instance;
    if (mirrors) placed.object_to_world(0, 0) = -1;
    const Camera camera = frontCamera(17, 17, 20, 3);
    const RenderResult tiled = renderTiled({&placed, 1}, camera, withPasses());
    const RenderResult rays = renderRays({&placed, 1}, camera, withPasses(), {});
    const size_t i = (8 * 17 + 8) * 3;
    const float side = (mirrors ? 1.0f : -1.0f) * std::sqrt(0.5f);
    for (const RenderResult* picture : {&tiled, &rays}) {
      EXPECT_NEAR(picture->normal[i], side, 1e-6f);
      EXPECT_NEAR(picture->normal[i + 1], -std::sqrt(0.5f), 1e-6f);
      EXPECT_NEAR(picture->normal[i + 2], 0, 1e-6f);
      EXPECT_EQ(picture->objects[8 * 17 + 8], 1u);
      EXPECT_EQ(picture->objects[0], 0u);
      EXPECT_EQ(picture->normal[0], 0.0f);
    }
  }
}

TEST(Passes, TheObjectThatWeighsMostIsNamed) {
  const SplatCloud faint = oneSplat(2.0f, 0.3f), opaque = oneSplat(2.0f, 0.9f);
  SplatInstance instances[3] = {instanceOf(faint), instanceOf(faint), instanceOf(opaque)};
  instances[1].object_to_world(1, 3) = 0.5;
  instances[2].object_to_world(1, 3) = 1;
  const Camera camera = frontCamera(9, 9, 20, 8);
  const size_t centre = 4 * 9 + 4;
  // 0.3, 0.21 and 0.441.
  EXPECT_EQ(renderTiled(instances, camera, withPasses()).objects[centre], 3u);
  instances[2].holdout = true;
  EXPECT_EQ(renderTiled(instances, camera, withPasses()).objects[centre], 1u);
  EXPECT_EQ(renderRays(instances, camera, withPasses(), {}).objects[centre], 1u);
  instances[2].holdout = false;
  // A surface behind the first two takes 0.49 of the light: more than any.
  std::vector<float> depth(81, 8.7f), colour(81 * 4, 1.0f);
  RenderOptions options = withPasses();
  options.surface = {9, 9, depth.data(), colour.data(), nullptr};
  EXPECT_EQ(renderTiled(instances, camera, options).objects[centre], 0u);
  EXPECT_EQ(renderReference(instances, camera, options).objects[centre], 0u);
  // One that is half transparent takes 0.245.
  std::fill(colour.begin(), colour.end(), 0.5f);
  EXPECT_EQ(renderTiled(instances, camera, options).objects[centre], 1u);
  EXPECT_EQ(renderReference(instances, camera, options).objects[centre], 1u);
}

TEST(Passes, TheTiledRendererAgreesWithTheReference) {
  CloudRecipe recipe;
  recipe.count = 300;
  std::vector<SplatCloud> clouds;
  for (uint32_t seed = 0; seed < 5; ++seed) clouds.push_back(randomCloud(recipe, seed));
  std::vector<SplatInstance> instances;
  for (const SplatCloud& cloud : clouds) instances.push_back(instanceOf(cloud));
  instances[1].object_to_world << 1.2, 0.4, 0, 0.1, 0, 0.8, 0.2, 0, 0.1, 0, -1, 0, 0, 0, 0, 1;
  instances[3].holdout = true;
  const Camera camera = frontCamera(90, 70, 60, 3);
  const RenderResult tiled = renderTiled(instances, camera, withPasses());
  const ReferenceResult exact = renderReference(instances, camera, withPasses());
  size_t other_objects = 0, shown = 0;
  for (size_t i = 0; i < exact.objects.size(); ++i) {
    other_objects += tiled.objects[i] != exact.objects[i];
    shown += exact.objects[i] != 0;
    for (size_t k = 0; k < 3; ++k) {
      // A sum of normals that almost cancel is divided by its little length: 100 roundings.
      ASSERT_NEAR(static_cast<double>(tiled.normal[i * 3 + k]), exact.normal[i * 3 + k], 1e-3);
    }
  }
  EXPECT_GT(shown, 3000u);
  // Only where two weigh the same to single precision.
  EXPECT_LE(other_objects, 2u);
}

TEST(Passes, ChangeNothingElse) {
  const SplatCloud cloud = randomCloud({}, 4);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(90, 70, 60, 3);
  const RenderResult with = renderTiled({&instance, 1}, camera, withPasses());
  const RenderResult without = renderTiled({&instance, 1}, camera, {});
  EXPECT_EQ(with.colour, without.colour);
  EXPECT_EQ(with.depth, without.depth);
  EXPECT_TRUE(without.normal.empty());
  EXPECT_TRUE(without.objects.empty());
  RenderResult one;
  withThreads(1, [&] { one = renderTiled({&instance, 1}, camera, withPasses()); });
  EXPECT_EQ(one.normal, with.normal);
  EXPECT_EQ(one.objects, with.objects);
}

}  // namespace
}  // namespace stipple
