#include "densify/anchors/anchor_growth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <set>
#include <vector>

namespace stipple {
namespace {

using testing::ElementsAre;

/// Anchors of K slots each, as they are looked at.
struct Case {
  std::vector<float> positions, centres;
  AnchorStatistics statistics;
  AnchorGround ground;
  AnchorGrowthOptions options;

  explicit Case(uint32_t gaussians) {
    ground.gaussians = gaussians;
    ground.voxel = 1.0 / 16;  // cells of 1, 1/4 and 1/16
    ground.window = 100;
    ground.seed = 1;
  }

  void add(std::array<float, 3> anchor, const std::vector<std::array<float, 3>>& slots,
           const std::vector<float>& gradients, uint32_t drawn = 100) {
    positions.insert(positions.end(), anchor.begin(), anchor.end());
    for (const auto& slot : slots) centres.insert(centres.end(), slot.begin(), slot.end());
    statistics.resize(statistics.anchorCount() + 1, ground.gaussians);
    for (size_t k = 0; k < slots.size(); ++k) {
      const size_t at = statistics.drawn.size() - slots.size() + k;
      statistics.gradient_sums[at] = gradients[k] * static_cast<float>(drawn);
      statistics.drawn[at] = drawn;
    }
  }

  std::vector<GrownAnchor> grown() {
    ground.positions = positions;
    ground.centres = centres;
    return grownAnchors(ground, statistics, options);
  }
};

TEST(AnchorGrowth, FillsCellsThatAreAskedForAndFree) {
  Case scene(1);
  // Eight slots ask for the same free cell, so that some win their throw.
  for (int i = 0; i < 8; ++i) {
    scene.add({0, 0, 0.01f * static_cast<float>(i)}, {{3.1f, -0.2f, 0.3f}}, {1e-3f});
  }
  scene.options.depths = 1;
  const std::vector<GrownAnchor> grown = scene.grown();
  ASSERT_EQ(grown.size(), 1u);
  EXPECT_THAT(grown[0].position, ElementsAre(3.0f, 0.0f, 0.0f));
  EXPECT_FLOAT_EQ(grown[0].length, 1.0f);
  EXPECT_GE(grown[0].sources.size(), 1u);
  EXPECT_TRUE(std::is_sorted(grown[0].sources.begin(), grown[0].sources.end()));
}

TEST(AnchorGrowth, LeavesCellsAloneInWhichAnAnchorStands) {
  Case scene(1);
  for (int i = 0; i < 8; ++i) scene.add({0, 0, 0}, {{0.3f, 0.2f, -0.4f}}, {1e-3f});
  scene.options.depths = 1;
  EXPECT_TRUE(scene.grown().empty());
}

TEST(AnchorGrowth, HasSmallerCellsWhereThePullIsStronger) {
  // 3e-4 is above the first threshold alone, 1e-3 above all three.
  std::set<float> weak, strong;
  for (const float pull : {3e-4f, 1e-3f}) {
    Case scene(1);
    for (int i = 0; i < 40; ++i) scene.add({0, 0, 0}, {{2.3f, 1.1f, 5.2f}}, {pull});
    for (const GrownAnchor& one : scene.grown()) {
      (pull > 5e-4f ? strong : weak).insert(one.length);
    }
  }
  EXPECT_THAT(weak, ElementsAre(1.0f));
  EXPECT_THAT(strong, ElementsAre(1.0f / 16, 0.25f, 1.0f));
}

TEST(AnchorGrowth, ListensToNoSlotThatWasSeldomDrawn) {
  Case scene(1);
  for (int i = 0; i < 40; ++i) scene.add({0, 0, 0}, {{3, 0, 0}}, {1e-2f}, 40);
  EXPECT_TRUE(scene.grown().empty()) << "40 of 100 are not more than 0.4";
  for (uint32_t& drawn : scene.statistics.drawn) ++drawn;
  EXPECT_FALSE(scene.grown().empty());
}

TEST(AnchorGrowth, WeightsStandForThresholds) {
  Case scene(1);
  for (int i = 0; i < 40; ++i) scene.add({0, 0, 0}, {{3, 0, 0}}, {3e-4f});
  scene.options.depths = 1;
  EXPECT_EQ(scene.grown().size(), 1u);
  const std::vector<float> weights(40, 0.5f);  // 1.5e-4 is below 2e-4
  scene.ground.weights = weights;
  EXPECT_TRUE(scene.grown().empty());
}

TEST(AnchorGrowth, PrefersTheStrongestWhereThereIsNoRoom) {
  Case scene(1);
  for (int i = 0; i < 20; ++i) {
    scene.add({0, 0, 0}, {{3, 0, 0}}, {3e-4f});
    scene.add({0, 0, 0}, {{-7, 0, 0}}, {3.5e-4f});
  }
  scene.options.depths = 1;
  EXPECT_EQ(scene.grown().size(), 2u);
  scene.ground.most_new = 1;
  const std::vector<GrownAnchor> grown = scene.grown();
  ASSERT_EQ(grown.size(), 1u);
  EXPECT_EQ(grown[0].position[0], -7.0f);
}

TEST(AnchorGrowth, TakesPlacesThatAreOutOfEveryRange) {
  // Hazard of whole numbers: cells beyond 2^52 and places on the borders of cells.
  Case scene(1);
  for (int i = 0; i < 40; ++i) scene.add({0, 0, 0}, {{1e30f, -1e30f, 0.5f}}, {1e-2f});
  for (const GrownAnchor& one : scene.grown()) {
    for (const float value : one.position) EXPECT_TRUE(std::isfinite(value));
  }
}

TEST(AnchorPruning, RemovesAnchorsWhoseSplatsAreFaint) {
  AnchorStatistics statistics;
  statistics.resize(4, 2);
  statistics.seen = {100, 100, 80, 100};
  statistics.opacity_sums = {0.4f, 0.6f, 0.0f, 0.5f};  // of 100: below 0.005, above it, at it
  EXPECT_THAT(lastingAnchors(100, statistics), ElementsAre(1u, 2u, 3u));
  // What was judged begins anew; what was seen too seldom goes on.
  EXPECT_THAT(statistics.seen, ElementsAre(0u, 0u, 80u, 0u));
}

TEST(AnchorStatistics, CountsSplatsThatAreDrawnAndAnchorsThatAreSeen) {
  AnchorStatistics statistics;
  statistics.resize(3, 2);
  const std::vector<uint8_t> visible = {1, 0, 1};
  const std::vector<float> gradients = {3e-3f, 4e-3f, 9, 9, 0, 1e-3f};
  ViewStatistics view;
  view.width = 200;  // 100 and 50 times per pixel
  view.height = 100;
  view.visible = visible;
  view.arrays[static_cast<size_t>(Statistic::kScreenGradients)] = gradients;
  const std::vector<uint32_t> slots = {0, 3, 5};
  const std::vector<float> opacities = {0.5f, 0.25f, 0.125f};
  const std::vector<uint8_t> in_view = {1, 1, 0};
  statistics.add(view, slots, opacities, in_view);
  EXPECT_THAT(statistics.drawn, ElementsAre(1u, 0u, 0u, 0u, 0u, 1u));
  EXPECT_FLOAT_EQ(statistics.gradient_sums[0], std::hypot(0.3f, 0.2f));
  EXPECT_FLOAT_EQ(statistics.gradient_sums[5], 0.05f);
  EXPECT_THAT(statistics.opacity_sums, ElementsAre(0.5f, 0.25f, 0.0f));
  EXPECT_THAT(statistics.seen, ElementsAre(1u, 1u, 0u));
}

TEST(AnchorsInView, AreThoseThatProjectIntoTheImage) {
  Camera camera;
  camera.width = 100;
  camera.height = 50;
  camera.fx = camera.fy = 100;
  camera.cx = 50;
  camera.cy = 25;
  const auto sees = [&](std::array<float, 3> place) { return isInView(camera, place.data()); };
  EXPECT_TRUE(sees({0, 0, 2}));
  EXPECT_FALSE(sees({0, 0, -2}));
  EXPECT_TRUE(sees({1.0f, 0, 2}));   // at the border
  EXPECT_FALSE(sees({1.4f, 0, 2}));  // 20 pixels beyond it
}

}  // namespace
}  // namespace stipple
