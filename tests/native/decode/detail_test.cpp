#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <span>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "decode/detail/detail_network.h"

namespace stipple {
namespace {

std::vector<float> numbers(size_t count, uint64_t seed, float from, float to) {
  std::vector<float> made(count);
  for (size_t i = 0; i < count; ++i) {
    made[i] = from + (to - from) * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i));
  }
  return made;
}

TEST(PointOrder, HilbertGoesFromCellToCell) {
  constexpr int kBits = 3;
  constexpr uint32_t kSide = 1u << kBits;
  for (const CellCurve curve : {CellCurve::kHilbert, CellCurve::kHilbertTurned}) {
    std::vector<std::array<int, 3>> along(kSide * kSide * kSide, {-1, -1, -1});
    for (uint32_t x = 0; x < kSide; ++x) {
      for (uint32_t y = 0; y < kSide; ++y) {
        for (uint32_t z = 0; z < kSide; ++z) {
          const uint64_t code = curveCode(curve, {x, y, z}, kBits);
          ASSERT_LT(code, along.size());
          ASSERT_EQ(along[code][0], -1) << "two cells in one place";
          along[code] = {static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)};
        }
      }
    }
    for (size_t i = 1; i < along.size(); ++i) {
      int steps = 0;
      for (size_t axis = 0; axis < 3; ++axis) {
        steps += std::abs(along[i][axis] - along[i - 1][axis]);
      }
      EXPECT_EQ(steps, 1) << i;
    }
  }
}

TEST(PointOrder, MortonCodesHaveXFirst) {
  EXPECT_EQ(curveCode(CellCurve::kMorton, {1, 0, 0}, 1), 4u);
  EXPECT_EQ(curveCode(CellCurve::kMorton, {0, 1, 0}, 1), 2u);
  EXPECT_EQ(curveCode(CellCurve::kMorton, {0, 0, 1}, 1), 1u);
  EXPECT_EQ(curveCode(CellCurve::kMortonTurned, {1, 0, 0}, 1), 2u);
}

TEST(PointOrder, CellsBeginAtTheLeastOfEachCoordinate) {
  const PointCells made = cellsOf(std::vector<float>{-1, 5, 2, 0, 5.6f, 2, -0.5f, 5, 9.9f}, 0.5);
  EXPECT_EQ(made.cells, (std::vector<std::array<uint32_t, 3>>{{0, 0, 0}, {2, 1, 0}, {1, 0, 15}}));
  EXPECT_EQ(made.bits, 4);
  const std::vector<uint32_t> order = made.orderAlong(CellCurve::kMorton);
  EXPECT_EQ(order.front(), 0u);
  EXPECT_EQ(order.back(), 2u);
}

TEST(PointOrder, TooManyCellsAreRefused) {
  EXPECT_THROW(cellsOf(std::vector<float>{0, 0, 0, 1, 0, 0}, 1e-6), Error);
  EXPECT_THROW(cellsOf(std::vector<float>{0, 0, 0, std::nanf(""), 0, 0}, 1), Error);
}

TEST(SparseConvolution, SumsOverCellsWithPoints) {
  ParameterLayout layout;
  const SparseConvolution convolution(layout, "conv", 1, 1);
  std::vector<float> values(layout.size());
  for (size_t tap = 0; tap < kCellTaps; ++tap) values[tap] = static_cast<float>(tap);
  values[kCellTaps] = 1000;  // the bias
  // Two in one cell, one above them in x, one far away.
  const std::vector<float> points = {0, 0, 0, 0.2f, 0, 0, 1.5f, 0, 0, 9, 0, 0};
  const CellNeighbours neighbours(cellsOf(points, 1.0));
  const std::vector<float> in = {1, 10, 100, 1000};
  std::vector<float> out(4);
  convolution.apply(values, neighbours, in.data(), out.data());
  EXPECT_EQ(out, (std::vector<float>{1000 + 13 * 1 + 22 * 100, 1000 + 13 * 10 + 22 * 100,
                                     1000 + 13 * 100 + 4 * 1, 1000 + 13 * 1000}));
}

TEST(PointSelection, TakesTheLargestAndOfEqualOnesTheFirst) {
  EXPECT_EQ(largestShare(std::vector<float>{1, 3, 2, 3, 0}, 0.4),
            (std::vector<uint8_t>{0, 1, 0, 1, 0}));
  EXPECT_EQ(largestShare(std::vector<float>{2, 2, 2}, 0.5), (std::vector<uint8_t>{1, 1, 0}));
  EXPECT_EQ(largestShare(std::vector<float>{2}, 0.01), (std::vector<uint8_t>{1}));
  EXPECT_EQ(largestShare(std::vector<float>{2, 1}, 0), (std::vector<uint8_t>{0, 0}));
}

DetailSizes sizesOf(DetailAttributes kind) {
  DetailSizes sizes;
  sizes.kind = kind;
  sizes.layers = {{{8, 2, 16, 4}, 2, 2, 0.7}, {{12, 3, 16, 4}, 1, 3, 0.5}};
  return sizes;
}

struct Case {
  ParameterLayout layout;
  DetailNetwork network;
  std::vector<float> values;

  explicit Case(DetailAttributes kind) : network(layout, "dec.", sizesOf(kind)) {
    values = numbers(layout.size(), 1, -0.3f, 0.3f);
  }
  /// The sum of squares of what the splats of the points are away from 0.3.
  double loss(size_t points, std::vector<float>* gradients) const {
    DetailNetwork::Tape tape;
    std::vector<DetailNetwork::Leaves> leaves = network.forward(
        values, numbers(points * 3, 2, 0, 1), numbers(points * 8, 3, -1, 1), 0.1, tape);
    double sum = 0;
    std::vector<DetailNetwork::Leaves> by = leaves;
    for (size_t l = 0; l < leaves.size(); ++l) {
      for (size_t i = 0; i < leaves[l].attributes.size(); ++i) {
        const float away = leaves[l].attributes[i] - 0.3f;
        sum += static_cast<double>(away) * static_cast<double>(away);
        by[l].attributes[i] = 2 * away;
      }
      std::fill(by[l].points.begin(), by[l].points.end(), 0.0f);
    }
    if (gradients != nullptr) {
      gradients->assign(layout.size(), 0.0f);
      network.backward(values, tape, by, *gradients);
    }
    return sum;
  }
};

TEST(DetailNetwork, HasTheSameDerivativesForAnyNumberOfThreads) {
  for (const DetailAttributes kind : {DetailAttributes::kDirect, DetailAttributes::kResidual}) {
    const Case c(kind);
    std::vector<float> together, alone;
    c.loss(200, &together);
    withThreads(1, [&] { c.loss(200, &alone); });
    EXPECT_EQ(together, alone);
  }
}

TEST(DetailNetwork, ALossFallsAlongItsDerivative) {
  for (const DetailAttributes kind : {DetailAttributes::kDirect, DetailAttributes::kResidual}) {
    Case c(kind);
    std::vector<float> gradients;
    const double first = c.loss(50, &gradients);
    for (int step = 0; step < 60; ++step) {
      double squared = 0;
      for (const float value : gradients) {
        squared += static_cast<double>(value) * static_cast<double>(value);
      }
      const auto rate = static_cast<float>(0.05 / std::sqrt(squared));
      for (size_t i = 0; i < gradients.size(); ++i) c.values[i] -= rate * gradients[i];
      c.loss(50, &gradients);
    }
    EXPECT_LT(c.loss(50, nullptr), 0.5 * first);
  }
}

TEST(DetailNetwork, EveryCountOfPointsHasItsLeaves) {
  const Case c(DetailAttributes::kDirect);
  for (const size_t points : {1, 2, 15, 16, 17, 33}) {
    DetailNetwork::Tape tape;
    const std::vector<DetailNetwork::Leaves> leaves = c.network.forward(
        c.values, numbers(points * 3, 2, 0, 1), numbers(points * 8, 3, -1, 1), 0.1, tape);
    const auto on = static_cast<size_t>(std::ceil(0.7 * 2 * static_cast<double>(points)));
    EXPECT_EQ(leaves[0].points.size(), (2 * points - on) * 3);
    EXPECT_EQ(leaves[1].points.size(), on * 3 * 3);
    for (const DetailNetwork::Leaves& of : leaves) {
      EXPECT_EQ(of.attributes.size() / 20, of.points.size() / 3);
      for (const float value : of.attributes) EXPECT_TRUE(std::isfinite(value));
    }
  }
}

TEST(DetailNetwork, ChildrenStayNearTheirParents) {
  const Case c(DetailAttributes::kResidual);
  DetailNetwork::Tape tape;
  const std::vector<float> points = numbers(40 * 3, 2, 0, 1);
  c.network.forward(c.values, points, numbers(40 * 8, 3, -10, 10), 0.1, tape);
  for (size_t i = 0; i < tape[0].children.points.size(); ++i) {
    EXPECT_NEAR(tape[0].children.points[i], points[i / 6 * 3 + i % 3], 0.0501f);
  }
}

}  // namespace
}  // namespace stipple
