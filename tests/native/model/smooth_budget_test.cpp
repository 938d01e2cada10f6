#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "decode/surface/surface_model.h"
#include "decode/test_meshes.h"
#include "decode/tree/hierarchy_decoder.h"
#include "model/budget_octaves.h"

namespace stipple {
namespace {

/// Steps of a mesh, as a surface model makes them.
struct SurfaceMaker final : BudgetOctaves::Maker {
  SurfaceModel model;

  explicit SurfaceMaker() {
    SurfaceModelOptions options;
    options.sampling.count = 20000;
    model = buildSurfaceModel(test::torus(1, 0.3, 48, 24), options);
  }
  BudgetStep step(uint64_t budget) const override {
    BudgetStep step;
    step.budget = budget;
    step.anchors =
        sampleAnchors(*model.density, {.count = budget, .order = AnchorOrder::kProgressive});
    DecodeRequest request;
    request.anchors = &step.anchors;
    step.splats = model.decoder->decode(request);
    return step;
  }
  SplatGrowth growth(const BudgetStep& few, const BudgetStep& many) const override {
    return growthOfAnchors(few.anchors, few.splats, many.anchors, many.splats);
  }
};

double largestChange(const std::vector<float>& a, const std::vector<float>& b) {
  double most = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    most = std::max(most, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  }
  return most;
}

TEST(SmoothBudget, IsItsOwnAtPowersOfTwoAndContinuousBetween) {
  const SurfaceMaker maker;
  const ModelSettings allowed;
  BudgetOctaves octaves;
  ModelRequest request;
  const auto at = [&](uint64_t budget) {
    request.budget = budget;
    return octaves.splats(request, allowed, maker);
  };
  EXPECT_EQ(at(1024).positions, maker.step(1024).splats.positions);
  const SplatCloud before = at(1500), after = at(1501);
  ASSERT_EQ(before.size(), 2048u);
  ASSERT_EQ(after.size(), 2048u);
  // A step of 1/1040 of an octave; a spacing is 0.08, and lengths of splats are at most twice it.
  EXPECT_LT(largestChange(before.positions, after.positions), 0.16 / 1000);
  EXPECT_LT(largestChange(before.scales, after.scales), 0.16 / 1000);
  EXPECT_LT(largestChange(before.opacities, after.opacities), 1.0 / 1000);
  EXPECT_GT(largestChange(before.opacities, after.opacities), 0.0);
  // At both ends of an octave what changes still is what the last part of it is.
  EXPECT_LT(largestChange(at(2047).positions, at(2048).positions), 0.16 / 500);
  const SplatCloud begun = at(1025);
  double hidden = 0;
  for (const float opacity : begun.opacities) hidden += opacity < 0.01f ? 1 : 0;
  EXPECT_EQ(hidden, 1024.0);
}

TEST(SmoothBudget, EveryOldSplatStaysOnce) {
  const SurfaceMaker maker;
  const BudgetStep few = maker.step(500), many = maker.step(900);
  const SplatGrowth growth = maker.growth(few, many);
  std::vector<int> staying(500, 0);
  for (size_t i = 0; i < 900; ++i) {
    ASSERT_LT(growth.sources[i], 500u);
    staying[growth.sources[i]] += growth.stays[i];
  }
  EXPECT_EQ(std::count(staying.begin(), staying.end(), 1), 500);
}

TEST(SmoothBudget, NodesOfATreeGrowOutOfThoseAboveThem) {
  const auto leaves = std::make_shared<const SplatCloud>(SurfaceMaker().step(600).splats);
  const auto tree = std::make_shared<const MergeTree>(buildMergeTree(*leaves, {}, {}));
  const HierarchyDecoder decoder(leaves, tree);
  const std::vector<uint32_t> few = decoder.cut(100), many = decoder.cut(600);
  const SplatGrowth growth = decoder.growth(100, 600);
  std::vector<int> staying(100, 0);
  ASSERT_EQ(growth.sources.size(), 600u);
  for (size_t i = 0; i < many.size(); ++i) {
    uint32_t node = many[i];
    while (node != few[growth.sources[i]] && node != TreeShape::kNoParent) {
      node = tree->parents[node];
    }
    EXPECT_EQ(node, few[growth.sources[i]]);
    staying[growth.sources[i]] += growth.stays[i];
  }
  EXPECT_EQ(std::count(staying.begin(), staying.end(), 1), 100);
}

}  // namespace
}  // namespace stipple
