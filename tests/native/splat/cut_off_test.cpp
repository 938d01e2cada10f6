#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "splat/cpu/projector.h"
#include "splat/cpu/tiles/tile.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/random_scene.h"
#include "splat/render/accurate_render.h"

// Cut-offs other than 1/255 in the tiled renderer, against the definition in double.

namespace stipple {
namespace {

using testing::everyBuffer;
using testing::instanceOf;
using testing::randomCloud;

constexpr double kCutOffs[] = {0.7, 0.1, 0.02, kMinAlpha, 2e-3, 1e-4, 1e-6, 1e-9, 1e-12};

RenderOptions optionsAt(double least_alpha) {
  RenderOptions options = everyBuffer(LowPass::kClassic);
  options.least_alpha = least_alpha;
  return options;
}

SplatCloud scene(uint32_t seed) {
  testing::CloudRecipe recipe;
  recipe.count = 300;
  recipe.opacity_min = 1e-4;  // some show at fine cut-offs alone
  return randomCloud(recipe, seed);
}

TEST(CutOff, EveryTargetDecidesAsTheReferenceDoes) {
  const SplatCloud cloud = scene(3);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = testing::frontCamera(75, 50, 60, 3);
  for (const double least : kCutOffs) {
    const RenderOptions options = optionsAt(least);
    const ReferenceResult reference = renderReference({&instance, 1}, camera, options);
    for (const NamedTileKernel& kernel : tileKernels()) {
      const RenderResult tiled = renderTiledWith(kernel.kernel, {&instance, 1}, camera, options);
      const testing::Difference d = testing::compare(tiled, reference);
      // What every renderer promises of single precision.
      EXPECT_LT(d.colour, 1e-4) << kernel.target << " at " << least;
      EXPECT_LT(d.median_depth, 1e-4) << kernel.target << " at " << least;
      EXPECT_EQ(d.count_mismatches, 0u) << kernel.target << " at " << least;
    }
  }
}

TEST(CutOff, EveryProjectorLeavesTheSameOut) {
  const SplatCloud cloud = scene(4);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = testing::frontCamera(75, 50, 60, 3);
  for (const double least : kCutOffs) {
    RenderWorkspace workspace;
    RenderResult expected, seen;
    renderTiledWith(blendTileScalar, projectScalar, {&instance, 1}, camera, optionsAt(least),
                    workspace, expected);
    for (const NamedProjector& projector : projectors()) {
      renderTiledWith(blendTileScalar, projector.project, {&instance, 1}, camera, optionsAt(least),
                      workspace, seen);
      EXPECT_EQ(seen.visible_count, expected.visible_count) << projector.target << " at " << least;
      EXPECT_EQ(seen.colour, expected.colour) << projector.target << " at " << least;
    }
  }
}

TEST(CutOff, TheUsualOneIsTheUsualOne) {
  const TileCutOff usual = cutOffOf(kMinAlpha);
  EXPECT_EQ(usual.log2_least, kLog2MinAlpha);
  EXPECT_EQ(usual.reach, 1.0f);
  EXPECT_EQ(usual.medianDoubt(100000), kMedianDoubt);
  EXPECT_EQ(finishDoubt(10, 5000, usual.reach, usual.most_splats), finishDoubt(10, 5000));
  EXPECT_EQ(cutOffOf(0.5).reach, 1.0f);
  EXPECT_EQ(cutOffOf(0.5).log2_least, -1.0f);
}

TEST(CutOff, FinerOnesBlendMoreAndEndWhereNothingIsLeft) {
  const SplatCloud cloud = scene(5);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = testing::frontCamera(40, 30, 40, 3);
  uint64_t last = 0, last_visible = 0;
  for (const double least : kCutOffs) {
    const RenderResult picture = renderTiled({&instance, 1}, camera, optionsAt(least));
    uint64_t blended = 0;
    for (const uint32_t count : picture.counts) blended += count;
    EXPECT_GE(blended, last) << least;
    EXPECT_GE(picture.visible_count, last_visible) << least;
    last = blended;
    last_visible = picture.visible_count;
  }
  EXPECT_GT(last, 0u);
}

TEST(CutOff, ThousandsOfFaintLayersAddUp) {
  // 5000 of 1e-3 each, in front of each other: all of them are below 1/255.
  SplatCloud cloud = testing::oneSplat(0.5f, 1e-3f);
  cloud.resize(5000);
  for (size_t i = 0; i < cloud.size(); ++i) {
    cloud.rotations[i * 4] = 1;
    for (size_t k = 0; k < 3; ++k) {
      cloud.scales[i * 3 + k] = 0.5f;
      cloud.sh[i * 3 + k] = 1;
    }
    cloud.opacities[i] = 1e-3f;
    cloud.positions[i * 3 + 1] = 1e-5f * static_cast<float>(i);
  }
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = testing::frontCamera(17, 17, 20, 3);
  const RenderResult nothing = renderTiled({&instance, 1}, camera, optionsAt(kMinAlpha));
  EXPECT_EQ(nothing.visible_count, 0u);
  const RenderOptions options = optionsAt(1e-5);
  const testing::Difference d = testing::compare(renderTiled({&instance, 1}, camera, options),
                                                 renderReference({&instance, 1}, camera, options));
  EXPECT_LT(d.colour, 1e-4);
  EXPECT_EQ(d.count_mismatches, 0u);
  EXPECT_LT(d.median_depth, 1e-6);
}

TEST(CutOff, AccuracyDrawsTiledAtAnyCutOffAndHoldsTheFinest) {
  const SplatCloud cloud = scene(6);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = testing::frontCamera(40, 30, 40, 3);
  const auto drawn = [&](double least) {
    RenderAccuracy accuracy;
    accuracy.limits.least_alpha = least;
    EXPECT_TRUE(isTiled(accuracy));
    RenderWorkspace workspace;
    RenderResult result;
    renderAccurate({&instance, 1}, camera, everyBuffer(LowPass::kClassic), accuracy, workspace,
                   result);
    return result.colour;
  };
  EXPECT_EQ(drawn(0.1), renderTiled({&instance, 1}, camera, optionsAt(0.1)).colour);
  EXPECT_EQ(drawn(1e-300), drawn(1e-12));
}

TEST(CutOff, WhatIsNoShareIsRefusedAndBackwardKnowsTheUsualOneAlone) {
  const SplatCloud cloud = scene(7);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = testing::frontCamera(20, 20, 20, 3);
  for (const double bad : {0.0, 1.0, -0.1, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(renderTiled({&instance, 1}, camera, optionsAt(bad)), Error);
  }
  RenderWorkspace workspace;
  EXPECT_THROW(blendTiledWith(chosenTileKernel(), chosenProjector(), {&instance, 1}, camera,
                              optionsAt(0.1), workspace, nullptr),
               Error);
}

}  // namespace
}  // namespace stipple
