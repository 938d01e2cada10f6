#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/random_scene.h"
#include "splat/render/projection.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::Difference;
using testing::frontCamera;
using testing::oneSplat;
using testing::randomCloud;

// Both renderers take every decision (shown or not, order, 1/255, end of a pixel, median) with the
// same double numbers, so no pixel is excepted. What is left is rounding of the float sums: below
// 1e-5 in these scenes, 1e-4 is what the renderer promises. Depth is divided by 1 - T, which keeps
// only 6e-8 * 255 = 1.5e-5 where a single splat of alpha 1/255 covers the pixel, and a few times
// that where a few such do.
constexpr double kColourTolerance = 1e-4;
constexpr double kDepthTolerance = 1e-4;

RenderOptions everything() {
  RenderOptions options;
  options.with_median_depth = true;
  options.with_counts = true;
  return options;
}

Difference renderBoth(const std::vector<SplatInstance>& instances, const Camera& camera,
                      const RenderOptions& options) {
  const RenderResult tiled = renderTiled(instances, camera, options);
  return testing::compare(tiled, renderReference(instances, camera, options));
}

void expectEqual(const Difference& difference) {
  EXPECT_LT(difference.colour, kColourTolerance);
  EXPECT_LT(difference.depth, kDepthTolerance);
  EXPECT_LT(difference.median_depth, kDepthTolerance);
  EXPECT_EQ(difference.count_mismatches, 0u);
}

Camera orthographic(uint32_t width, uint32_t height, double pixels_per_metre) {
  Camera camera = frontCamera(width, height, pixels_per_metre, 3.0);
  camera.model = CameraModel::kOrthographic;
  camera.near_plane = -10;
  return camera;
}

TEST(TiledRender, MatchesTheReferenceForEveryDegreeLowPassAndCamera) {
  Camera shifted = frontCamera(90, 70, 80, 2.5);
  shifted.cx = -20;
  shifted.cy = 95;
  Camera stretched = frontCamera(75, 61, 70, 3.0);
  stretched.fy = 110;
  const Camera cameras[] = {frontCamera(97, 67, 80, 3.0), orthographic(80, 64, 30), shifted,
                            stretched};
  uint32_t seed = 1;
  for (const Camera& camera : cameras) {
    for (int degree = 0; degree <= kMaxShDegree; ++degree) {
      for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
        CloudRecipe recipe;
        recipe.degree = degree;
        const SplatCloud cloud = randomCloud(recipe, ++seed);
        RenderOptions options = everything();
        options.low_pass = low_pass;
        SCOPED_TRACE(::testing::Message() << "seed " << seed << " degree " << degree << " low-pass "
                                          << static_cast<int>(low_pass));
        expectEqual(renderBoth({{&cloud}}, camera, options));
      }
    }
  }
}

TEST(TiledRender, MatchesTheReferenceOnEveryTarget) {
  CloudRecipe recipe;
  recipe.count = 2000;
  recipe.degree = 1;
  const SplatCloud cloud = randomCloud(recipe, 41);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(97, 67, 80, 3.0);
  for (RenderOptions options : {RenderOptions{}, everything()}) {
    const ReferenceResult reference = renderReference({&instance, 1}, camera, options);
    for (const NamedTileKernel& named : tileKernels()) {
      SCOPED_TRACE(named.target);
      expectEqual(testing::compare(renderTiledWith(named.kernel, {&instance, 1}, camera, options),
                                   reference));
    }
  }
}

TEST(TiledRender, MatchesTheReferenceForThinAndOpaqueSplats) {
  for (const auto& [low, high] : {std::pair(0.004, 0.05), std::pair(0.95, 1.0)}) {
    CloudRecipe recipe;
    recipe.count = 3000;
    recipe.opacity_min = low;
    recipe.opacity_max = high;
    const SplatCloud cloud = randomCloud(recipe, 77);
    expectEqual(renderBoth({{&cloud}}, frontCamera(64, 64, 60, 3.0), everything()));
  }
}

TEST(TiledRender, MatchesTheReferenceForManyTurnedStretchedAndShearedInstances) {
  CloudRecipe recipe;
  recipe.count = 40;
  recipe.degree = 3;
  const SplatCloud a = randomCloud(recipe, 5);
  recipe.antialias = Antialias::kMip;
  const SplatCloud b = randomCloud(recipe, 6);
  std::vector<SplatInstance> instances;
  for (int i = 0; i < 30; ++i) {
    Mat4d matrix = Mat4d::Identity();
    matrix.topLeftCorner<3, 3>() =
        Eigen::AngleAxisd(0.7 * i, Vec3d(1, 0.3 * i, 2).normalized()).toRotationMatrix() *
        Vec3d(0.3, 0.5, 0.2).asDiagonal();
    matrix(0, 1) += 0.2;
    matrix.topRightCorner<3, 1>() = Vec3d(std::sin(i), std::cos(2.0 * i), std::sin(3.0 * i + 1));
    instances.push_back({i % 2 ? &a : &b, matrix});
  }
  expectEqual(renderBoth(instances, frontCamera(100, 80, 90, 4.0), everything()));
}

/// q/2 of splat i at the middle of a 1x1 picture.
double halfDistanceAtTheMiddle(const SplatCloud& cloud, size_t i, const Camera& camera) {
  Projected<double> p;
  const float full = 1.0f;
  const Mat3d turn = camera.world_to_camera.topLeftCorner<3, 3>();
  const Vec3d move = camera.world_to_camera.topRightCorner<3, 1>();
  if (!project<double>(makeView<double>(camera), turn, move, &cloud.positions[i * 3],
                       &cloud.rotations[i * 4], &cloud.scales[i * 3], full, LowPass::kClassic, p)) {
    return 1e9;
  }
  return halfSquaredDistance(p.footprint, 0.5 - p.footprint.mean_x, 0.5 - p.footprint.mean_y);
}

TEST(TiledRender, DecidesAsTheReferenceWhereAlphaIsAtItsThreshold) {
  // Opacities chosen so that alpha at the pixel is 1/255 up to about 1e-7: float32 alone would
  // decide about half of these splats at random, and each decides 1/255 of the colour.
  const Camera camera = frontCamera(1, 1, 20, 3.0);
  uint32_t shown = 0;
  uint32_t all = 0;
  for (uint32_t seed = 1; seed <= 20; ++seed) {
    CloudRecipe recipe;
    recipe.size_min = 0.2;
    recipe.size_max = 0.6;
    SplatCloud cloud = randomCloud(recipe, seed);
    for (size_t i = 0; i < cloud.size(); ++i) {
      const double half = halfDistanceAtTheMiddle(cloud, i, camera);
      cloud.opacities[i] = half < 5.5 ? static_cast<float>(std::exp(half) / 255.0) : 0.0f;
      all += half < 5.5;
    }
    const SplatInstance instance{&cloud};
    const ReferenceResult reference = renderReference({&instance, 1}, camera, everything());
    shown += reference.counts[0];
    expectEqual(testing::compare(renderTiled({&instance, 1}, camera, everything()), reference));
  }
  // The cases are about evenly split, so that they do test something.
  EXPECT_GT(shown, all / 5);
  EXPECT_LT(shown, all * 4 / 5);
}

TEST(TiledRender, DecidesAsTheReferenceWhereTransmittanceIsAtItsThresholds) {
  // A few splats, then one that brings T to 1e-4 (or to 1/2) up to the rounding of its opacity;
  // what follows it shows, or not, and the median is its depth, or the next one's.
  const Camera camera = frontCamera(1, 1, 20, 3.0);
  for (const double threshold : {1e-4, 0.5}) {
    uint32_t below = 0;
    for (uint32_t seed = 1; seed <= 200; ++seed) {
      CloudRecipe recipe;
      recipe.count = 6;
      recipe.size_min = 0.3;
      recipe.size_max = 0.6;
      SplatCloud cloud = randomCloud(recipe, seed);
      double transmittance = 1;
      for (size_t i = 0; i < cloud.size(); ++i) {
        for (size_t axis = 0; axis < 3; ++axis) cloud.positions[i * 3 + axis] *= 0.1f;
        cloud.positions[i * 3 + 1] = static_cast<float>(i) * 0.1f;
        const double response = std::exp(-halfDistanceAtTheMiddle(cloud, i, camera));
        if (i < 4) {
          const float opacity = threshold < 0.1 ? 0.85f + 0.03f * cloud.opacities[i]
                                                : 0.13f + 0.01f * cloud.opacities[i];
          cloud.opacities[i] = opacity;
        } else if (i == 4) {
          cloud.opacities[i] = static_cast<float>((1 - threshold / transmittance) / response);
        } else {
          cloud.opacities[i] = 0.3f;
        }
        ASSERT_LE(cloud.opacities[i], 1.0f);
        transmittance *= 1 - std::min(0.99, static_cast<double>(cloud.opacities[i]) * response);
        if (i == 4) below += transmittance < threshold;
      }
      const SplatInstance instance{&cloud};
      SCOPED_TRACE(::testing::Message() << "threshold " << threshold << " seed " << seed);
      expectEqual(renderBoth({instance}, camera, everything()));
    }
    EXPECT_GT(below, 40u);
    EXPECT_LT(below, 160u);
  }
}

TEST(TiledRender, GivesTheSameBitsForOneAndTwoThreads) {
  CloudRecipe recipe;
  recipe.count = 20000;
  recipe.degree = 1;
  recipe.size_max = 0.05;
  const SplatCloud cloud = randomCloud(recipe, 3);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(200, 150, 180, 3.0);
  RenderResult one, two;
  withThreads(1, [&] { one = renderTiled({&instance, 1}, camera, everything()); });
  withThreads(2, [&] { two = renderTiled({&instance, 1}, camera, everything()); });
  EXPECT_EQ(one.colour, two.colour);
  EXPECT_EQ(one.depth, two.depth);
  EXPECT_EQ(one.median_depth, two.median_depth);
  EXPECT_EQ(one.counts, two.counts);
  EXPECT_EQ(one.visible_count, two.visible_count);
}

TEST(TiledRender, DrawsAnEmptyPictureWithoutSplats) {
  const Camera camera = frontCamera(17, 5, 20, 3.0);
  const RenderResult picture = renderTiled({}, camera, everything());
  EXPECT_EQ(picture.colour, std::vector<float>(17 * 5 * 4, 0.0f));
  EXPECT_EQ(picture.depth, std::vector<float>(17 * 5, kEmptyDepth));
  EXPECT_EQ(picture.median_depth, std::vector<float>(17 * 5, kEmptyDepth));
  EXPECT_EQ(picture.visible_count, 0u);
}

TEST(TiledRender, CompositesTheBackgroundUnderTheLastTransmittance) {
  const SplatCloud cloud = oneSplat(0.1f, 0.5f);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(21, 21, 40, 3.0);
  RenderOptions options;
  const RenderResult film = renderTiled({&instance, 1}, camera, options);
  options.with_background = true;
  options.background[0] = 0.25;
  options.background[1] = 0.5;
  options.background[2] = 2.0;
  const RenderResult over = renderTiled({&instance, 1}, camera, options);
  for (size_t i = 0; i < film.colour.size(); i += 4) {
    const float rest = 1 - film.colour[i + 3];
    EXPECT_FLOAT_EQ(over.colour[i], film.colour[i] + rest * 0.25f);
    EXPECT_FLOAT_EQ(over.colour[i + 2], film.colour[i + 2] + rest * 2.0f);
    EXPECT_EQ(over.colour[i + 3], 1.0f);
  }
}

TEST(TiledRender, StopsWhenCancelledAndReportsProgress) {
  const SplatCloud cloud = oneSplat(0.1f, 0.5f);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(64, 64, 40, 3.0);
  Progress progress;
  renderTiled({&instance, 1}, camera, {}, &progress);
  EXPECT_EQ(progress.fraction(), 1.0);
  progress.cancel();
  for (const bool tiled : {true, false}) {
    try {
      if (tiled) {
        renderTiled({&instance, 1}, camera, {}, &progress);
      } else {
        renderReference({&instance, 1}, camera, {}, &progress);
      }
      FAIL() << "not cancelled";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCancelled);
    }
  }
}

ErrorCode errorOf(const std::vector<SplatInstance>& instances, const Camera& camera,
                  const RenderOptions& options) {
  try {
    renderTiled(instances, camera, options);
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()), "");
    return error.code();
  }
  ADD_FAILURE() << "accepted";
  return ErrorCode::kInternal;
}

TEST(TiledRender, RefusesBadInput) {
  const Camera camera = frontCamera(16, 16, 20, 3.0);
  const SplatCloud cloud = oneSplat(0.1f, 0.5f);
  SplatInstance singular{&cloud};
  singular.object_to_world(2, 2) = 0;
  EXPECT_EQ(errorOf({singular}, camera, {}), ErrorCode::kInvalidArgument);
  SplatInstance infinite{&cloud};
  infinite.object_to_world(0, 3) = INFINITY;
  EXPECT_EQ(errorOf({infinite}, camera, {}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(errorOf({{nullptr}}, camera, {}), ErrorCode::kInvalidArgument);
  RenderOptions degree;
  degree.sh_degree_limit = 5;
  EXPECT_EQ(errorOf({{&cloud}}, camera, degree), ErrorCode::kInvalidArgument);
  RenderOptions background;
  background.background[1] = NAN;
  EXPECT_EQ(errorOf({{&cloud}}, camera, background), ErrorCode::kInvalidArgument);
  SplatCloud nan = cloud;
  nan.positions[1] = NAN;
  EXPECT_EQ(errorOf({{&nan}}, camera, {}), ErrorCode::kInvalidArgument);
}

TEST(TiledRender, RefusesMixedColourSpacesAsTrainedAndBlendsThemSceneLinear) {
  const SplatCloud display = oneSplat(0.1f, 0.5f);
  SplatCloud linear = display;
  linear.colour_space = ColourSpace::kLinear;
  const Camera camera = frontCamera(16, 16, 20, 3.0);
  EXPECT_EQ(errorOf({{&display}, {&linear}}, camera, {}), ErrorCode::kUnsupported);
  RenderOptions options = everything();
  options.blend_space = BlendSpace::kSceneLinear;
  expectEqual(renderBoth({{&display}, {&linear}}, camera, options));
}

TEST(TiledRender, StaysWithinItsMemoryBoundFormula) {
  const SplatCloud cloud = oneSplat(0.1f, 0.5f);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(64, 32, 40, 3.0);
  const uint64_t colour_only = renderMemoryBound({&instance, 1}, camera, {.with_depth = false});
  const uint64_t all = renderMemoryBound({&instance, 1}, camera, everything());
  EXPECT_EQ(all - colour_only, 64u * 32u * 3u * 4u);
  EXPECT_GE(colour_only, 64u * 32u * 16u);
}

}  // namespace
}  // namespace stipple
