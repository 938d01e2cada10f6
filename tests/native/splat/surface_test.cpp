#include "splat/render/surface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/random_scene.h"

// A surface among the splats: closed forms of one splat before and one behind it, then the tiled
// renderer against the double one in scenes where surfaces cut through thousands of splats.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::Difference;
using testing::frontCamera;
using ::testing::HasSubstr;
using testing::oneSplat;
using testing::randomCloud;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Arrays of a layer.
struct Surface {
  uint32_t width, height;
  std::vector<float> depth;
  std::vector<float> colour;

  Surface(const Camera& camera, float z, const std::array<float, 4>& rgba)
      : width(camera.width), height(camera.height), depth(width * height, z) {
    for (size_t i = 0; i < depth.size(); ++i) colour.insert(colour.end(), rgba.begin(), rgba.end());
  }

  SurfaceLayer layer() const { return {width, height, depth.data(), colour.data(), nullptr}; }
  SurfaceLayer matte() const { return {width, height, depth.data(), nullptr, nullptr}; }
};

/// Depths that cut a cloud in the middle; opacities 0, a part, 1; some pixels with nothing.
Surface randomSurface(const Camera& camera, uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&] { return static_cast<float>(random() >> 8) * 0x1.0p-24f; };
  Surface surface(camera, 0, {0, 0, 0, 0});
  for (size_t i = 0; i < surface.depth.size(); ++i) {
    const uint32_t kind = random() % 8;
    surface.depth[i] = kind == 0 ? kEmptyDepth : kind == 1 ? kInfinity : 2.0f + 2.0f * uniform();
    const float alpha = kind < 3 ? 0.0f : kind < 5 ? 1.0f : uniform();
    surface.colour[i * 4 + 3] = alpha;
    for (size_t c = 0; c < 3; ++c) surface.colour[i * 4 + c] = alpha * uniform();
  }
  return surface;
}

RenderOptions everything(const SurfaceLayer& surface) {
  RenderOptions options;
  options.with_median_depth = true;
  options.with_counts = true;
  options.surface = surface;
  return options;
}

/// Rounding of the float sums, as in tiled_render_test.cpp: 1e-4 is what the renderer promises. The
/// coverage that depth is divided by may be as little as 1/255 of what is left before a surface.
void expectEqual(const RenderResult& tiled, const ReferenceResult& reference) {
  const Difference difference = testing::compare(tiled, reference);
  EXPECT_LT(difference.colour, 1e-4);
  EXPECT_LT(difference.depth, 1e-4);
  EXPECT_LT(difference.median_depth, 1e-4);
  EXPECT_EQ(difference.count_mismatches, 0u);
}

/// Two splats on the optical axis, 2 and 4 metres away, and a pixel at their centres.
struct TwoSplats {
  SplatCloud near = oneSplat(0.02f, 0.5f), far = oneSplat(0.04f, 0.75f);
  Camera camera = frontCamera(9, 9, 40, 3);
  std::vector<SplatInstance> instances;

  TwoSplats() {
    near.positions[1] = -1;
    far.positions[1] = 1;
    near.sh = {0.5f, 1.0f, -0.5f};
    far.sh = {-1.0f, 0.25f, 1.5f};
    instances = {{&far}, {&near}};
  }

  double colour(const SplatCloud& cloud, size_t c) const {
    return 0.5 + static_cast<double>(kShC0) * static_cast<double>(cloud.sh[c]);
  }
};

constexpr size_t kCentre = 4 * 9 + 4;

TEST(Surface, HalfTransparentStandsBetweenTwoSplats) {
  const TwoSplats scene;
  const Surface surface(scene.camera, 3.0f, {0.125f, 0.25f, 0.375f, 0.5f});
  const RenderOptions options = everything(surface.layer());
  const ReferenceResult picture = renderReference(scene.instances, scene.camera, options);
  for (size_t c = 0; c < 3; ++c) {
    const double own = static_cast<double>(surface.colour[c]);
    const double expected = 0.5 * scene.colour(scene.near, c) + 0.5 * own +
                            0.5 * 0.5 * 0.75 * scene.colour(scene.far, c);
    EXPECT_NEAR(picture.colour[kCentre * 4 + c], expected, 1e-12);
  }
  EXPECT_NEAR(picture.colour[kCentre * 4 + 3], 1.0 - 0.5 * 0.5 * 0.25, 1e-12);
  // Weights 1/2 at 2 m, 1/4 at 3 m, 3/16 at 4 m.
  EXPECT_NEAR(picture.depth[kCentre], (0.5 * 2 + 0.25 * 3 + 0.1875 * 4) / 0.9375, 1e-12);
  // 1/2 is passed by the surface: the splat before it leaves exactly 1/2.
  EXPECT_EQ(picture.median_depth[kCentre], 3.0);
  EXPECT_EQ(picture.counts[kCentre], 2u);
  expectEqual(renderTiled(scene.instances, scene.camera, options), picture);
}

TEST(Surface, OpaqueEndsThePixel) {
  const TwoSplats scene;
  const Surface surface(scene.camera, 3.0f, {0.25f, 0.5f, 2.0f, 1.0f});
  const RenderResult picture =
      renderTiled(scene.instances, scene.camera, everything(surface.layer()));
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(picture.colour[kCentre * 4 + c],
                0.5 * scene.colour(scene.near, c) + 0.5 * static_cast<double>(surface.colour[c]),
                1e-6);
  }
  EXPECT_EQ(picture.colour[kCentre * 4 + 3], 1.0f);
  EXPECT_FLOAT_EQ(picture.depth[kCentre], 2.5f);
  EXPECT_EQ(picture.counts[kCentre], 1u);
}

TEST(Surface, MatteHidesWhatIsBehindAndLeavesAHole) {
  const TwoSplats scene;
  const Surface surface(scene.camera, 3.0f, {});
  RenderOptions options = everything(surface.matte());
  const RenderResult picture = renderTiled(scene.instances, scene.camera, options);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(picture.colour[kCentre * 4 + c], 0.5 * scene.colour(scene.near, c), 1e-6);
  }
  EXPECT_EQ(picture.colour[kCentre * 4 + 3], 0.5f);
  EXPECT_FLOAT_EQ(picture.depth[kCentre], 2.0f);
  // Away from the splats there is nothing, and the background has a hole too.
  options.with_background = true;
  options.background[0] = 1.0;
  const RenderResult over = renderTiled(scene.instances, scene.camera, options);
  EXPECT_EQ(over.colour[0], 0.0f);
  EXPECT_EQ(over.colour[3], 0.0f);
  EXPECT_EQ(over.depth[0], kEmptyDepth);
  EXPECT_EQ(over.colour[kCentre * 4 + 3], 0.5f);
}

TEST(Surface, MatteThatCoversAPartLetsTheRestThrough) {
  const TwoSplats scene;
  const Surface surface(scene.camera, 3.0f, {});
  const std::vector<float> opacity(surface.depth.size(), 0.25f);
  RenderOptions options = everything(surface.matte());
  options.surface.matte_opacity = opacity.data();
  const RenderResult picture = renderTiled(scene.instances, scene.camera, options);
  // 1/2 in front; behind, 3/4 of the other half, of which the splat covers 3/4.
  EXPECT_NEAR(picture.colour[kCentre * 4 + 3], 0.5 + 0.5 * 0.75 * 0.75, 1e-6);
  EXPECT_NEAR(picture.depth[kCentre], (0.5 * 2 + 0.28125 * 4) / 0.78125, 1e-5);
  expectEqual(picture, renderReference(scene.instances, scene.camera, options));
  options.with_background = true;
  const RenderResult over = renderTiled(scene.instances, scene.camera, options);
  EXPECT_NEAR(over.colour[kCentre * 4 + 3], 1.0 - 0.5 * 0.25, 1e-6);
  EXPECT_EQ(over.colour[3], 0.75f);
}

TEST(Surface, PixelsWithoutSplatsKeepEveryBit) {
  const TwoSplats scene;
  Camera aside = scene.camera;
  aside.cx = -500;  // nothing of the splats is in the picture
  const Surface surface = randomSurface(aside, 3);
  const RenderResult picture = renderTiled(scene.instances, aside, everything(surface.layer()));
  EXPECT_EQ(picture.colour, surface.colour);
  for (size_t i = 0; i < surface.depth.size(); ++i) {
    EXPECT_EQ(picture.depth[i], surface.depth[i] < kEmptyDepth ? surface.depth[i] : kEmptyDepth);
  }
}

TEST(Surface, IsNotLeftOutWhereSplatsEndThePixel) {
  // Three of 0.99 would leave 1e-6: the third is left out and ends the pixel at 1e-4 or more.
  SplatCloud wall = oneSplat(0.5f, 1.0f);
  const SplatInstance instances[] = {{&wall}, {&wall}, {&wall}};
  const Camera camera = frontCamera(9, 9, 40, 3);
  const Surface surface(camera, 5.0f, {1.0f, 1.0f, 1.0f, 1.0f});
  const RenderResult picture = renderTiled(instances, camera, everything(surface.layer()));
  EXPECT_LT(picture.counts[kCentre], 3u);
  EXPECT_EQ(picture.colour[kCentre * 4 + 3], 1.0f);
}

TEST(Surface, AtASplatsOwnDepthComesAfterIt) {
  SplatCloud splat = oneSplat(0.2f, 0.5f);
  const SplatInstance instance{&splat};
  const Camera camera = frontCamera(9, 9, 40, 3);
  const auto alphaAt = [&](float depth) {
    const Surface surface(camera, depth, {});
    return renderTiled({&instance, 1}, camera, everything(surface.matte())).colour[kCentre * 4 + 3];
  };
  EXPECT_EQ(alphaAt(3.0f), 0.5f);
  EXPECT_EQ(alphaAt(std::nextafter(3.0f, 0.0f)), 0.0f);
}

TEST(Surface, MatchesTheReferenceInScenesThatItCuts) {
  uint32_t seed = 100;
  for (const size_t count : {300u, 3000u}) {
    for (const auto& [low, high] :
         {std::pair(0.02, 1.0), std::pair(0.004, 0.05), std::pair(0.95, 1.0)}) {
      CloudRecipe recipe;
      recipe.count = count;
      recipe.opacity_min = low;
      recipe.opacity_max = high;
      const SplatCloud cloud = randomCloud(recipe, ++seed);
      const SplatInstance instance{&cloud};
      const Camera camera = frontCamera(61, 45, 55, 3.0);
      const Surface surface = randomSurface(camera, seed);
      for (const SurfaceLayer& layer : {surface.layer(), surface.matte()}) {
        for (const bool with_background : {false, true}) {
          SCOPED_TRACE(::testing::Message() << "seed " << seed << " matte " << !layer.colour
                                            << " background " << with_background);
          RenderOptions options = everything(layer);
          options.with_background = with_background;
          options.background[1] = 0.5;
          expectEqual(renderTiled({&instance, 1}, camera, options),
                      renderReference({&instance, 1}, camera, options));
        }
      }
    }
  }
}

TEST(Surface, IsTheSameForEveryTargetAndNumberOfThreads) {
  CloudRecipe recipe;
  recipe.count = 2000;
  const SplatCloud cloud = randomCloud(recipe, 7);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(97, 67, 80, 3.0);
  const Surface surface = randomSurface(camera, 8);
  for (const SurfaceLayer& layer : {surface.layer(), surface.matte()}) {
    RenderOptions plain;
    plain.surface = layer;
    RenderOptions without_depth = plain;
    without_depth.with_depth = false;
    for (const RenderOptions& options : {everything(layer), plain, without_depth}) {
      const ReferenceResult reference = renderReference({&instance, 1}, camera, options);
      for (const NamedTileKernel& named : tileKernels()) {
        SCOPED_TRACE(named.target);
        RenderResult one, two;
        withThreads(1, [&] {
          one = renderTiledWith(named.kernel, {&instance, 1}, camera, options);
        });
        withThreads(2, [&] {
          two = renderTiledWith(named.kernel, {&instance, 1}, camera, options);
        });
        expectEqual(one, reference);
        EXPECT_EQ(one.colour, two.colour);
        EXPECT_EQ(one.depth, two.depth);
        EXPECT_EQ(one.median_depth, two.median_depth);
      }
    }
  }
}

TEST(Surface, SplatsApartAreThePictureWithoutTheSurfacesColour) {
  CloudRecipe recipe;
  recipe.count = 500;
  const SplatCloud cloud = randomCloud(recipe, 17);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(33, 29, 30, 3.0);
  const Surface surface = randomSurface(camera, 18);
  for (const bool with_background : {false, true}) {
    RenderOptions options;
    options.surface = surface.layer();
    options.with_background = with_background;
    options.background[2] = 0.75;
    const RenderResult whole = renderTiled({&instance, 1}, camera, options);
    options.splats_apart = true;
    RenderResult apart = renderTiled({&instance, 1}, camera, options);
    ASSERT_EQ(apart.surface_weight.size(), surface.depth.size());
    addSurface(surface.colour.data(), apart.surface_weight.data(), surface.depth.size(),
               apart.colour.data());
    EXPECT_EQ(apart.colour, whole.colour);
    EXPECT_EQ(apart.depth, whole.depth);
    EXPECT_TRUE(whole.surface_weight.empty());
  }
}

TEST(Surface, RefusesOtherSizesAndNumbersThatAreNone) {
  const TwoSplats scene;
  const auto messageOf = [&](const SurfaceLayer& layer) -> std::string {
    RenderOptions options;
    options.surface = layer;
    std::string message = "accepted";
    try {
      renderTiled(scene.instances, scene.camera, options);
    } catch (const Error& error) {
      message = error.what();
    }
    EXPECT_THROW(renderReference(scene.instances, scene.camera, options), Error);
    return message;
  };
  Surface surface(scene.camera, 3.0f, {0.5f, 0.5f, 0.5f, 0.5f});
  SurfaceLayer other = surface.layer();
  other.height = 8;
  EXPECT_EQ(messageOf(other), "the surface is 9 x 8 pixels; it must have the image's 9 x 9");
  surface.depth[11] = kNan;
  EXPECT_THAT(messageOf(surface.layer()), HasSubstr("depth at pixel (2, 1) is nan"));
  surface.depth[11] = -kInfinity;
  EXPECT_THAT(messageOf(surface.matte()), HasSubstr("depth at pixel (2, 1) is -inf"));
  surface.depth[11] = 1;
  surface.colour[23] = 1.5f;
  EXPECT_THAT(messageOf(surface.layer()), HasSubstr("alpha at pixel (5, 0) is 1.5"));
  surface.colour[23] = kInfinity;
  EXPECT_THAT(messageOf(surface.layer()), HasSubstr("colour at pixel"));
  EXPECT_THAT(messageOf({9, 9, nullptr, surface.colour.data(), nullptr}), HasSubstr("no depth"));
  SurfaceLayer matte = surface.matte();
  std::vector<float> opacity(81, 0.5f);
  matte.matte_opacity = opacity.data();
  surface.colour[23] = 0.75f;
  matte.colour = surface.colour.data();
  EXPECT_THAT(messageOf(matte),
              HasSubstr("matte opacity at pixel (5, 0) is 0.500000; no less than its "
                        "alpha, 0.750000, is allowed"));
  matte.colour = nullptr;
  for (const float bad : {kNan, -0.5f, 1.25f, kInfinity}) {
    opacity[10] = bad;
    EXPECT_THAT(messageOf(matte), HasSubstr("matte opacity at pixel (1, 1) is "));
  }
}

TEST(Surface, IsRefusedWhereABackwardPassIsToGoOn) {
  const TwoSplats scene;
  const Surface surface(scene.camera, 3.0f, {});
  RenderOptions options;
  options.surface = surface.matte();
  RenderWorkspace workspace;
  workspace.keepForBackward(true);
  RenderResult result;
  EXPECT_THROW(renderTiled(scene.instances, scene.camera, options, workspace, result), Error);
}

}  // namespace
}  // namespace stipple
