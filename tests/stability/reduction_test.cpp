#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "decode/test_clouds.h"
#include "decode/tree/hierarchy_decoder.h"
#include "train/loop/refine.h"
#include "train/loop/view_rig.h"
#include "train/loop/visibility.h"

// Clouds that are hard to merge and to refine, with floating-point traps on. Every parent stays in
// the box of its leaves, harmonics included: it is their mean.

namespace stipple {
namespace {

using test::randomCloud;

struct Hard {
  std::string name;
  SplatCloud cloud;
};

std::vector<Hard> hardClouds() {
  std::vector<Hard> cases;
  const auto add = [&](const char* name, SplatCloud cloud) {
    cases.push_back({name, std::move(cloud)});
  };
  add("one splat", randomCloud(1, 1));
  add("two splats", randomCloud(2, 2));
  SplatCloud c = randomCloud(300, 3);
  for (size_t i = 0; i < c.size(); ++i) {
    c.scales[i * 3] = 1.0f;
    c.scales[i * 3 + 1] = c.scales[i * 3 + 2] = 1e-6f;
  }
  add("needles of one to a million", c);
  c = randomCloud(300, 4);
  for (size_t i = 0; i < c.size(); ++i) c.scales[i * 3 + i % 3] = 0.0f;
  add("discs without thickness", c);
  c = randomCloud(300, 5);
  std::ranges::fill(c.scales, 0.0f);
  add("points", c);
  c = randomCloud(300, 6);
  std::ranges::fill(c.scales, std::numeric_limits<float>::denorm_min());
  add("denormal scales", c);
  c = randomCloud(300, 7);
  for (size_t i = 0; i < c.positions.size(); ++i) c.positions[i] = c.positions[i % 3];
  add("one position", c);
  c = randomCloud(300, 8);
  std::ranges::fill(c.opacities, 0.0f);
  add("opacity 0", c);
  c = randomCloud(300, 9);
  std::ranges::fill(c.opacities, 1.0f);
  add("opacity 1", c);
  c = randomCloud(300, 10);
  for (size_t i = 0; i < c.size(); ++i) c.opacities[i] = static_cast<float>(i % 2);
  add("opacity 0 and 1", c);
  c = randomCloud(300, 11);
  for (size_t i = 0; i < c.size(); ++i) c.opacities[i] = i % 2 == 0 ? 1e-45f : 1e-20f;
  add("hardly any opacity", c);
  c = randomCloud(300, 12);
  for (float& x : c.positions) x += 1e6f;
  add("1000 km from the origin", c);
  for (const float size : {1e-30f, 1e-12f, 1e12f, 1e18f}) {
    c = randomCloud(300, 13);
    for (float& x : c.positions) x *= size;
    for (float& x : c.scales) x *= size;
    add(size < 1 ? "tiny coordinates" : "huge coordinates", c);
  }
  c = randomCloud(600, 14);
  for (size_t i = 0; i < 2; ++i) c.positions[i * 3] = i == 0 ? 1e15f : -1e15f;
  for (size_t i = 3; i < 6; ++i) c.scales[i] = 1e15f;
  add("outliers of 1e15 m", c);
  add("harmonics of degree 4", randomCloud(300, 15, 4));
  c = randomCloud(300, 16, 4);
  for (size_t i = 0; i < c.sh.size(); ++i) c.sh[i] *= 1e6f;
  add("colours of a million", c);
  c = randomCloud(1, 17);
  const SplatCloud one = c;
  c.resize(300);
  const auto repeat = [](std::vector<float>& to, const std::vector<float>& from) {
    for (size_t i = 0; i < to.size(); ++i) to[i] = from[i % from.size()];
  };
  repeat(c.positions, one.positions);
  repeat(c.rotations, one.rotations);
  repeat(c.scales, one.scales);
  repeat(c.opacities, one.opacities);
  repeat(c.sh, one.sh);
  add("all alike", c);
  return cases;
}

/// Per element of a row: least and largest over the leaves below each node, [2N-1, stride].
struct Hull {
  std::vector<float> low;
  std::vector<float> high;
};

Hull hullOf(const MergeTree& tree, const std::vector<float>& leaves, size_t stride) {
  const size_t inner = tree.nodes.size();
  const size_t count = tree.parents.size();
  Hull hull;
  hull.low.assign(count * stride, std::numeric_limits<float>::max());
  hull.high.assign(count * stride, -std::numeric_limits<float>::max());
  std::ranges::copy(leaves, hull.low.begin() + static_cast<long>(inner * stride));
  std::ranges::copy(leaves, hull.high.begin() + static_cast<long>(inner * stride));
  // Parents come before their children.
  for (size_t id = count; id-- > 1;) {
    const size_t parent = tree.parents[id];
    for (size_t k = 0; k < stride; ++k) {
      float& low = hull.low[parent * stride + k];
      float& high = hull.high[parent * stride + k];
      low = std::min(low, hull.low[id * stride + k]);
      high = std::max(high, hull.high[id * stride + k]);
    }
  }
  return hull;
}

/// In: digits: rounding that is allowed, absolute.
void expectInside(const MergeTree& tree, const std::vector<float>& inner,
                  const std::vector<float>& leaves, size_t stride, double digits) {
  const Hull hull = hullOf(tree, leaves, stride);
  for (size_t i = 0; i < inner.size(); ++i) {
    const double value = static_cast<double>(inner[i]);
    ASSERT_GE(value, static_cast<double>(hull.low[i]) - digits) << "element " << i;
    ASSERT_LE(value, static_cast<double>(hull.high[i]) + digits) << "element " << i;
  }
}

double largest(const std::vector<float>& values) {
  double most = 0;
  for (const float x : values) most = std::max(most, std::abs(static_cast<double>(x)));
  return most;
}

void expectSound(const SplatCloud& cloud, std::span<const float> visibility,
                 const MergeTreeOptions& options) {
  const auto tree = std::make_shared<const MergeTree>(buildMergeTree(cloud, visibility, options));
  const auto leaves = std::make_shared<const SplatCloud>(cloud);
  // Checks the tree; errors must be finite, for nothing else is at most the largest float.
  const HierarchyDecoder decoder(leaves, tree);
  for (const float error : tree->errors) ASSERT_TRUE(std::isfinite(error));
  if (tree->nodes.size() > 0) {
    ASSERT_NO_THROW(validate(tree->nodes, "nodes"));
  }
  // Means are made in double and rounded to float at the end, half a unit in the last place of the
  // largest; harmonics are rounded at every level, here fewer than 64 on the way to the root.
  constexpr double kUnit = 1.2e-7;
  expectInside(*tree, tree->nodes.positions, cloud.positions, 3, kUnit * largest(cloud.positions));
  expectInside(*tree, tree->nodes.sh, cloud.sh, cloud.shStride(), 64 * kUnit * largest(cloud.sh));
  for (const uint64_t budget :
       {uint64_t{1}, uint64_t{cloud.size() + 1} / 2, uint64_t{cloud.size()}}) {
    DecodeRequest request;
    request.budget = budget;
    const SplatCloud cut = decoder.decode(request);
    EXPECT_EQ(cut.size(), budget);
    EXPECT_NO_THROW(validate(cut, "cut"));
  }
}

TEST(ReductionStability, ParentsStayAmongTheirLeaves) {
  for (const Hard& hard : hardClouds()) {
    SCOPED_TRACE(hard.name);
    expectSound(hard.cloud, {}, {});
  }
}

TEST(ReductionStability, AnyFootprintAndVisibility) {
  for (const Hard& hard : hardClouds()) {
    SCOPED_TRACE(hard.name);
    std::vector<float> visibility(hard.cloud.size());
    for (size_t i = 0; i < visibility.size(); ++i) {
      visibility[i] = i % 3 == 0 ? 0.0f : i % 3 == 1 ? 1e-30f : 1.0f;
    }
    for (const double footprint : {1e-12, 1e12}) {
      expectSound(hard.cloud, visibility, {footprint});
    }
  }
}

TEST(ReductionStability, VisibilityIsAShare) {
  for (const Hard& hard : hardClouds()) {
    SCOPED_TRACE(hard.name);
    ViewRigOptions options;
    options.count = 3;
    options.size = 32;
    for (const ViewRig rig : {ViewRig::kAround, ViewRig::kInside, ViewRig::kAutomatic}) {
      options.rig = rig;
      const std::vector<float> seen = splatVisibility(
          *cpuBackends(), hard.cloud, viewsOfCloud(*cpuBackends(), hard.cloud, options));
      for (const float share : seen) ASSERT_TRUE(share >= 0.0f && share <= 1.0f) << share;
    }
  }
}

TEST(ReductionStability, RefinementKeepsTheCountAndEveryValueValid) {
  for (const Hard& hard : hardClouds()) {
    SCOPED_TRACE(hard.name);
    const HierarchyDecoder decoder(
        std::make_shared<const SplatCloud>(hard.cloud),
        std::make_shared<const MergeTree>(buildMergeTree(hard.cloud, {}, {})));
    DecodeRequest request;
    request.budget = (hard.cloud.size() + 1) / 2;
    RefineOptions options;
    options.iterations = 4;
    options.view_count = 2;
    options.view_size = 32;
    const SplatCloud cut = decoder.decode(request);
    const SplatCloud refined = refineCloud(*cpuBackends(), cut, hard.cloud, options);
    EXPECT_EQ(refined.size(), cut.size());
    EXPECT_NO_THROW(validate(refined, "refined"));
  }
}

TEST(ReductionStability, RefinementLeavesWhatNoViewShows) {
  const SplatCloud full = randomCloud(300, 21);
  SplatCloud start = full;
  for (float& x : start.sh) x *= 0.5f;
  // Behind every camera, or far beside what it sees: no gradient, so it stays where it is.
  start.positions[0] = 1e9f;
  RefineOptions options;
  options.iterations = 6;
  options.view_count = 3;
  options.view_size = 48;
  options.rig = ViewRig::kAround;
  const SplatCloud refined = refineCloud(*cpuBackends(), start, full, options);
  EXPECT_NO_THROW(validate(refined, "refined"));
  EXPECT_EQ(refined.positions[0], start.positions[0]);
  // Scales and opacities go through a logarithm and back.
  for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(refined.scales[k], start.scales[k], 1e-6f);
  EXPECT_NEAR(refined.opacities[0], start.opacities[0], 1e-6f);
  size_t moved = 0;
  for (size_t i = 1; i < full.size(); ++i) {
    moved += refined.positions[i * 3] != start.positions[i * 3] ? 1 : 0;
  }
  EXPECT_GT(moved, full.size() / 2);
}

}  // namespace
}  // namespace stipple
