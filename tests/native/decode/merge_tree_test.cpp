#include "decode/tree/merge_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/test_clouds.h"
#include "decode/tree/hierarchy_decoder.h"
#include "decode/tree/merge_cost.h"
#include "decode/tree/merge_node.h"
#include "math/covariance.h"

namespace stipple {
namespace {

using test::randomCloud;

HierarchyDecoder decoderOf(const SplatCloud& cloud, std::span<const float> visibility = {},
                           const MergeTreeOptions& options = {}) {
  auto leaves = std::make_shared<const SplatCloud>(cloud);
  auto tree = std::make_shared<const MergeTree>(buildMergeTree(cloud, visibility, options));
  return {leaves, tree};
}

SplatCloud cutOf(const HierarchyDecoder& decoder, uint64_t budget) {
  DecodeRequest request;
  request.budget = budget;
  return decoder.decode(request);
}

void expectSame(const SplatCloud& a, const SplatCloud& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.rotations, b.rotations);
  EXPECT_EQ(a.scales, b.scales);
  EXPECT_EQ(a.opacities, b.opacities);
  EXPECT_EQ(a.sh, b.sh);
}

/// Integral of -ln(1 - o exp(-r^2/2)) r dr by Simpson's rule over t = r^2 / 2, 0 to 40.
double depthByQuadrature(double opacity) {
  constexpr int kSteps = 200000;
  const double step = 40.0 / kSteps;
  double sum = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double factor = i == 0 || i == kSteps ? 1 : i % 2 == 1 ? 4 : 2;
    sum -= factor * std::log1p(-opacity * std::exp(-step * i));
  }
  return sum * step / 3;
}

/// Over 2 pi: the root of the mean of the squared areas over three orthogonal directions.
double areaOf(const Mat3d& c) {
  const double xy = c(0, 0) * c(1, 1) - c(0, 1) * c(0, 1);
  const double xz = c(0, 0) * c(2, 2) - c(0, 2) * c(0, 2);
  const double yz = c(1, 1) * c(2, 2) - c(1, 2) * c(1, 2);
  return std::sqrt((xy + xz + yz) / 3);
}

TEST(MergeNode, OpticalDepthIsItsIntegralAndComesBack) {
  for (const double opacity : {0.001, 0.2, 0.499, 0.501, 0.9, 0.99}) {
    // Simpson with a step of 2e-4 on a smooth function: far below 1e-9.
    EXPECT_NEAR(opticalDepth(opacity), depthByQuadrature(opacity), 1e-9);
    // 512 cubic pieces.
    EXPECT_NEAR(opacityOfDepth(opticalDepth(opacity)), opacity, 1e-7);
  }
  EXPECT_EQ(opticalDepth(0), 0);
  EXPECT_NEAR(opticalDepth(1), std::numbers::pi * std::numbers::pi / 6, 1e-15);
  EXPECT_EQ(opacityOfDepth(10), kMergeMaxOpacity);
}

TEST(MergeNode, ErrorIsTheSquaredChangeOfThreeProjections) {
  SplatCloud cloud = randomCloud(2, 5, 0);
  for (float& x : cloud.positions) x *= 0.05f;
  MergeScale scale;
  scale.footprint = 1e-4;
  MergeNode a = leafNode(cloud, 0, 0.5, scale);
  MergeNode b = leafNode(cloud, 1, 1.0, scale);
  a.around = {0.2, 0.4, 0.6};
  b.around = {0.3, 0.1, 0.5};
  MergeNode m = mergedNode(a, b, scale);
  m.inflation = 1.5;  // plane sizes with it: those of 1.5 times the covariance
  for (size_t plane = 0; plane < 3; ++plane) {
    const auto entry = [&](size_t k) { return 1.5 * m.covariance[kPlaneEntries[plane][k]]; };
    const double f = scale.footprint;
    m.plane_size[plane] = std::sqrt((entry(0) + f) * (entry(2) + f) - entry(1) * entry(1));
  }
  // Colour less what is around both, and coverage, on a grid of each coordinate plane.
  double sum = 0;
  const int axes[3][2] = {{0, 1}, {0, 2}, {1, 2}};
  const size_t entries[3][3] = {{0, 1, 3}, {0, 2, 5}, {3, 4, 5}};
  constexpr int kHalf = 250;
  constexpr double kStep = 0.25 / kHalf;
  for (int plane = 0; plane < 3; ++plane) {
    const auto profile = [&](const MergeNode& node, double x, double y) {
      const double xx = node.inflation * node.covariance[entries[plane][0]] + scale.footprint;
      const double xy = node.inflation * node.covariance[entries[plane][1]];
      const double yy = node.inflation * node.covariance[entries[plane][2]] + scale.footprint;
      const double det = xx * yy - xy * xy;
      const double dx = x - node.mean[static_cast<size_t>(axes[plane][0])];
      const double dy = y - node.mean[static_cast<size_t>(axes[plane][1])];
      return node.contrast * node.opacity *
             std::exp(-0.5 * (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / det);
    };
    for (int i = -kHalf; i <= kHalf; ++i) {
      for (int j = -kHalf; j <= kHalf; ++j) {
        const double x = m.mean[static_cast<size_t>(axes[plane][0])] + i * kStep;
        const double y = m.mean[static_cast<size_t>(axes[plane][1])] + j * kStep;
        const double pa = profile(a, x, y);
        const double pb = profile(b, x, y);
        const double pm = profile(m, x, y);
        double squared = kCoverageShare * (pa + pb - pm) * (pa + pb - pm);
        for (size_t c = 0; c < 3; ++c) {
          const double behind = 0.5 * (a.around[c] + b.around[c]);
          const double change = pa * (a.colour[c] - behind) + pb * (b.colour[c] - behind) -
                                pm * (m.colour[c] - behind);
          squared += change * change;
        }
        sum += squared * kStep * kStep;
      }
    }
  }
  // The grid ends at eight standard deviations and its sums of Gaussians are exact to 1e-8.
  EXPECT_NEAR(mergeError(a, b, m, scale) / sum, 1.0, 1e-6);
}

/// Two round splats of an opacity, this many standard deviations apart.
MergeNode mergedPair(double apart, float opacity, double visibility) {
  SplatCloud cloud = randomCloud(2, 1, 0);
  for (size_t k = 0; k < 6; ++k) {
    cloud.positions[k] = 0.0f;
    cloud.scales[k] = 0.1f;
  }
  cloud.positions[3] = static_cast<float>(0.1 * apart);
  cloud.opacities = {opacity, opacity};
  MergeScale scale;
  scale.footprint = 1e-12;
  return mergedNode(leafNode(cloud, 0, visibility, scale), leafNode(cloud, 1, visibility, scale),
                    scale);
}

TEST(MergeNode, IsDrawnLargerOnlyWhereOpaqueLeavesLieApartInTheOpen) {
  // Two standard deviations apart: the covariance doubles along one axis, so the three areas are
  // 1, sqrt 2 and sqrt 2 of a leaf's, their root mean square sqrt(5/3), and of the area 1 - 0.77 is
  // between the leaves.
  const double area = std::sqrt(5.0 / 3.0);
  const double spacing = 1 - 1 / area;
  const MergeNode seen = mergedPair(2, 0.9999f, 1);
  EXPECT_NEAR(seen.inflation, 1 + spacing * spacing, 1e-6);
  // Its moments stay exact: the parent's are those of all leaves.
  EXPECT_NEAR(seen.covariance[0], 0.02, 1e-8);
  EXPECT_NEAR(seen.covariance[3], 0.01, 1e-8);
  // Half as visible as it must be for the whole of it.
  const MergeNode half = mergedPair(2, 0.9999f, 0.5 * kFullInflationVisibility);
  EXPECT_NEAR(half.inflation, 1 + 0.5 * spacing * spacing, 1e-6);
  EXPECT_EQ(mergedPair(2, 0.9999f, 0).inflation, 1);
  EXPECT_NEAR(mergedPair(0, 0.9999f, 1).inflation, 1, 1e-12);
  // Depths of 0.43 each fit into an opacity of 1.
  EXPECT_EQ(mergedPair(2, 0.4f, 1).inflation, 1);
  EXPECT_LE(mergedPair(1000, 0.9999f, 1).inflation, 2);
}

TEST(MergeNode, SurroundingIsTheMeanColourByHowFarItHides) {
  MergeNode red, green;
  red.colour = {1, 0, 0};
  red.opacity = 0.8;
  red.area = 1;
  green.colour = {0, 1, 0};
  green.opacity = 0.2;
  green.area = 2;
  Surrounding surrounding;
  EXPECT_EQ(surrounding.mean(), (std::array<double, 3>{0, 0, 0}));
  surrounding.add(red);
  surrounding.add(green);
  // Weights 0.8 and 0.4: mean opacity 0.6.
  const double share = kSurroundingShare + kOpaqueSurroundingShare * 0.6;
  EXPECT_NEAR(surrounding.mean()[0], share * 2 / 3, 1e-15);
  EXPECT_NEAR(surrounding.mean()[1], share / 3, 1e-15);
  EXPECT_EQ(surrounding.mean()[2], 0);
}

TEST(MergeNode, CostsAreTheSameBitsByEveryKernelAndFromBothEnds) {
  SplatCloud cloud = randomCloud(60, 8, 0);
  for (size_t i = 0; i < 30 * 3; ++i) cloud.positions[i] *= 0.01f;
  // A needle, a speck, one as large as the cloud, one that cannot be seen, twins, one far away.
  cloud.scales[0] = 3.0f;
  cloud.scales[1] = cloud.scales[2] = 1e-7f;
  for (size_t k = 3; k < 6; ++k) cloud.scales[k] = 1e-9f;
  for (size_t k = 6; k < 9; ++k) cloud.scales[k] = 2.0f;
  cloud.opacities[3] = 0.0f;
  std::copy_n(&cloud.positions[4 * 3], 3, &cloud.positions[5 * 3]);
  cloud.positions[6 * 3] = 1e12f;
  MergeScale scale;
  scale.footprint = 1e-6;
  std::vector<MergeNode> nodes;
  for (size_t i = 0; i < 60; ++i) {
    nodes.push_back(leafNode(cloud, i, i % 7 == 0 ? 0.003 : 0.1 + 0.01 * double(i), scale));
    nodes.back().around = {0.1, 0.01 * double(i), 0.7};
    if (i % 5 == 0) nodes.back().depth *= 4;  // of many leaves in one place
    if (i % 10 == 0) nodes.back().leaf_area *= 0.2;
    if (i % 15 == 0) nodes.back().inflation = 1.7;
  }
  std::vector<uint32_t> others;
  for (uint32_t i = 0; i < 60; ++i) others.push_back(i * 7 % 60);
  const std::vector<MergeCostKernel> kernels = mergeCostKernels();
  ASSERT_GE(kernels.size(), 2u);
  for (const MergeCostKernel& kernel : kernels) {
    for (uint32_t slot = 0; slot < 60; ++slot) {
      // Every length: 1 to 60, so that vectors end anywhere.
      std::vector<float> costs(slot + 1, -1.0f);
      kernel.costs(nodes.data(), slot, others.data(), slot + 1, scale, costs.data());
      for (size_t k = 0; k <= slot; ++k) {
        const MergeNode& other = nodes[others[k]];
        const double expected =
            mergeError(nodes[slot], other, mergedNode(nodes[slot], other, scale), scale);
        EXPECT_EQ(costs[k], static_cast<float>(expected)) << kernel.target;
        float back = -1.0f;
        kernel.costs(nodes.data(), others[k], &slot, 1, scale, &back);
        EXPECT_EQ(costs[k], back) << kernel.target;
      }
    }
  }
}

TEST(MergeTree, RootHasTheMomentsOfAllLeaves) {
  const SplatCloud cloud = randomCloud(60, 3, 2);
  std::vector<float> visibility(60);
  for (size_t i = 0; i < 60; ++i) visibility[i] = 0.1f + 0.015f * static_cast<float>(i);
  MergeTreeOptions options;
  options.footprint = 1e-6;  // adds 1e-12 to variances of at least 4e-6
  const MergeTree tree = buildMergeTree(cloud, visibility, options);
  double mass = 0;
  Vec3d mean = Vec3d::Zero();
  Mat3d second = Mat3d::Zero();
  std::vector<double> sh(cloud.shStride(), 0.0);
  for (size_t i = 0; i < 60; ++i) {
    const Mat3d c = covariance<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]);
    const double m =
        static_cast<double>(visibility[i]) * static_cast<double>(cloud.opacities[i]) * areaOf(c);
    const Vec3d p(static_cast<double>(cloud.positions[i * 3]),
                  static_cast<double>(cloud.positions[i * 3 + 1]),
                  static_cast<double>(cloud.positions[i * 3 + 2]));
    mass += m;
    mean += m * p;
    second += m * (c + p * p.transpose());
    for (size_t k = 0; k < sh.size(); ++k) {
      sh[k] += m * static_cast<double>(cloud.sh[i * sh.size() + k]);
    }
  }
  mean /= mass;
  const Mat3d expected = second / mass - mean * mean.transpose();
  const Mat3d seen = covariance<double>(tree.nodes.rotations.data(), tree.nodes.scales.data());
  // Stored as float32 numbers of about 1: a few units of 6e-8. Harmonics are rounded once per
  // level.
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(static_cast<double>(tree.nodes.positions[static_cast<size_t>(axis)]), mean[axis],
                1e-6);
  }
  EXPECT_LT((seen - expected).norm(), 1e-6 * expected.norm());
  for (size_t k = 0; k < sh.size(); ++k) {
    EXPECT_NEAR(static_cast<double>(tree.nodes.sh[k]), sh[k] / mass, 1e-5);
  }
}

TEST(MergeTree, PairKeepsItsOpticalDepth) {
  SplatCloud cloud = randomCloud(2, 9, 0);
  cloud.opacities = {0.3f, 0.6f};
  MergeTreeOptions options;
  options.footprint = 1e-6;
  const MergeTree tree = buildMergeTree(cloud, {}, options);
  double depth = 0;
  for (size_t i = 0; i < 2; ++i) {
    depth += opticalDepth(static_cast<double>(cloud.opacities[i])) *
             areaOf(covariance<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]));
  }
  const double area =
      areaOf(covariance<double>(tree.nodes.rotations.data(), tree.nodes.scales.data()));
  EXPECT_NEAR(opticalDepth(static_cast<double>(tree.nodes.opacities[0])) * area, depth,
              1e-6 * depth);
}

/// A wall of overlapping, nearly opaque flat splats in x and y, one colour per unit square.
SplatCloud checkeredWall(size_t side) {
  SplatCloud cloud = randomCloud(side * side, 6, 0);
  constexpr double kSquares = 4;
  const float step = static_cast<float>(kSquares / static_cast<double>(side));
  for (size_t i = 0; i < cloud.size(); ++i) {
    float* p = &cloud.positions[i * 3];
    // The random places of the cloud jitter it.
    p[0] = (static_cast<float>(i % side) + 0.3f * p[0]) * step;
    p[1] = (static_cast<float>(i / side) + 0.3f * p[1]) * step;
    p[2] = 0.0f;
    const bool is_light = (static_cast<int>(p[0]) + static_cast<int>(p[1])) % 2 == 0;
    for (size_t k = 0; k < 3; ++k) {
      cloud.scales[i * 3 + k] = k == 2 ? 1e-4f : step;
      cloud.sh[i * 3 + k] = is_light ? 1.5f : -1.0f;
    }
    cloud.rotations[i * 4] = 1.0f;
    std::fill_n(&cloud.rotations[i * 4 + 1], 3, 0.0f);
    cloud.opacities[i] = 0.99f;
  }
  return cloud;
}

/// What passes through at a place of the plane z = 0, along z.
double transmittanceAt(const SplatCloud& cloud, double x, double y) {
  double left = 1;
  for (size_t i = 0; i < cloud.size(); ++i) {
    const Mat3d c = covariance<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]);
    const double dx = x - static_cast<double>(cloud.positions[i * 3]);
    const double dy = y - static_cast<double>(cloud.positions[i * 3 + 1]);
    const double det = c(0, 0) * c(1, 1) - c(0, 1) * c(0, 1);
    const double squared = (c(1, 1) * dx * dx - 2 * c(0, 1) * dx * dy + c(0, 0) * dy * dy) / det;
    left *= 1 - static_cast<double>(cloud.opacities[i]) * std::exp(-0.5 * squared);
  }
  return left;
}

TEST(MergeTree, WallsStayClosed) {
  const SplatCloud wall = checkeredWall(64);
  const SplatCloud cut = cutOf(decoderOf(wall), wall.size() / 20);
  double sum = 0;
  int count = 0;
  for (double x = 0.5; x < 3.5; x += 0.05) {
    for (double y = 0.5; y < 3.5; y += 0.05) {
      sum += transmittanceAt(cut, x, y);
      ++count;
    }
  }
  // Gaussians with the moments of their share of the wall alone let 0.18 through.
  EXPECT_LT(sum / count, 0.03);
}

TEST(MergeTree, SplatsGoWhereColoursChange) {
  const SplatCloud wall = checkeredWall(64);
  const SplatCloud cut = cutOf(decoderOf(wall), wall.size() / 4);
  size_t near = 0;
  for (size_t i = 0; i < cut.size(); ++i) {
    for (size_t axis = 0; axis < 2; ++axis) {
      const double x = static_cast<double>(cut.positions[i * 3 + axis]);
      if (x > 0.5 && x < 3.5 && std::abs(x - std::round(x)) < 0.125) {
        ++near;
        break;
      }
    }
  }
  // Bands of a quarter around the three borders each way are 0.34 of the wall.
  EXPECT_GT(static_cast<double>(near) / static_cast<double>(cut.size()), 0.5);
}

TEST(MergeTree, EveryBudgetIsExactAndRefinesOneSplat) {
  const SplatCloud cloud = randomCloud(300, 1);
  const HierarchyDecoder decoder = decoderOf(cloud);
  std::vector<uint32_t> before;
  for (uint64_t budget = 1; budget <= 300; ++budget) {
    const std::vector<uint32_t> ids = decoder.cut(budget);
    ASSERT_EQ(ids.size(), budget);
    ASSERT_TRUE(std::is_sorted(ids.begin(), ids.end()));
    ASSERT_EQ(cutOf(decoder, budget).size(), budget);
    if (budget > 1) {
      std::vector<uint32_t> gone, come;
      std::set_difference(before.begin(), before.end(), ids.begin(), ids.end(),
                          std::back_inserter(gone));
      std::set_difference(ids.begin(), ids.end(), before.begin(), before.end(),
                          std::back_inserter(come));
      ASSERT_EQ(gone.size(), 1u);
      ASSERT_EQ(come.size(), 2u);
      for (const uint32_t child : come) ASSERT_EQ(decoder.tree()->parents[child], gone[0]);
    }
    before = ids;
  }
  expectSame(cutOf(decoder, 300), cloud);
}

TEST(MergeTree, ErrorsNeverRise) {
  const MergeTree tree = buildMergeTree(randomCloud(2000, 4), {}, {});
  EXPECT_TRUE(std::is_sorted(tree.errors.rbegin(), tree.errors.rend()));
  EXPECT_GE(tree.errors.back(), 0.0f);
}

TEST(MergeTree, IsTheSameForAnyNumberOfThreads) {
  const SplatCloud cloud = randomCloud(20000, 7);
  MergeTree one, four;
  withThreads(1, [&] { one = buildMergeTree(cloud, {}, {}); });
  withThreads(4, [&] { four = buildMergeTree(cloud, {}, {}); });
  EXPECT_EQ(one.parents, four.parents);
  EXPECT_EQ(one.errors, four.errors);
  expectSame(one.nodes, four.nodes);
}

TEST(MergeTree, HiddenSplatsMergeFirstAndChangeNothing) {
  SplatCloud cloud = randomCloud(400, 11, 0);
  std::vector<float> visibility(400, 1.0f);
  for (size_t i = 0; i < 200; ++i) visibility[i] = 0.0f;
  const HierarchyDecoder decoder = decoderOf(cloud, visibility);
  // Half of the splats are gone and yet nearly all that are seen are still there as they were.
  const std::vector<uint32_t> ids = decoder.cut(210);
  const size_t kept = static_cast<size_t>(
      std::count_if(ids.begin(), ids.end(), [&](uint32_t id) { return id >= 399 + 200; }));
  std::set<float> places;
  const SplatCloud cut = cutOf(decoder, 210);
  for (size_t i = 0; i < cut.size(); ++i) places.insert(cut.positions[i * 3]);
  size_t near = 0;
  for (size_t i = 200; i < 400; ++i) {
    const auto next = places.lower_bound(cloud.positions[i * 3] - 2e-3f);
    near += next != places.end() && *next < cloud.positions[i * 3] + 2e-3f ? 1 : 0;
  }
  EXPECT_GT(near, 170u) << kept << " unchanged";
}

TEST(MergeTree, ManySplatsOfOnePlaceAreNotAChain) {
  constexpr size_t kCount = 4000;
  SplatCloud cloud = randomCloud(kCount, 9);
  const auto repeat = [&](std::vector<float>& column) {
    const size_t width = column.size() / kCount;
    // A few of other places, so that the others must find them.
    for (size_t i = width; i < column.size() - 20 * width; ++i) column[i] = column[i - width];
  };
  repeat(cloud.positions);
  repeat(cloud.rotations);
  repeat(cloud.scales);
  repeat(cloud.opacities);
  repeat(cloud.sh);
  const MergeTree tree = buildMergeTree(cloud, {}, {});
  std::vector<size_t> depths(tree.parents.size(), 0);
  for (size_t id = 1; id < depths.size(); ++id) depths[id] = depths[tree.parents[id]] + 1;
  // Twelve rounds would do; ties that are shuffled leave some over in each.
  EXPECT_LT(*std::ranges::max_element(depths), 100u);
}

TEST(MergeTree, LongChainsOfEverCheaperPartnersEnd) {
  // On a line, each next gap a little smaller: only the last two splats are each other's nearest.
  constexpr size_t kCount = 20000;
  SplatCloud cloud = randomCloud(kCount, 2, 0);
  double x = 0;
  for (size_t i = 0; i < kCount; ++i) {
    x += 1.0 - 0.5 * static_cast<double>(i) / kCount;
    cloud.positions[i * 3] = static_cast<float>(x);
    cloud.positions[i * 3 + 1] = cloud.positions[i * 3 + 2] = 0.0f;
    for (size_t k = 0; k < 3; ++k) {
      cloud.scales[i * 3 + k] = 0.5f;
      cloud.sh[i * 3 + k] = 0.5f;
    }
    cloud.opacities[i] = 0.5f;
  }
  const HierarchyDecoder decoder = decoderOf(cloud);
  EXPECT_EQ(cutOf(decoder, 777).size(), 777u);
}

TEST(MergeTree, TakesDegenerateClouds) {
  SplatCloud one = randomCloud(1, 1);
  expectSame(cutOf(decoderOf(one), 1), one);

  SplatCloud same = randomCloud(500, 1);
  for (size_t i = 0; i < same.positions.size(); ++i) same.positions[i] = same.positions[i % 3];
  SplatCloud points = randomCloud(500, 2);
  std::fill(points.scales.begin(), points.scales.end(), 0.0f);
  SplatCloud clear = randomCloud(500, 3);
  std::fill(clear.opacities.begin(), clear.opacities.end(), 0.0f);
  SplatCloud huge = randomCloud(500, 4);
  for (size_t i = 0; i < 100; ++i) huge.scales[i] = 1e18f;
  for (size_t i = 0; i < 30; ++i) huge.positions[i] = i % 2 == 0 ? 1e15f : -1e15f;
  SplatCloud nothing = same;
  std::fill(nothing.scales.begin(), nothing.scales.end(), 0.0f);
  std::fill(nothing.opacities.begin(), nothing.opacities.end(), 1.0f);
  for (const SplatCloud& cloud : {same, points, clear, huge, nothing}) {
    const HierarchyDecoder decoder = decoderOf(cloud);
    for (const uint64_t budget : {1u, 2u, 250u, 499u, 500u}) {
      const SplatCloud cut = cutOf(decoder, budget);
      EXPECT_EQ(cut.size(), budget);
      EXPECT_NO_THROW(validate(cut, "cut"));
    }
  }
}

TEST(MergeTree, RefusesBadInputInOneSentence) {
  const SplatCloud cloud = randomCloud(10, 1);
  EXPECT_THROW(buildMergeTree({}, {}, {}), Error);
  const std::vector<float> few(9, 1.0f);
  EXPECT_THROW(buildMergeTree(cloud, few, {}), Error);
  std::vector<float> wrong(10, 1.0f);
  wrong[4] = 1.5f;
  EXPECT_THROW(buildMergeTree(cloud, wrong, {}), Error);
  MergeTreeOptions options;
  options.footprint = -1;
  EXPECT_THROW(buildMergeTree(cloud, {}, options), Error);

  const HierarchyDecoder decoder = decoderOf(cloud);
  EXPECT_THROW(cutOf(decoder, 0), Error);
  EXPECT_THROW(cutOf(decoder, 11), Error);
  MergeTree loop = *decoder.tree();
  loop.parents[3] = 5;
  EXPECT_THROW(validateTree(loop, cloud, "tree"), Error);
  MergeTree rising = *decoder.tree();
  rising.errors[4] = rising.errors[0] * 2 + 1;
  EXPECT_THROW(validateTree(rising, cloud, "tree"), Error);
  MergeTree three = *decoder.tree();
  three.parents.back() = three.parents[three.parents.size() - 2];
  three.parents[three.parents.size() - 3] = three.parents.back();
  EXPECT_THROW(validateTree(three, cloud, "tree"), Error);
  EXPECT_THROW(validateTree(*decoder.tree(), randomCloud(11, 1), "tree"), Error);
}

}  // namespace
}  // namespace stipple
