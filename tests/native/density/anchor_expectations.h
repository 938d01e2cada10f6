#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <span>

#include "density/anchor_sampling.h"
#include "density_fixtures.h"
#include "math/morton.h"

namespace stipple {

constexpr AnchorOrder kBothOrders[] = {AnchorOrder::kSystematic, AnchorOrder::kProgressive};

inline std::map<uint64_t, uint64_t> leafCounts(const AnchorSet& anchors) {
  std::map<uint64_t, uint64_t> counts;
  for (const uint64_t leaf : anchors.leaves) ++counts[leaf];
  return counts;
}

/// The logarithms of the leaf probabilities, summed in double along the path.
inline std::map<uint64_t, double> leafLogQ(const OctreeDensity& density) {
  std::map<uint64_t, double> log_q{{0, 0.0}};
  for (int level = 0; level < density.leafLevel(); ++level) {
    std::map<uint64_t, double> next;
    for (size_t i = 0; i < density.cells(level).size(); ++i) {
      for (uint64_t k = 0; k < 8; ++k) {
        const float log_p = density.logProbabilities(level)[8 * i + k];
        if (log_p == kNoMass) continue;
        next[density.cells(level)[i] << 3 | k] =
            log_q.at(density.cells(level)[i]) + static_cast<double>(log_p);
      }
    }
    log_q = std::move(next);
  }
  return log_q;
}

/// What holds for every anchor set: size, order, positions in their leaves, log q of the model.
inline void expectValid(const OctreeDensity& density, const AnchorSet& anchors, uint64_t count) {
  ASSERT_EQ(anchors.size(), count);
  ASSERT_EQ(anchors.leaves.size(), count);
  ASSERT_EQ(anchors.positions.size(), 3 * count);
  EXPECT_EQ(anchors.leaf_level, density.leafLevel());
  EXPECT_TRUE(std::is_sorted(anchors.leaves.begin(), anchors.leaves.end()));
  const auto log_q = leafLogQ(density);
  const double side = std::ldexp(1.0, density.leafLevel());
  for (size_t i = 0; i < count; ++i) {
    const auto leaf = log_q.find(anchors.leaves[i]);
    ASSERT_NE(leaf, log_q.end()) << "an anchor in a leaf without mass";
    ASSERT_EQ(anchors.log_q[i], static_cast<float>(leaf->second));
    const auto cell = mortonDecode(anchors.leaves[i]);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double position = static_cast<double>(anchors.positions[3 * i + axis]);
      ASSERT_GE(position, cell[axis] / side);
      ASSERT_LT(position, (cell[axis] + 1) / side);
    }
  }
}

/// A model that answers every question with the same eight numbers.
class ConstantModel final : public DensityModel {
 public:
  ConstantModel(int leaf_level, std::array<float, 8> logs) : leaf_level_(leaf_level), logs_(logs) {}
  int leafLevel() const override { return leaf_level_; }
  const RootCube& root() const override { return root_; }
  void childLogProbabilities(int, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* = nullptr) const override {
    for (size_t i = 0; i < 8 * cells.size(); ++i) out[i] = logs_[i % 8];
  }

 private:
  int leaf_level_;
  std::array<float, 8> logs_;
  RootCube root_;
};

}  // namespace stipple
