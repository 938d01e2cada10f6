// Test vectors of the sampling as DeG (arXiv 2605.16355) specifies it. T2's leaves come from an
// independent implementation that reproduces a recorded run of the official sampler; its log q are
// evaluated in double by a separate NumPy program. They agree with that implementation's six
// printed decimals except for the sixth leaf, printed as -10.875550, which the logits do not give.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "density/anchor_sampling.h"
#include "density_fixtures.h"
#include "math/morton.h"

namespace stipple {
namespace {

/// Logits by level (1..8) and index in the frontier, and what the model was asked.
class FrontierModel final : public DensityModel {
 public:
  using Logit = double (*)(size_t parent, size_t child, int level);
  explicit FrontierModel(Logit logit) : logit_(logit) {}
  int leafLevel() const override { return 8; }
  const RootCube& root() const override { return root_; }
  void childLogProbabilities(int level, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* = nullptr) const override {
    asked.emplace_back(cells.begin(), cells.end());
    for (size_t parent = 0; parent < cells.size(); ++parent) {
      double sum = 0.0;
      for (size_t child = 0; child < 8; ++child) sum += std::exp(logit_(parent, child, level + 1));
      for (size_t child = 0; child < 8; ++child) {
        out[8 * parent + child] =
            static_cast<float>(logit_(parent, child, level + 1) - std::log(sum));
      }
    }
  }

  mutable std::vector<std::vector<uint64_t>> asked;

 private:
  Logit logit_;
  RootCube root_;
};

TEST(RecordedVectors, T1FollowsTheForcedPathToItsLeaf) {
  const FrontierModel model([](size_t, size_t child, int level) {
    return child == static_cast<size_t>(level - 1) ? 0.0 : -1e4;
  });
  RecordedUniformSource source(std::vector<double>(11, 0.5));
  const AnchorSet anchors = sampleAnchors(model, {.count = 1}, source);
  EXPECT_EQ(anchors.leaves[0], mortonEncode(85, 51, 15));
  EXPECT_EQ(source.drawnCount(), 11u);
  const std::array<std::array<double, 3>, 8> centres{{{.5, .5, .5},
                                                      {.25, .25, .25},
                                                      {.375, .125, .125},
                                                      {.3125, .1875, .0625},
                                                      {.34375, .21875, .03125},
                                                      {.328125, .203125, .046875},
                                                      {.3359375, .1953125, .0546875},
                                                      {.33203125, .19921875, .05859375}}};
  ASSERT_EQ(model.asked.size(), 8u);
  for (size_t level = 0; level < 8; ++level) {
    ASSERT_EQ(model.asked[level].size(), 1u);
    const auto cell = mortonDecode(model.asked[level][0]);
    for (size_t axis = 0; axis < 3; ++axis) {
      EXPECT_EQ((cell[axis] + 0.5) / static_cast<double>(1u << level), centres[level][axis]);
    }
  }
}

TEST(RecordedVectors, T2GivesTheLeavesAndLogQOfTheSpecification) {
  const FrontierModel model([](size_t parent, size_t child, int level) {
    return 2.0 * std::sin(1.7 * static_cast<double>(parent) + 0.9 * static_cast<double>(child) +
                          0.31 * level);
  });
  std::vector<double> stream;
  for (int i = 1; i <= 115; ++i) stream.push_back((37 * i % 101) / 101.0);
  RecordedUniformSource source(stream);
  const AnchorSet anchors = sampleAnchors(model, {.count = 12}, source);
  EXPECT_EQ(source.drawnCount(), 115u);
  const std::array<size_t, 8> frontier{1, 6, 12, 12, 12, 12, 12, 12};
  ASSERT_EQ(model.asked.size(), 8u);
  for (size_t level = 0; level < 8; ++level) EXPECT_EQ(model.asked[level].size(), frontier[level]);
  struct Expected {
    uint32_t x, y, z;
    double log_q;
  };
  const std::array<Expected, 12> expected{{{57, 107, 43, -12.022576582},
                                           {174, 24, 55, -11.204498348},
                                           {201, 27, 36, -12.263641259},
                                           {204, 26, 64, -14.511178673},
                                           {179, 86, 87, -10.297123220},
                                           {200, 100, 127, -10.871549037},
                                           {83, 246, 8, -11.659019036},
                                           {25, 180, 85, -12.748658291},
                                           {114, 169, 107, -12.720270705},
                                           {220, 197, 50, -14.270643103},
                                           {54, 61, 144, -15.747054460},
                                           {185, 235, 235, -11.285420856}}};
  ASSERT_EQ(anchors.size(), 12u);
  for (size_t i = 0; i < 12; ++i) {
    EXPECT_EQ(anchors.leaves[i], mortonEncode(expected[i].x, expected[i].y, expected[i].z));
    // Eight float32 logarithms and a float32 sum near -15, whose steps are 9.5e-7.
    EXPECT_NEAR(static_cast<double>(anchors.log_q[i]), expected[i].log_q, 1e-6);
    const std::array<double, 3> cell{static_cast<double>(expected[i].x),
                                     static_cast<double>(expected[i].y),
                                     static_cast<double>(expected[i].z)};
    for (size_t axis = 0; axis < 3; ++axis) {
      const double u = stream[79 + 3 * i + axis];
      // Positions are multiples of 2^-24, rounded down.
      EXPECT_NEAR(static_cast<double>(anchors.positions[3 * i + axis]), (cell[axis] + u) / 256,
                  0x1.0p-24);
    }
  }
}

}  // namespace
}  // namespace stipple
