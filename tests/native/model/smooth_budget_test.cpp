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

  uint32_t each = 1;

  explicit SurfaceMaker(uint32_t gaussians = 1) : each(gaussians) {
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
    request.gaussians_per_anchor = each;
    step.splats = model.decoder->decode(request);
    return step;
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
  const SplatGrowth growth = growthOfAnchors(few.anchors, few.splats, many.anchors, many.splats);
  std::vector<int> staying(500, 0);
  for (size_t i = 0; i < 900; ++i) {
    ASSERT_LT(growth.sources[i], 500u);
    staying[growth.sources[i]] += growth.stays[i];
  }
  EXPECT_EQ(std::count(staying.begin(), staying.end(), 1), 500);
}

TEST(SmoothBudget, EverySplatOfAnAnchorStaysItself) {
  constexpr uint32_t kEach = 3;
  const SurfaceMaker maker(kEach);
  const BudgetStep few = maker.step(256), many = maker.step(512);
  const SplatGrowth growth = growthOfAnchors(few.anchors, few.splats, many.anchors, many.splats);
  ASSERT_EQ(growth.sources.size(), 512u * kEach);
  size_t staying = 0;
  for (size_t i = 0; i < growth.sources.size(); ++i) {
    if (!growth.stays[i]) continue;
    ++staying;
    EXPECT_EQ(growth.sources[i] % kEach, i % kEach);
    EXPECT_EQ(few.anchors.leaves[growth.sources[i] / kEach], many.anchors.leaves[i / kEach]);
  }
  EXPECT_EQ(staying, 256u * kEach);
}

/// A tree of splats, and which of its nodes a smooth decode has.
struct SmoothTree {
  std::shared_ptr<const SplatCloud> leaves =
      std::make_shared<const SplatCloud>(SurfaceMaker().step(600).splats);
  std::shared_ptr<const MergeTree> tree =
      std::make_shared<const MergeTree>(buildMergeTree(*leaves, {}, {}));
  HierarchyDecoder decoder{leaves, tree};

  SplatCloud at(uint64_t budget) const {
    DecodeRequest request;
    request.budget = budget;
    return decoder.decodeSmooth(request);
  }
  Vec3d place(uint32_t id) const {
    const size_t inner = tree->nodes.size();
    const float* p =
        id < inner ? &tree->nodes.positions[id * 3] : &leaves->positions[(id - inner) * 3];
    return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
  }
};

TEST(SmoothBudget, ATreeHasItsCutAndWhatHalfAnOctaveMoreSplits) {
  const SmoothTree smooth;
  const SplatCloud shown = smooth.at(100);
  EXPECT_EQ(shown.size(), 141u);  // 100 * 2^(1/2)
  EXPECT_EQ(smooth.at(600).positions, smooth.leaves->positions);
  // Nodes that 141 do not split are as they are.
  const std::vector<uint32_t> few = smooth.decoder.cut(100), ids = smooth.decoder.cut(141);
  size_t same = 0;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (std::find(few.begin(), few.end(), ids[i]) == few.end()) continue;
    const Vec3d at = smooth.place(ids[i]);
    for (size_t axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(static_cast<double>(shown.positions[i * 3 + axis]),
                at[static_cast<Eigen::Index>(axis)]);
    }
    ++same;
  }
  EXPECT_GE(same, 100u - 41u);
}

TEST(SmoothBudget, NodesOfATreeGrowOutOfThoseAboveThem) {
  const SmoothTree smooth;
  const auto idsAt = [&](uint64_t budget) {
    const double ahead = std::ceil(static_cast<double>(budget) * std::sqrt(2.0)) - 1;
    return smooth.decoder.cut(static_cast<uint64_t>(ahead));
  };
  for (const uint64_t budget : {120, 255, 256, 380}) {
    const SplatCloud before = smooth.at(budget), after = smooth.at(budget + 1);
    const std::vector<uint32_t> ids = idsAt(budget), next = idsAt(budget + 1);
    ASSERT_EQ(before.size(), ids.size());
    ASSERT_EQ(after.size(), next.size());
    // What one more splat is of the half octave that a split takes.
    const double part =
        2 * std::log2(static_cast<double>(budget + 1) / static_cast<double>(budget));
    double longest = 0;
    for (const uint32_t id : next) {
      const uint32_t parent = smooth.tree->parents[id];
      longest = std::max(longest, (smooth.place(id) - smooth.place(parent)).norm());
    }
    for (size_t j = 0; j < next.size(); ++j) {
      const bool is_new = !std::binary_search(ids.begin(), ids.end(), next[j]);
      const float opacity = after.opacities[j];
      if (is_new && static_cast<double>(opacity) <= 2 * part) continue;  // it appears
      uint32_t from = next[j];  // itself, or the node that it begins to take the place of
      while (!std::binary_search(ids.begin(), ids.end(), from)) from = smooth.tree->parents[from];
      const auto i =
          static_cast<size_t>(std::lower_bound(ids.begin(), ids.end(), from) - ids.begin());
      ASSERT_LT(i, ids.size());
      const auto placeOf = [](const SplatCloud& cloud, size_t row) {
        return Vec3d(static_cast<double>(cloud.positions[row * 3]),
                     static_cast<double>(cloud.positions[row * 3 + 1]),
                     static_cast<double>(cloud.positions[row * 3 + 2]));
      };
      // More than once: a node that splits while its parent does changes with it.
      EXPECT_LT((placeOf(after, j) - placeOf(before, i)).norm(), 3 * part * longest) << next[j];
      EXPECT_LT(std::abs(opacity - before.opacities[i]), 3 * part) << next[j];
    }
  }
}

}  // namespace
}  // namespace stipple
