#include "decode/tree/moving_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "decode/tree/hierarchy_decoder.h"
#include "decode/tree/moving_cost.h"
#include "decode/tree/moving_decoder.h"
#include "math/covariance.h"
#include "model/moving_cloud.h"

namespace stipple {
namespace {

constexpr double kEndOfClip = 23 / 24.0;

/// Splats that stand and are there all the time, in a clip of 24 frames and a second: places,
/// colours and motion are the test's.
MotionCloud stillCloud(size_t count) {
  MotionCloud moving;
  moving.splats.resize(count);
  std::ranges::fill(moving.splats.scales, 0.02f);
  std::ranges::fill(moving.splats.opacities, 0.8f);
  for (size_t i = 0; i < count; ++i) moving.splats.rotations[4 * i] = 1;
  for (auto& wave : moving.waves) wave.resize(3 * count);
  moving.phases.resize(4 * count);
  moving.spins.resize(4 * count);
  moving.lifespans.assign(2 * count, 1.1f);
  moving.centres.assign(count, 0.5f);
  moving.clip.frames_per_second = 24;
  moving.clip.frame_count = 24;
  return moving;
}

float drawn(uint64_t stream, size_t i, float from, float to) {
  return from + (to - from) * unitFloat(keyedBits(stream, RandomUse::kThinning, i));
}

std::shared_ptr<const MovingTree> treeOf(const MotionCloud& moving) {
  return std::make_shared<const MovingTree>(buildMovingTree(moving, {}, {}));
}

SplatCloud cutOf(const MovingDecoder& decoder, uint64_t budget, double seconds) {
  DecodeRequest request;
  request.budget = budget;
  request.time = seconds;
  return decoder.decode(request);
}

/// How many nodes of a cut have leaves of both kinds below, by a number of each leaf.
size_t mixedNodes(const TreeShape& shape, uint64_t budget, const std::function<int(size_t)>& kind) {
  const size_t inner = shape.errors.size();
  std::vector<int> kinds(shape.parents.size(), 0);  // bits
  for (size_t i = 0; i <= inner; ++i) kinds[inner + i] = 1 << kind(i);
  for (size_t id = shape.parents.size(); id-- > 1;) kinds[shape.parents[id]] |= kinds[id];
  size_t mixed = 0;
  for (const uint32_t id : cutOfShape(shape, budget)) mixed += kinds[id] == 3 ? 1 : 0;
  return mixed;
}

/// Two crowds that start apart, are in one place in the middle of the clip and part again.
MotionCloud crossingCrowds() {
  constexpr size_t kEach = 400;
  MotionCloud moving = stillCloud(2 * kEach);
  for (size_t i = 0; i < 2 * kEach; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      moving.splats.positions[3 * i + axis] = drawn(1 + axis, i, -0.4f, 0.4f);
    }
    // The sine of one period of the clip, 0 in its middle.
    moving.waves[1][3 * i] = i < kEach ? 2.0f : -2.0f;
  }
  return moving;
}

TEST(MovingTree, CrowdsThatMeetAndPartDoNotMerge) {
  const MotionCloud moving = crossingCrowds();
  const auto crowd = [&](size_t i) { return i < moving.size() / 2 ? 0 : 1; };
  const uint64_t budget = moving.size() / 8;
  EXPECT_EQ(mixedNodes(*treeOf(moving), budget, crowd), 0u);
  // Of the time where they meet alone, most merges are across.
  const MergeTree still = buildMergeTree(splatsAt(moving, 0.5), {}, {});
  EXPECT_GT(mixedNodes(still, budget, crowd), budget / 2);
}

TEST(MovingTree, ACutFollowsItsLeavesAtEveryTime) {
  const MotionCloud moving = crossingCrowds();
  const MovingDecoder decoder(moving, treeOf(moving));
  for (const double time : {0.0, 0.25, 0.5, 0.7, kEndOfClip}) {
    const SplatCloud all = splatsAt(moving, time), cut = cutOf(decoder, 100, time);
    // In every part of the line that both walk, as much is covered as before: nobody stands between
    // the crowds.
    const auto leftmost = [](const SplatCloud& cloud) {
      double least = 1e9, most = -1e9, nearest = 1e9;
      for (size_t i = 0; i < cloud.size(); ++i) {
        const double x = static_cast<double>(cloud.positions[3 * i]);
        least = std::min(least, x);
        most = std::max(most, x);
        nearest = std::min(nearest, std::abs(x));
      }
      return std::array{least, most, nearest};
    };
    const auto wanted = leftmost(all), seen = leftmost(cut);
    // A node of eight of 400 in a box of 0.8 m is within 0.2 m of the leaves at the sides.
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(seen[k], wanted[k], 0.2) << time << ' ' << k;
  }
}

TEST(MovingTree, LivesThatDoNotOverlapStayApart) {
  // Pairs in the same places, the one early and the other late; neighbours of the same time are
  // farther away than their size, and still cheaper.
  constexpr size_t kPlaces = 200;
  MotionCloud moving = stillCloud(2 * kPlaces);
  moving.clip.frame_count = 200;
  for (size_t i = 0; i < 2 * kPlaces; ++i) {
    for (size_t axis = 0; axis < 2; ++axis) {
      moving.splats.positions[3 * i + axis] = drawn(axis, i % kPlaces, -0.15f, 0.15f);
    }
    moving.centres[i] = i < kPlaces ? 0.25f : 0.75f;
    moving.lifespans[2 * i] = moving.lifespans[2 * i + 1] = 0.1f;
  }
  const auto life = [&](size_t i) { return i < kPlaces ? 0 : 1; };
  EXPECT_EQ(mixedNodes(*treeOf(moving), kPlaces / 2, life), 0u);
  // Where all live at once, places decide.
  std::ranges::fill(moving.centres, 0.5f);
  EXPECT_GT(mixedNodes(*treeOf(moving), kPlaces / 2, life), kPlaces / 4);
}

TEST(MovingTree, SpinsThatDifferStayApart) {
  // Long splats in pairs, far from each other, one that turns over the clip and one that does not.
  constexpr size_t kPlaces = 100;
  MotionCloud moving = stillCloud(2 * kPlaces);
  for (size_t i = 0; i < 2 * kPlaces; ++i) {
    moving.splats.positions[3 * i] = static_cast<float>(i % 10);
    moving.splats.positions[3 * i + 1] =
        static_cast<float>(i % kPlaces / 10) + (i < kPlaces ? 0 : 0.002f);
    moving.splats.scales[3 * i] = 0.2f;
    moving.splats.opacities[i] = 0.1f;  // so that two of them add up without much error
  }
  const auto turns = [&](size_t i) { return i < kPlaces ? 0 : 1; };
  const float alike = treeOf(moving)->errors[kPlaces];
  EXPECT_EQ(mixedNodes(*treeOf(moving), kPlaces, turns), kPlaces);
  for (size_t i = kPlaces; i < 2 * kPlaces; ++i) moving.spins[4 * i + 3] = 3;
  const auto tree = treeOf(moving);
  EXPECT_GT(tree->errors[kPlaces], 10 * alike);
}

TEST(MovingTree, EqualSplatsBecomeOneThatMovesLikeThem) {
  MotionCloud moving = test::movingCloud(2);
  // As faint that opacities add up; a life that is long beside a part of the clip.
  for (size_t i = 0; i < 2; ++i) moving.splats.opacities[i] = 0.01f;
  test::makeAlike(moving);
  const auto tree = treeOf(moving);
  EXPECT_LT(tree->errors[0], 1e-6);
  const MovingDecoder decoder(moving, tree);
  for (double time = moving.clip.begin; time <= moving.clip.end(); time += 0.1) {
    const SplatCloud both = splatsAt(moving, time), one = cutOf(decoder, 1, time);
    for (size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(one.positions[axis], both.positions[axis], 2e-6) << time;
    }
    const Mat3d wanted = covariance<double>(both.rotations.data(), both.scales.data());
    const Mat3d seen = covariance<double>(one.rotations.data(), one.scales.data());
    EXPECT_LT((wanted - seen).norm(), 2e-6 * wanted.norm()) << time;
    // 1 - (1 - o)^2 and the depth of a sum differ by parts of o.
    EXPECT_NEAR(one.opacities[0], 2 * both.opacities[0], 0.02f * both.opacities[0]) << time;
  }
  EXPECT_EQ(tree->nodes.splats.sh,
            std::vector<float>(moving.splats.sh.begin(), moving.splats.sh.begin() + 12));
}

TEST(MovingTree, APathAboutAnotherMomentStaysWhereItIs) {
  const MotionCloud moving = test::movingCloud(1);
  MotionPath path = pathOf(moving, 0, {});
  // Of slow harmonics: the highest ones bend where windows end, and are half lost.
  for (size_t row = 3; row < kPathRows; ++row) path[row] = {};
  MotionClip clip = moving.clip;
  clip.frame_count = 100;
  const MovingScale scale = movingScale({}, clip, 32);
  std::array<double, 3 * kMostMergeTimes> wanted, seen;
  samplePath(path, 0.3, scale, wanted.data());
  samplePath(pathAbout(path, 0.3, 0.42, scale.window), 0.42, scale, seen.data());
  double length = 0, off = 0;
  for (size_t i = 0; i < 96; ++i) {
    length += std::pow(wanted[i] - path[0][i / 32], 2);
    off += std::pow(wanted[i] - seen[i], 2);
  }
  // Two windows that differ by an eighth of the clip bend the path at other times: measured 2.6e-3.
  EXPECT_LT(off, 5e-3 * length);
  EXPECT_EQ(pathAbout(path, 0.3, 0.3, scale.window), path);
}

TEST(MovingTree, LifespansComeBackFromTheirRates) {
  MotionClip clip;
  clip.frame_count = 300;
  const MovingScale scale = movingScale({}, clip, 16);
  for (const double life : {0.02, 0.1, 0.5, 1.1}) {
    const auto back = lifespansOfRates(broadLife({life, 2 * life}, scale).rates, scale);
    EXPECT_NEAR(back[0], life, 1e-12);
    EXPECT_NEAR(back[1], std::min(2 * life, kLargestLifespan), 1e-12);
  }
  // A splat of one frame is no longer than a frame.
  const double frame = scale.window.near / 300;
  EXPECT_LE(lifespansOfRates(broadLife({1e-6, 1e-6}, scale).rates, scale)[0], 0.5 * frame + 1e-9);
}

TEST(MovingTree, ShortFlashesMergeWithTheirOwnTimeOnly) {
  // In each of ten places two early ones and two late ones.
  MotionCloud moving = stillCloud(40);
  moving.clip.frame_count = 300;
  for (size_t i = 0; i < 40; ++i) {
    moving.splats.positions[3 * i] = 0.2f * static_cast<float>(i / 4);
    moving.splats.positions[3 * i + 1] = drawn(1, i, 0, 0.004f);
    moving.centres[i] = i % 2 == 0 ? 40 / 300.0f : 200 / 300.0f;
    moving.lifespans[2 * i] = moving.lifespans[2 * i + 1] = 1e-6f;
  }
  const auto tree = treeOf(moving);
  EXPECT_EQ(mixedNodes(*tree, 20, [](size_t i) { return static_cast<int>(i % 2); }), 0u);
  const MovingDecoder decoder(moving, tree);
  const SplatCloud flash = cutOf(decoder, 20, 40 / 24.0), later = cutOf(decoder, 20, 60 / 24.0);
  EXPECT_EQ(std::ranges::count_if(flash.opacities, [](float o) { return o > 0.8f; }), 10);
  EXPECT_EQ(std::ranges::count_if(flash.opacities, [](float o) { return o < 1e-6f; }), 10);
  EXPECT_EQ(std::ranges::count_if(later.opacities, [](float o) { return o < 1e-6f; }), 20);
}

TEST(MovingTree, OfOneFrameIsTheTreeOfSplatsThatStand) {
  constexpr size_t kCount = 600;
  MotionCloud moving = stillCloud(kCount);
  moving.clip.frame_count = 1;
  std::ranges::fill(moving.centres, 0.0f);
  for (size_t i = 0; i < kCount; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      moving.splats.positions[3 * i + axis] = drawn(axis, i, 0, 1);
      moving.splats.scales[3 * i + axis] = drawn(3 + axis, i, 0.002f, 0.03f);
      moving.splats.sh[3 * i + axis] = drawn(6 + axis, i, -1, 1);
    }
    for (size_t k = 0; k < 4; ++k) moving.splats.rotations[4 * i + k] = drawn(10 + k, i, 0.1f, 1);
  }
  const auto tree = treeOf(moving);
  const MergeTree still = buildMergeTree(splatsAt(moving, 0), {}, {});
  size_t same = 0;
  for (size_t i = 0; i < kCount - 1; ++i) {
    // Nodes are kept as float32 here and as double there.
    same += std::abs(tree->errors[i] - still.errors[i]) <= 1e-3f * still.errors[i] ? 1 : 0;
  }
  // Where two costs agree to seven digits another pair merges.
  EXPECT_GT(same, kCount * 95 / 100);
}

TEST(MovingTree, EveryBudgetIsExactAndTheSameNodesAtAllTimes) {
  constexpr size_t kCount = 300;
  const MotionCloud moving = test::movingCloud(kCount);
  const MovingDecoder decoder(moving, treeOf(moving));
  for (const uint64_t budget : {1, 2, 77, 150, 299}) {
    const std::vector<uint32_t> ids = decoder.cut(budget);
    for (const double time : {2.0, 2.4, 3.375}) {
      const SplatCloud cut = cutOf(decoder, budget, time);
      EXPECT_EQ(cut.size(), budget);
      validate(cut, "cut");
      // Scales and colours do not change with time: row by row those of the nodes.
      for (size_t i = 0; i < ids.size(); ++i) {
        const bool inner = ids[i] < kCount - 1;
        const SplatCloud& from = inner ? decoder.tree()->nodes.splats : moving.splats;
        const size_t row = inner ? ids[i] : ids[i] - (kCount - 1);
        for (size_t k = 0; k < 3; ++k) {
          ASSERT_EQ(cut.scales[3 * i + k], from.scales[3 * row + k]);
          ASSERT_EQ(cut.sh[12 * i + k], from.sh[12 * row + k]);
        }
      }
    }
  }
  EXPECT_EQ(cutOf(decoder, kCount, 2.4).positions, splatsAt(moving, 2.4).positions);
  EXPECT_THROW(cutOf(decoder, 0, 2), Error);
  EXPECT_THROW(cutOf(decoder, kCount + 1, 2), Error);
}

TEST(MovingTree, GrowingBudgetsSplitOneNodeEach) {
  const MotionCloud moving = test::movingCloud(120);
  const MovingDecoder decoder(moving, treeOf(moving));
  std::vector<uint32_t> before = decoder.cut(1);
  for (uint64_t budget = 2; budget <= 120; ++budget) {
    const std::vector<uint32_t> ids = decoder.cut(budget);
    std::vector<uint32_t> gone;
    std::ranges::set_difference(before, ids, std::back_inserter(gone));
    EXPECT_EQ(gone.size(), 1u);
    before = ids;
  }
  EXPECT_TRUE(std::ranges::is_sorted(decoder.tree()->errors, std::greater()));
}

TEST(MovingTree, IsBuiltByTheFirstSmallerBudgetAndIsTheSame) {
  const MotionCloud moving = test::movingCloud(200);
  const MovingDecoder with(moving, treeOf(moving)), without(moving);
  EXPECT_EQ(cutOf(without, 200, 2.5).positions, cutOf(with, 200, 2.5).positions);
  EXPECT_EQ(without.tree(), nullptr);
  EXPECT_GT(without.memoryBound(50, 1), with.memoryBound(50, 1));
  Progress progress;
  progress.cancel();
  DecodeRequest request;
  request.budget = 50;
  request.progress = &progress;
  EXPECT_THROW(without.decode(request), Error);
  EXPECT_EQ(cutOf(without, 50, 2.5).positions, cutOf(with, 50, 2.5).positions);
  EXPECT_NE(without.tree(), nullptr);
}

TEST(MovingTree, IsTheSameForAnyNumberOfThreads) {
  const MotionCloud moving = test::movingCloud(3000);
  MovingTree one, four;
  withThreads(1, [&] { one = buildMovingTree(moving, {}, {}); });
  withThreads(4, [&] { four = buildMovingTree(moving, {}, {}); });
  EXPECT_EQ(one.parents, four.parents);
  EXPECT_EQ(one.errors, four.errors);
  EXPECT_EQ(one.nodes.splats.positions, four.nodes.splats.positions);
  EXPECT_EQ(one.nodes.waves, four.nodes.waves);
  EXPECT_EQ(one.nodes.lifespans, four.nodes.lifespans);
  EXPECT_EQ(one.nodes.spins, four.nodes.spins);
}

TEST(MovingTree, KernelsGiveTheSameBitsAndCountBothNodesAlike) {
  constexpr size_t kCount = 40;
  const MotionCloud moving = test::movingCloud(kCount);
  for (const size_t times : {size_t{1}, size_t{5}, size_t{12}}) {
    MergeScale space;
    space.footprint = 1e-5;
    const MovingScale scale = movingScale(space, moving.clip, times);
    const size_t length = MovingField::kCount * scale.stride;
    std::vector<MovingNode> nodes(kCount);
    std::vector<float> samples(kCount * length);
    std::vector<uint32_t> all(kCount);
    for (size_t i = 0; i < kCount; ++i) {
      all[i] = static_cast<uint32_t>(i);
      nodes[i] = movingLeaf(moving, i, 1, pathOf(moving, i, space), scale, &samples[i * length]);
      nodes[i].around = {0.1, 0.2, 0.05 * static_cast<double>(i % 7)};
    }
    const MovingNodeRows rows = {nodes.data(), samples.data(), &scale};
    const std::vector<MovingMergeKernel> kernels = movingMergeKernels();
    ASSERT_GE(kernels.size(), 2u);
    std::vector<float> wanted(kCount), seen(kCount);
    for (uint32_t slot = 0; slot < kCount; ++slot) {
      kernels[0].costs(rows, slot, all.data(), kCount, wanted.data());
      MovingMerge merged;
      kernels[0].merge(rows, slot, 3, nullptr, merged);
      EXPECT_EQ(static_cast<float>(merged.error), wanted[3]);
      for (const MovingMergeKernel& kernel : kernels) {
        kernel.costs(rows, slot, all.data(), kCount, seen.data());
        EXPECT_EQ(seen, wanted) << kernel.target;
        float back;
        kernel.costs(rows, 3, &slot, 1, &back);
        EXPECT_EQ(back, wanted[3]) << kernel.target;
        MovingMerge other;
        kernel.merge(rows, slot, 3, nullptr, other);
        EXPECT_TRUE(std::equal(merged.samples.begin(), merged.samples.begin() + length,
                               other.samples.begin()))
            << kernel.target;
      }
    }
  }
}

TEST(MovingTree, RefusesWhatNoTreeTakes) {
  const MotionCloud moving = test::movingCloud(3);
  EXPECT_THROW(buildMovingTree({}, {}, {}), Error);
  const std::vector<float> few(2, 1.0f), wrong(3, 2.0f);
  EXPECT_THROW(buildMovingTree(moving, few, {}), Error);
  EXPECT_THROW(buildMovingTree(moving, wrong, {}), Error);
  MovingTreeOptions options;
  options.times = 0;
  EXPECT_THROW(buildMovingTree(moving, {}, options), Error);
  options.times = kMostMergeTimes + 1;
  EXPECT_THROW(buildMovingTree(moving, {}, options), Error);
  options.times = 4;
  options.footprint = -1;
  EXPECT_THROW(buildMovingTree(moving, {}, options), Error);
  EXPECT_THROW(MovingDecoder(test::movingCloud(4), treeOf(moving)), Error);
}

}  // namespace
}  // namespace stipple
