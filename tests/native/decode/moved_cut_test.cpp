#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/cloud_transform.h"
#include "decode/tree/hierarchy_decoder.h"
#include "math/covariance.h"
#include "splat/random_scene.h"

// The cut of a merge tree whose leaves have moved: what the tree would have merged there.

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

HierarchyDecoder treeOf(const SplatCloud& cloud) {
  auto tree = std::make_shared<const MergeTree>(buildMergeTree(cloud, {}, {}));
  return {std::make_shared<const SplatCloud>(cloud), std::move(tree)};
}

SplatCloud cutOf(const HierarchyDecoder& decoder, uint64_t budget) {
  DecodeRequest request;
  request.budget = budget;
  return decoder.decode(request);
}

/// Largest differences of two clouds: of numbers, and of covariances over the larger of both.
void expectNear(const SplatCloud& a, const SplatCloud& b, double tolerance) {
  ASSERT_EQ(a.size(), b.size());
  const auto near = [&](const std::vector<float>& x, const std::vector<float>& y) {
    for (size_t i = 0; i < x.size(); ++i) {
      ASSERT_NEAR(static_cast<double>(x[i]), static_cast<double>(y[i]), tolerance) << i;
    }
  };
  near(a.positions, b.positions);
  near(a.opacities, b.opacities);
  near(a.sh, b.sh);
  for (size_t i = 0; i < a.size(); ++i) {
    const Mat3d first = covariance<double>(&a.rotations[4 * i], &a.scales[3 * i]);
    const Mat3d second = covariance<double>(&b.rotations[4 * i], &b.scales[3 * i]);
    ASSERT_LT((first - second).norm(), tolerance * std::max(first.norm(), second.norm())) << i;
  }
}

TEST(MovedCut, IsTheCutWhereNothingHasMoved) {
  const SplatCloud cloud = cloudOf(900, 1);
  const HierarchyDecoder decoder = treeOf(cloud);
  for (const uint64_t budget : {1u, 2u, 90u, 450u, 899u}) {
    // The two differ in the order of sums: some float32 roundings of harmonics, one per level.
    expectNear(decoder.decodeMoved(cloud, budget), cutOf(decoder, budget), 2e-6);
  }
  EXPECT_EQ(decoder.decodeMoved(cloud, 900).positions, cloud.positions);
}

TEST(MovedCut, GoesAlongWithSplatsThatAllMoveAlike) {
  const SplatCloud cloud = cloudOf(900, 2);
  const HierarchyDecoder decoder = treeOf(cloud);
  // A quarter turn about z, which exchanges the planes that merges look along, and a shift.
  Mat4d motion = Mat4d::Identity();
  motion.topLeftCorner<2, 2>() << 0, -1, 1, 0;
  motion.topRightCorner<3, 1>() << 3, -1, 0.5;
  for (const uint64_t budget : {30u, 300u}) {
    expectNear(decoder.decodeMoved(transformed(cloud, motion), budget),
               transformed(cutOf(decoder, budget), motion), 2e-5);
  }
}

TEST(MovedCut, KeepsRowsAndTheOrderOfAxesWhereSplatsGoTheirOwnWays) {
  const SplatCloud cloud = cloudOf(600, 3);
  const HierarchyDecoder decoder = treeOf(cloud);
  SplatCloud moved = cloud;
  for (size_t i = 0; i < moved.size(); ++i) {
    moved.positions[3 * i + 2] += 0.02f * std::sin(5.0f * moved.positions[3 * i]);
  }
  const SplatCloud before = cutOf(decoder, 200), after = decoder.decodeMoved(moved, 200);
  ASSERT_EQ(after.size(), 200u);
  EXPECT_NO_THROW(validate(after, "cut"));
  const std::vector<uint32_t> ids = decoder.cut(200);
  size_t leaves = 0;
  for (size_t i = 0; i < 200; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      // No mean moves further than what it is the mean of.
      ASSERT_NEAR(after.positions[3 * i + axis], before.positions[3 * i + axis], 0.0201f);
    }
    // Axes turn by less than what would exchange two of them.
    double dot = 0;
    for (size_t k = 0; k < 4; ++k) {
      dot += static_cast<double>(after.rotations[4 * i + k] * before.rotations[4 * i + k]);
    }
    if (ids[i] >= 599) {
      const size_t row = ids[i] - 599;
      ASSERT_EQ(after.positions[3 * i + 2], moved.positions[3 * row + 2]);
      ++leaves;
    } else {
      ASSERT_GT(std::abs(dot), std::cos(0.25 * 3.15)) << i;
    }
  }
  EXPECT_GT(leaves, 10u);
}

TEST(MovedCut, IsSoundWhereSplatsVanishAndWhereTheTreeIsAChain) {
  SplatCloud cloud = cloudOf(20000, 4);
  // Each inner node has a leaf and all that comes after it.
  auto chain = std::make_shared<MergeTree>();
  chain->nodes = cloud;
  chain->nodes.resize(cloud.size() - 1);
  chain->errors.assign(cloud.size() - 1, 0.0f);
  chain->parents.assign(2 * cloud.size() - 1, MergeTree::kNoParent);
  const uint32_t inner = static_cast<uint32_t>(cloud.size() - 1);
  for (uint32_t i = 1; i < inner; ++i) chain->parents[i] = i - 1;
  for (uint32_t i = 0; i <= inner; ++i) chain->parents[inner + i] = std::min(i, inner - 1);
  const HierarchyDecoder decoder(std::make_shared<const SplatCloud>(cloud), chain);
  for (size_t i = 0; i < cloud.size(); i += 2) cloud.opacities[i] = 0;
  std::fill_n(cloud.scales.begin(), 300, 0.0f);
  SplatCloud one, two;
  withThreads(1, [&] { one = decoder.decodeMoved(cloud, 40); });
  withThreads(2, [&] { two = decoder.decodeMoved(cloud, 40); });
  EXPECT_NO_THROW(validate(one, "cut"));
  EXPECT_EQ(one.positions, two.positions);
  EXPECT_EQ(one.rotations, two.rotations);
  EXPECT_EQ(one.sh, two.sh);
  std::fill(cloud.opacities.begin(), cloud.opacities.end(), 0.0f);
  EXPECT_NO_THROW(validate(decoder.decodeMoved(cloud, 3), "cut"));
}

TEST(MovedCut, RefusesOtherSplatsAndStopsWhenCancelled) {
  const SplatCloud cloud = cloudOf(50, 5);
  const HierarchyDecoder decoder = treeOf(cloud);
  EXPECT_THROW(decoder.decodeMoved(cloudOf(51, 5), 10), Error);
  EXPECT_THROW(decoder.decodeMoved(cloudOf(50, 5, 2), 10), Error);
  EXPECT_THROW(decoder.decodeMoved(cloud, 0), Error);
  Progress progress;
  progress.cancel();
  EXPECT_THROW(decoder.decodeMoved(cloud, 10, &progress), Error);
}

}  // namespace
}  // namespace stipple
