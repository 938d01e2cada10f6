#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/random_scene.h"

// Splats, and parts of surfaces, that hide what is behind them and show nothing: closed forms of
// two splats, then the tiled renderer against the double one.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::oneSplat;
using testing::randomCloud;

constexpr size_t kCentre = 4 * 9 + 4;

RenderOptions everything() {
  RenderOptions options;
  options.with_median_depth = true;
  options.with_counts = true;
  options.with_transmittance = true;
  return options;
}

/// Rounding of float sums, as in tiled_render_test.cpp: 1e-4 is what the renderer promises. Depth
/// is divided by what shows, which may be as little as 1/255 of the 1e-4 that is left: there
/// rounding of 1e-7 counts, and only pixels of which more shows are compared.
void expectEqual(const RenderResult& tiled, const ReferenceResult& reference) {
  ASSERT_EQ(tiled.colour.size(), reference.colour.size());
  for (size_t i = 0; i < tiled.colour.size(); ++i) {
    ASSERT_NEAR(static_cast<double>(tiled.colour[i]), reference.colour[i], 1e-4) << "value " << i;
  }
  for (size_t i = 0; i < tiled.transmittance.size(); ++i) {
    ASSERT_NEAR(static_cast<double>(tiled.transmittance[i]), reference.transmittance[i], 1e-4);
  }
  for (size_t i = 0; i < tiled.depth.size(); ++i) {
    if (reference.colour[i * 4 + 3] < 0.01 && reference.colour[i * 4 + 3] > 0) continue;
    const double relative = (static_cast<double>(tiled.depth[i]) - reference.depth[i]) /
                            std::max(1.0, std::abs(reference.depth[i]));
    ASSERT_NEAR(relative, 0.0, 1e-4) << "depth of pixel " << i;
  }
  EXPECT_EQ(tiled.counts, reference.counts);
}

/// A splat of opacity 1/2 2 metres away, one of 3/4 4 metres away, and a pixel at their centres.
struct TwoSplats {
  SplatCloud near = oneSplat(0.02f, 0.5f), far = oneSplat(0.04f, 0.75f);
  Camera camera = frontCamera(9, 9, 40, 3);
  std::vector<SplatInstance> instances;

  TwoSplats(bool near_holds_out, bool far_holds_out) {
    near.positions[1] = -1;
    far.positions[1] = 1;
    near.sh = {0.5f, 1.0f, -0.5f};
    far.sh = {-1.0f, 0.25f, 1.5f};
    instances = {{&far}, {&near}};
    instances[0].holdout = far_holds_out;
    instances[1].holdout = near_holds_out;
  }

  static double colour(const SplatCloud& cloud, size_t c) {
    return 0.5 + static_cast<double>(kShC0) * static_cast<double>(cloud.sh[c]);
  }
};

TEST(Holdout, HidesWhatIsBehindAndLeavesAHole) {
  const TwoSplats scene(true, false);
  const ReferenceResult picture = renderReference(scene.instances, scene.camera, everything());
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(picture.colour[kCentre * 4 + c], 0.375 * TwoSplats::colour(scene.far, c), 1e-12);
  }
  EXPECT_NEAR(picture.colour[kCentre * 4 + 3], 0.375, 1e-12);
  EXPECT_NEAR(picture.depth[kCentre], 4.0, 1e-12);
  EXPECT_NEAR(picture.transmittance[kCentre], 0.125, 1e-12);
  expectEqual(renderTiled(scene.instances, scene.camera, everything()), picture);
}

TEST(Holdout, BehindASplatChangesOnlyWhatItIsSeenThrough) {
  const TwoSplats scene(false, true);
  const RenderResult picture = renderTiled(scene.instances, scene.camera, everything());
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(picture.colour[kCentre * 4 + c], 0.5 * TwoSplats::colour(scene.near, c), 1e-6);
  }
  EXPECT_NEAR(picture.colour[kCentre * 4 + 3], 0.5, 1e-6);
  EXPECT_NEAR(picture.depth[kCentre], 2.0, 1e-6);
}

TEST(Holdout, AloneLeavesNothingAtAll) {
  const TwoSplats scene(true, true);
  const RenderResult picture = renderTiled(scene.instances, scene.camera, everything());
  for (const float value : picture.colour) EXPECT_EQ(value, 0.0f);
  for (const float value : picture.depth) EXPECT_EQ(value, kEmptyDepth);
  EXPECT_NEAR(picture.transmittance[kCentre], 0.125, 1e-6);
}

TEST(Holdout, LeavesAHoleInTheBackground) {
  const TwoSplats scene(true, false);
  RenderOptions options = everything();
  options.with_background = true;
  options.background[1] = 0.75;
  const RenderResult picture = renderTiled(scene.instances, scene.camera, options);
  EXPECT_NEAR(picture.colour[kCentre * 4 + 1],
              0.375 * TwoSplats::colour(scene.far, 1) + 0.125 * 0.75, 1e-6);
  EXPECT_NEAR(picture.colour[kCentre * 4 + 3], 0.5, 1e-6);
  EXPECT_EQ(picture.colour[3], 1.0f);
  expectEqual(picture, renderReference(scene.instances, scene.camera, options));
}

TEST(Holdout, PixelsThatItDoesNotTouchKeepEveryBit) {
  CloudRecipe recipe;
  recipe.count = 800;
  const SplatCloud cloud = randomCloud(recipe, 31);
  SplatCloud small = oneSplat(0.05f, 0.9f);
  small.positions = {0.6f, -1.5f, 0.6f};
  std::vector<SplatInstance> instances = {{&cloud}};
  const Camera camera = frontCamera(61, 45, 40, 3.0);
  const RenderResult plain = renderTiled(instances, camera, everything());
  instances.push_back({&small});
  instances.back().holdout = true;
  const RenderResult picture = renderTiled(instances, camera, everything());
  size_t touched = 0;
  for (size_t i = 0; i < plain.depth.size(); ++i) {
    if (picture.counts[i] != plain.counts[i] ||
        picture.transmittance[i] != plain.transmittance[i]) {
      ++touched;
      continue;
    }
    for (size_t c = 0; c < 4; ++c) EXPECT_EQ(picture.colour[i * 4 + c], plain.colour[i * 4 + c]);
    EXPECT_EQ(picture.depth[i], plain.depth[i]);
  }
  EXPECT_GT(touched, 4u);
  EXPECT_LT(touched, 400u);
}

/// Depths that cut the cloud in the middle, with colours and what they hide beyond those.
struct Wall {
  std::vector<float> depth, colour, opacity;

  explicit Wall(const Camera& camera) {
    for (uint32_t i = 0; i < camera.width * camera.height; ++i) {
      const float alpha = static_cast<float>(i % 5) / 8.0f;
      depth.push_back(i % 7 == 0 ? kEmptyDepth : 2.5f + 0.1f * static_cast<float>(i % 11));
      colour.insert(colour.end(), {0.5f * alpha, 0.25f * alpha, alpha, alpha});
      opacity.push_back(i % 3 == 0 ? 1.0f : alpha + 0.25f);
    }
  }
};

TEST(Holdout, MatchesTheReferenceAmongSplatsAndSurfaces) {
  for (const uint32_t seed : {41u, 42u}) {
    CloudRecipe recipe;
    recipe.count = 1500;
    recipe.opacity_min = seed == 41u ? 0.02 : 0.9;
    const SplatCloud shown = randomCloud(recipe, seed), hidden = randomCloud(recipe, seed + 50);
    std::vector<SplatInstance> instances = {{&shown}, {&hidden}};
    instances[1].holdout = true;
    const Camera camera = frontCamera(61, 45, 55, 3.0);
    const Wall wall(camera);
    for (const bool with_surface : {false, true}) {
      for (const bool with_background : {false, true}) {
        SCOPED_TRACE(::testing::Message()
                     << seed << " surface " << with_surface << " background " << with_background);
        RenderOptions options = everything();
        options.with_background = with_background;
        options.background[1] = 0.5;
        if (with_surface) {
          options.surface = {camera.width, camera.height, wall.depth.data(), wall.colour.data(),
                             wall.opacity.data()};
        }
        const ReferenceResult reference = renderReference(instances, camera, options);
        for (const NamedTileKernel& named : tileKernels()) {
          SCOPED_TRACE(named.target);
          expectEqual(renderTiledWith(named.kernel, instances, camera, options), reference);
        }
        RenderResult one, two;
        withThreads(1, [&] { one = renderTiled(instances, camera, options); });
        withThreads(2, [&] { two = renderTiled(instances, camera, options); });
        EXPECT_EQ(one.colour, two.colour);
        EXPECT_EQ(one.depth, two.depth);
        EXPECT_EQ(one.transmittance, two.transmittance);
      }
    }
  }
}

TEST(Holdout, OfASurfaceIsAHoleInItsPixel) {
  const TwoSplats scene(false, false);
  const size_t count = 81;
  const std::vector<float> depth(count, 3.0f), opacity(count, 0.75f);
  std::vector<float> colour;
  for (size_t i = 0; i < count; ++i) colour.insert(colour.end(), {0.25f, 0.5f, 0.0f, 0.5f});
  RenderOptions options = everything();
  options.surface = {9, 9, depth.data(), colour.data(), opacity.data()};
  const RenderResult picture = renderTiled(scene.instances, scene.camera, options);
  // 1/2 before it; 1/4 its own, 1/8 hidden; 1/8 behind, of which the splat covers 3/4.
  EXPECT_NEAR(picture.colour[kCentre * 4 + 3], 0.5 + 0.25 + 0.125 * 0.75, 1e-6);
  EXPECT_NEAR(picture.colour[kCentre * 4 + 1],
              0.5 * TwoSplats::colour(scene.near, 1) + 0.5 * 0.5 +
                  0.125 * 0.75 * TwoSplats::colour(scene.far, 1),
              1e-6);
  EXPECT_NEAR(picture.depth[kCentre], (0.5 * 2 + 0.25 * 3 + 0.09375 * 4) / 0.84375, 1e-5);
  EXPECT_NEAR(picture.transmittance[kCentre], 0.5 * 0.25 * 0.25, 1e-6);
}

TEST(Holdout, IsRefusedByBackwardPasses) {
  const TwoSplats scene(true, false);
  RenderWorkspace workspace;
  workspace.keepForBackward(true);
  RenderResult result;
  EXPECT_THROW(renderTiled(scene.instances, scene.camera, {}, workspace, result), Error);
}

}  // namespace
}  // namespace stipple
