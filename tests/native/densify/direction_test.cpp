#include "densify/strategies/direction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/parallel.h"
#include "densify/control_scene.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace stipple::testing;

constexpr float kSmall = 0.0019f;  ///< the switch is 0.002 of the extent of 1
constexpr float kLarge = 0.0021f;

/// In: for each splat its gradient per half picture, along x, and the share to which its pixels
/// agree.
Seen pulls(const std::vector<float>& gradients, const std::vector<float>& coherence) {
  std::vector<float> lengths;
  for (size_t i = 0; i < gradients.size(); ++i) lengths.push_back(gradients[i] / coherence[i]);
  return Seen(gradients, lengths);
}

/// One view, then the edit of iteration 600.
std::optional<SplatEdit> firstEdit(const std::vector<Kind>& kinds, const Seen& seen) {
  const auto strategy = makeStrategy("direction");
  strategy->observe(at(1), seen.statistics());
  return editAt(*strategy, at(600), splatsOf(kinds));
}

TEST(Direction, WeighsByHowFarPixelsAgree) {
  const DirectionPullOptions published;
  const std::pair<double, double> expected[] = {{0, 25.8},    {0.05, 12.38}, {0.1, 5.95},
                                                {0.15, 2.98}, {0.2, 1.68},   {0.25, 1.13},
                                                {0.3, 0.919}, {1, 0.8}};
  for (const auto& [coherence, weight] : expected) {
    // Published to three digits.
    EXPECT_NEAR(directionWeight(published, coherence), weight, 0.005 * weight) << coherence;
  }
  EXPECT_NEAR(directionWeight(published, 0.2752), 1, 1e-3);
  // Beyond the ends by rounding.
  EXPECT_EQ(directionWeight(published, 1.0000001), 0.8);
  EXPECT_EQ(directionWeight(published, -1e-9), 25.8);
}

/// Whether a large splat splits whose pixels ask for these moves, per half picture.
bool splits(const std::vector<std::pair<float, float>>& pixels) {
  Seen seen({0});
  seen.lengths[0] = 0;
  for (const auto& [x, y] : pixels) {
    // Of a square picture of 200 pixels.
    seen.gradients[0] += x / 100;
    seen.gradients[1] += y / 100;
    seen.lengths[0] += std::hypot(x, y) / 100;
  }
  const auto strategy = makeStrategy("direction");
  ViewStatistics view = seen.statistics();
  view.height = 200;
  strategy->observe(at(1), view);
  return editAt(*strategy, at(600), splatsOf({{kLarge, 0.5f}}))->append.size() == 2;
}

TEST(Direction, LargeSplatsSplitSoonerWherePixelsDisagree) {
  // All the same way: C = 1, threshold 2e-4 / 0.8.
  EXPECT_TRUE(splits({{1.3e-4f, 0}, {1.3e-4f, 0}}));
  EXPECT_FALSE(splits({{1.2e-4f, 0}, {1.2e-4f, 0}}));
  // At right angles C is 0.707, whatever the directions of the picture's sides: w = 0.8, as above.
  EXPECT_TRUE(splits({{1.8e-4f, 0}, {0, 1.8e-4f}}));
  EXPECT_FALSE(splits({{1.75e-4f, 0}, {0, 1.75e-4f}}));
  EXPECT_FALSE(splits({{1.23e-4f, 1.23e-4f}, {1.23e-4f, -1.23e-4f}}));
  // Nearly against each other: C = 0.05, w = 12.38, threshold 1.62e-5.
  EXPECT_TRUE(splits({{1.05f * 1.7e-4f, 0}, {-0.95f * 1.7e-4f, 0}}));
  EXPECT_FALSE(splits({{1.05f * 1.55e-4f, 0}, {-0.95f * 1.55e-4f, 0}}));
  // Exactly against each other nothing is left to weigh.
  EXPECT_FALSE(splits({{1, 0}, {-1, 0}}));
}

TEST(Direction, SmallSplatsAreCopiedOnlyWherePixelsAgree) {
  const std::vector<Kind> kinds(4, {kSmall, 0.5f});
  // Thresholds: 2e-4 times 0.8, 0.8, 1.68 and 1.68.
  const auto edit =
      firstEdit(kinds, pulls({1.65e-4f, 1.55e-4f, 3.4e-4f, 3.3e-4f}, {1, 1, 0.2f, 0.2f}));
  ASSERT_EQ(edit->append.size(), 2u);
  EXPECT_FALSE(edit->keep);
  EXPECT_EQ(edit->append.positions[0], 0.0f);
  EXPECT_EQ(edit->append.positions[3], 2.0f);
}

TEST(Direction, FaintGradientsAreNotTakenForAgreement) {
  // 1e-9 with C = 0.05: an addition of 1e-8 to both sums would make it 0.37.
  const auto strategy = makeStrategy("direction(threshold=1e-8)");
  strategy->observe(at(1), pulls({1e-9f}, {0.05f}).statistics());
  EXPECT_EQ(editAt(*strategy, at(600), splatsOf({{kLarge, 0.5f}}))->append.size(), 2u);
}

TEST(Direction, CoherenceIsTakenWithinViews) {
  // Two views that agree in themselves and pull in opposite directions: C = 1.
  const auto strategy = makeStrategy("direction");
  strategy->observe(at(1), Seen({2.4e-4f}, {2.4e-4f}).statistics());
  strategy->observe(at(2), Seen({-2.4e-4f}, {2.4e-4f}).statistics());
  EXPECT_EQ(editAt(*strategy, at(600), splatsOf({{kLarge, 0.5f}}))->append.size(), 0u);
  EXPECT_NEAR(strategy->seen(splatsOf({{kLarge, 0.5f}}).size()).score[0], 1.2 * 0.8, 1e-5);
}

TEST(Direction, HardInputsChangeNothing) {
  // Nothing pulls; no view saw it; sums that rounding has made longer than the lengths.
  EXPECT_EQ(firstEdit({{kLarge, 0.5f}}, Seen({0}, {0}))->append.size(), 0u);
  EXPECT_EQ(firstEdit({{kSmall, 0.5f}}, Seen({0}, {1}))->append.size(), 0u);
  Seen unseen({1}, {1});
  unseen.visible[0] = 0;
  EXPECT_EQ(firstEdit({{kLarge, 0.5f}}, unseen)->append.size(), 0u);
  EXPECT_EQ(firstEdit({{kLarge, 0.5f}}, Seen({1.000001f}, {1}))->append.size(), 2u);
  EXPECT_FALSE(editAt(*makeStrategy("direction"), at(600), RawSplats()));
  // All alike: the cap counts exactly.
  const auto strategy = makeStrategy("direction");
  strategy->observe(at(1), Seen(std::vector<float>(9, 1)).statistics());
  const std::vector<Kind> alike(9, {kLarge, 0.5f});
  EXPECT_EQ(editAt(*strategy, at(600, 13), splatsOf(alike))->countAfter(9), 13u);
}

TEST(Direction, RemovesBelowItsOwnOpacity) {
  const std::vector<Kind> kinds = {{kSmall, 0.0079f}, {kSmall, 0.0081f}};
  EXPECT_THAT(*firstEdit(kinds, Seen({0, 0}))->keep, ElementsAre(1));
}

TEST(Direction, GoesOnFromItsStateInTheMiddleOfAWindow) {
  const std::vector<Kind> kinds(300, {kLarge, 0.5f});
  std::vector<float> sums(300), lengths(300);
  for (size_t i = 0; i < 300; ++i) {
    lengths[i] = 3e-6f * static_cast<float>(i);
    sums[i] = lengths[i] * static_cast<float>(i % 10) / 10;
  }
  const auto whole = makeStrategy("direction"), half = makeStrategy("direction");
  whole->observe(at(501), Seen(sums, lengths).statistics());
  half->restore(whole->state());
  std::vector<float> places[2];
  for (const unsigned threads : {1u, 2u}) {
    Strategy& strategy = threads == 1 ? *whole : *half;
    withThreads(threads, [&] {
      strategy.observe(at(502), Seen(std::vector<float>(300, 2e-4f)).statistics());
      const auto edit = editAt(strategy, at(600), splatsOf(kinds));
      places[threads - 1] = {edit->append.positions.begin(), edit->append.positions.end()};
    });
  }
  EXPECT_EQ(places[0], places[1]);
  EXPECT_GT(places[0].size(), 300u);
  EXPECT_LT(places[0].size(), 1800u);

  TensorTable table = whole->state();
  table["direction_pull.length_sums"] = {{1}, std::vector<float>{1}};
  EXPECT_THAT(messageOf([&] { whole->restore(table); }),
              HasSubstr("aligned_sums and 1 length_sums"));
  table = whole->state();
  std::get<std::vector<float>>(table["direction_pull.aligned_sums"].values)[3] = -1;
  EXPECT_THAT(messageOf([&] { whole->restore(table); }), HasSubstr("0 and more is allowed"));
}

}  // namespace
}  // namespace stipple
