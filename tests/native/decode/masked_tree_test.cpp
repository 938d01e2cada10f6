#include "decode/tree/masked_tree.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/cloud_selection.h"
#include "decode/tree/hierarchy_decoder.h"
#include "splat/random_scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::randomCloud;

SplatCloud cloudOf(size_t count, uint32_t seed, int degree = 1) {
  CloudRecipe recipe;
  recipe.count = count;
  recipe.degree = degree;
  recipe.size_max = 0.1;
  return randomCloud(recipe, seed);
}

std::vector<uint8_t> leftOf(const SplatCloud& cloud, float x) {
  std::vector<uint8_t> mask(cloud.size());
  for (size_t i = 0; i < cloud.size(); ++i) mask[i] = cloud.positions[i * 3] < x ? 1 : 0;
  return mask;
}

SplatCloud cutOf(const MaskedTree& masked, uint64_t budget) {
  const HierarchyDecoder decoder(std::make_shared<const SplatCloud>(masked.leaves),
                                 std::make_shared<const MergeTree>(masked.tree));
  DecodeRequest request;
  request.budget = budget;
  return decoder.decode(request);
}

TEST(MaskedTree, IsTheTreeItselfWhereAllSplatsStay) {
  const SplatCloud cloud = cloudOf(700, 1);
  const MergeTree tree = buildMergeTree(cloud, {}, {});
  const MaskedTree masked = maskedTree(cloud, tree, std::vector<uint8_t>(cloud.size(), 1));
  EXPECT_EQ(masked.tree.parents, tree.parents);
  EXPECT_EQ(masked.tree.errors, tree.errors);
  EXPECT_EQ(masked.tree.nodes.positions, tree.nodes.positions);
  EXPECT_EQ(masked.tree.nodes.sh, tree.nodes.sh);
  EXPECT_EQ(masked.leaves.rotations, cloud.rotations);
}

TEST(MaskedTree, FullBudgetIsWhatIsLeftBitForBit) {
  const SplatCloud cloud = cloudOf(900, 2);
  const MergeTree tree = buildMergeTree(cloud, {}, {});
  const std::vector<uint8_t> mask = leftOf(cloud, 0.2f);
  const MaskedTree masked = maskedTree(cloud, tree, mask);
  const SplatCloud left = kept(cloud, mask);
  EXPECT_NO_THROW(validateTree(masked.tree, masked.leaves, "masked"));
  const SplatCloud all = cutOf(masked, left.size());
  EXPECT_EQ(all.positions, left.positions);
  EXPECT_EQ(all.sh, left.sh);
}

TEST(MaskedTree, NoCutShowsWhatIsLeftOut) {
  // What is left out is far away, large and of another colour: a trace of it would show in places,
  // sizes and colours alike.
  SplatCloud cloud = cloudOf(1200, 3, 0);
  std::vector<uint8_t> mask(cloud.size(), 1);
  for (size_t i = 0; i < cloud.size(); ++i) {
    const bool out = i % 3 == 0;
    mask[i] = out ? 0 : 1;
    for (size_t c = 0; c < 3; ++c) cloud.sh[i * 3 + c] = out ? 50.0f : 0.25f;
  }
  const MergeTree tree = buildMergeTree(cloud, {}, {});
  const MaskedTree masked = maskedTree(cloud, tree, mask);
  for (const uint64_t budget : {1u, 2u, 17u, 200u, 799u}) {
    const SplatCloud cut = cutOf(masked, budget);
    ASSERT_EQ(cut.size(), budget);
    // Colours are averages of 0.25 and 0.25: one rounding each.
    for (const float value : cut.sh) EXPECT_NEAR(value, 0.25f, 1e-6f);
    for (const float value : cut.positions) EXPECT_LE(std::abs(value), 1.0f);
  }
}

TEST(MaskedTree, NodesKeepTheMassOfWhatIsBelowThem) {
  // Without overlap and at equal shapes, moments are exact: the root's mean is the mean of what is
  // left, weighted by opacity (areas are equal).
  SplatCloud cloud = cloudOf(300, 4, 0);
  for (float& scale : cloud.scales) scale = 0.01f;
  const MergeTree tree = buildMergeTree(cloud, {}, {});
  const std::vector<uint8_t> mask = leftOf(cloud, 0.0f);
  const SplatCloud root = cutOf(maskedTree(cloud, tree, mask), 1);
  double total = 0;
  Vec3d mean = Vec3d::Zero();
  for (size_t i = 0; i < cloud.size(); ++i) {
    if (!mask[i]) continue;
    const double weight = static_cast<double>(cloud.opacities[i]);
    total += weight;
    for (Eigen::Index k = 0; k < 3; ++k) {
      mean[k] += weight * static_cast<double>(cloud.positions[i * 3 + static_cast<size_t>(k)]);
    }
  }
  mean /= total;
  // Positions are rounded to float32 once per level.
  for (Eigen::Index k = 0; k < 3; ++k) {
    EXPECT_NEAR(root.positions[static_cast<size_t>(k)], mean[k], 1e-5);
  }
}

TEST(MaskedTree, KeepsNodesThatLoseNothing) {
  const SplatCloud cloud = cloudOf(400, 5);
  const MergeTree tree = buildMergeTree(cloud, {}, {});
  std::vector<uint8_t> mask(cloud.size(), 1);
  mask[7] = 0;
  const MaskedTree masked = maskedTree(cloud, tree, mask);
  ASSERT_EQ(masked.tree.nodes.size(), tree.nodes.size() - 1);
  // All but the ancestors of leaf 7 are there still, bit for bit.
  size_t ancestors = 0;
  for (uint32_t id = tree.parents[tree.nodes.size() + 7]; id != MergeTree::kNoParent;
       id = tree.parents[id]) {
    ++ancestors;
  }
  size_t same = 0;
  size_t at = 0;
  for (size_t id = 0; id < tree.nodes.size() && at < masked.tree.nodes.size(); ++id) {
    if (tree.errors[id] != masked.tree.errors[at]) continue;
    same += std::equal(&tree.nodes.positions[id * 3], &tree.nodes.positions[id * 3] + 3,
                       &masked.tree.nodes.positions[at * 3]);
    ++at;
  }
  EXPECT_GE(same + ancestors, tree.nodes.size());
  EXPECT_LT(same, tree.nodes.size());
}

TEST(MaskedTree, KeepsWhatWasFittedOfNodesThatLoseNothing) {
  const SplatCloud cloud = cloudOf(700, 9);
  MergeTree tree = buildMergeTree(cloud, {}, {});
  // Nodes that no merge of their children would give, as a fit to pictures leaves them.
  const auto shift = [](std::vector<float>& values, float factor) {
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] *= 1 + factor * static_cast<float>(i % 11) / 11;
    }
  };
  shift(tree.nodes.positions, 0.05f);
  shift(tree.nodes.rotations, 0.3f);
  shift(tree.nodes.scales, 0.4f);
  shift(tree.nodes.opacities, -0.3f);
  shift(tree.nodes.sh, 0.5f);
  const std::vector<uint8_t> mask = leftOf(cloud, 0.3f);
  const MaskedTree masked = maskedTree(cloud, tree, mask);

  const size_t inner_count = tree.nodes.size();
  std::vector<size_t> kept_below(tree.parents.size(), 0);
  std::vector<size_t> leaves_below(tree.parents.size(), 0);
  std::vector<size_t> sides_left(inner_count, 0);
  for (size_t id = tree.parents.size(); id-- > 0;) {
    if (id >= inner_count) {
      leaves_below[id] = 1;
      kept_below[id] = mask[id - inner_count];
    }
    const uint32_t parent = tree.parents[id];
    if (parent == MergeTree::kNoParent) continue;
    leaves_below[parent] += leaves_below[id];
    kept_below[parent] += kept_below[id];
    sides_left[parent] += kept_below[id] > 0 ? 1 : 0;
  }
  const auto expectRow = [](const std::vector<float>& a, size_t i, const std::vector<float>& b,
                            size_t j, size_t stride) {
    EXPECT_TRUE(std::equal(&a[i * stride], &a[i * stride] + stride, &b[j * stride]));
  };
  size_t at = 0;
  size_t untouched = 0;
  for (size_t id = 0; id < inner_count; ++id) {
    if (sides_left[id] < 2) continue;  // gone, or its one child stands for it
    if (kept_below[id] == leaves_below[id]) {
      ++untouched;
      expectRow(tree.nodes.positions, id, masked.tree.nodes.positions, at, 3);
      expectRow(tree.nodes.rotations, id, masked.tree.nodes.rotations, at, 4);
      expectRow(tree.nodes.scales, id, masked.tree.nodes.scales, at, 3);
      expectRow(tree.nodes.opacities, id, masked.tree.nodes.opacities, at, 1);
      expectRow(tree.nodes.sh, id, masked.tree.nodes.sh, at, tree.nodes.shStride());
    }
    ++at;
  }
  EXPECT_EQ(at, masked.tree.nodes.size());
  EXPECT_GT(untouched, 200u);
}

TEST(MaskedTree, OneSplatIsATreeWithoutInnerNodes) {
  const SplatCloud cloud = cloudOf(50, 6);
  const MergeTree tree = buildMergeTree(cloud, {}, {});
  std::vector<uint8_t> mask(cloud.size(), 0);
  mask[31] = 1;
  const MaskedTree masked = maskedTree(cloud, tree, mask);
  EXPECT_EQ(masked.tree.parents, (std::vector<uint32_t>{MergeTree::kNoParent}));
  EXPECT_EQ(cutOf(masked, 1).positions, masked.leaves.positions);
}

TEST(MaskedTree, RefusesMasksThatDoNotFit) {
  const SplatCloud cloud = cloudOf(20, 7);
  const MergeTree tree = buildMergeTree(cloud, {}, {});
  EXPECT_THROW(maskedTree(cloud, tree, std::vector<uint8_t>(19, 1)), Error);
  EXPECT_THROW(maskedTree(cloud, tree, std::vector<uint8_t>(20, 0)), Error);
  Progress progress;
  progress.cancel();
  EXPECT_THROW(maskedTree(cloud, tree, std::vector<uint8_t>(20, 1), &progress), Error);
}

TEST(MaskedTree, SameForAnyNumberOfThreads) {
  const SplatCloud cloud = cloudOf(20000, 8);
  const MergeTree tree = buildMergeTree(cloud, {}, {});
  const std::vector<uint8_t> mask = leftOf(cloud, 0.1f);
  MaskedTree one, two;
  withThreads(1, [&] { one = maskedTree(cloud, tree, mask); });
  withThreads(2, [&] { two = maskedTree(cloud, tree, mask); });
  EXPECT_EQ(one.tree.parents, two.tree.parents);
  EXPECT_EQ(one.tree.nodes.positions, two.tree.nodes.positions);
  EXPECT_EQ(one.tree.nodes.sh, two.tree.nodes.sh);
}

}  // namespace
}  // namespace stipple
