#include "densify/parts/edge_aware_score.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/parallel.h"
#include "densify/control_scene.h"
#include "densify/quantities/edge_weights.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace stipple::testing;

/// Grey pictures.
std::vector<float> greys(const std::vector<float>& values) {
  std::vector<float> rgb;
  for (const float value : values) rgb.insert(rgb.end(), 3, value);
  return rgb;
}

TEST(EdgeWeights, AreOnTheBrightSideAlone) {
  std::vector<float> dot(25, 0.0f);
  dot[12] = 1;
  std::vector<float> expected(25, 0.0f);
  expected[12] = 1;
  EXPECT_EQ(edgeWeights(5, 5, greys(dot)), expected);
  // A dark dot: its eight neighbours.
  for (float& value : dot) value = 1 - value;
  const std::vector<float> around = edgeWeights(5, 5, greys(dot));
  EXPECT_EQ(around[12], 0.0f);
  EXPECT_THAT((std::vector<float>{around[6], around[7], around[8], around[11], around[13]}),
              Each(1.0f));
}

TEST(EdgeWeights, AreAsStrongAsTheStep) {
  // Steps of 10 and 20 of 255, each pixel beside one has three neighbours behind it.
  std::vector<float> row;
  for (const int value : {0, 0, 10, 10, 10, 30, 30, 30}) {
    row.push_back(static_cast<float>(value) / 255);
  }
  std::vector<float> picture;
  for (int y = 0; y < 4; ++y) picture.insert(picture.end(), row.begin(), row.end());
  const std::vector<float> weights = edgeWeights(8, 4, greys(picture));
  EXPECT_THAT(std::vector<float>(weights.begin() + 8, weights.begin() + 16),
              ElementsAre(0, 0, 0.5f, 0, 0, 1, 0, 0));
  EXPECT_THAT(std::vector<float>(weights.begin(), weights.begin() + 8), Each(0.0f));
  EXPECT_THAT(std::vector<float>(weights.end() - 8, weights.end()), Each(0.0f));
}

TEST(EdgeWeights, LuminanceIsThatOfTheStandard) {
  // Red, green and blue dots of full value: 76, 150 and 29 of 255; 8 times 29 is 232, the others
  // are held to 255.
  const float colours[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  std::vector<float> rgb(15 * 5 * 3, 0.0f);
  for (size_t k = 0; k < 3; ++k) std::copy_n(colours[k], 3, &rgb[(2 * 15 + 2 + 5 * k) * 3]);
  const std::vector<float> weights = edgeWeights(15, 5, rgb);
  EXPECT_EQ(weights[2 * 15 + 2], 1.0f);
  EXPECT_EQ(weights[2 * 15 + 7], 1.0f);
  EXPECT_NEAR(weights[2 * 15 + 12], 232.0f / 255, 1e-6f);
}

TEST(EdgeWeights, FlatSmallAndWildPicturesHaveNone) {
  EXPECT_THAT(edgeWeights(7, 6, greys(std::vector<float>(42, 0.4f))), Each(0.0f));
  EXPECT_THAT(edgeWeights(1, 1, {{0.1f, 0.2f, 0.3f}}), ElementsAre(0.0f));
  EXPECT_THAT(edgeWeights(2, 3, greys({0, 1, 0, 1, 0, 1})), Each(0.0f));
  // Beyond the ends of display values everything is white, or black.
  std::vector<float> wild(25, 1e30f);
  wild[12] = 2;
  wild[13] = 1;
  EXPECT_THAT(edgeWeights(5, 5, greys(wild)), Each(0.0f));
}

/// What one view of 6 x 4 pixels says.
struct EdgeSeen {
  std::vector<float> edges, gradients;
  std::vector<uint8_t> visible;
  size_t index;

  explicit EdgeSeen(std::vector<float> weights, size_t view = 0)
      : edges(std::move(weights)),
        gradients(edges.size() * 2, 1.0f),
        visible(edges.size(), 1),
        index(view) {}
  ViewStatistics statistics() const {
    ViewStatistics view;
    view.view = index;
    view.width = 6;
    view.height = 4;
    view.visible = visible;
    view.arrays[static_cast<size_t>(Statistic::kScreenGradients)] = gradients;
    view.arrays[static_cast<size_t>(Statistic::kEdgeWeights)] = edges;
    return view;
  }
};

constexpr const char* kScored = "adaptive+edge_aware_score";

/// Rows that are copied at iteration 600 where `room` more splats may come.
std::vector<int> copied(const std::vector<EdgeSeen>& views, size_t room, uint64_t seed = 7) {
  const auto strategy = makeStrategy(kScored);
  for (const EdgeSeen& view : views) strategy->observe(at(595), view.statistics());
  const size_t count = views[0].edges.size();
  FitMoment moment = at(600, count + room);
  moment.seed = seed;
  const auto edit = editAt(*strategy, moment, splatsOf(std::vector<Kind>(count, {0.005f, 0.5f})));
  std::vector<int> rows;
  for (size_t k = 0; k < edit->append.size(); ++k) {
    rows.push_back(static_cast<int>(edit->append.positions[k * 3]));
  }
  return rows;
}

TEST(EdgeAwareScore, SplatsThatCoverEdgesGoFirst) {
  EXPECT_THAT(copied({EdgeSeen({0, 2, 0, 1, 0})}, 2), ElementsAre(1, 3));
  // No more than cover an edge, though there is room.
  EXPECT_THAT(copied({EdgeSeen({0, 2, 0, 1, 0})}, 4), ElementsAre(1, 3));
}

TEST(EdgeAwareScore, IsTheChanceToBeChosen) {
  int second = 0;
  constexpr int kDraws = 2000;
  for (uint64_t seed = 0; seed < kDraws; ++seed) {
    second += copied({EdgeSeen({1, 3})}, 1, seed) == std::vector<int>{1};
  }
  // Expected 0.75; four standard deviations are 4 sqrt(0.75 0.25 / 2000).
  EXPECT_NEAR(second / double{kDraws}, 0.75, 0.039);
}

TEST(EdgeAwareScore, WithoutEdgesStrengthIsTheChance) {
  EXPECT_EQ(copied({EdgeSeen({0, 0, 0, 0})}, 3).size(), 3u);
  const auto unseen = makeStrategy(kScored);
  unseen->observe(at(1), EdgeSeen({1, 1}).statistics());  // too early to count
  const auto edit = editAt(*unseen, at(600, 3), splatsOf(std::vector<Kind>(2, {0.005f, 0.5f})));
  EXPECT_EQ(edit->append.size(), 1u);
}

TEST(EdgeAwareScore, ViewsWeighTheSame) {
  const auto strategy = makeStrategy(kScored);
  EdgeSeen faint({0.001f, 0.003f, 0}, 1), none({0, 0, 0}, 2), hidden({0, 4, 8}, 3);
  hidden.visible[2] = 0;
  strategy->observe(at(595), EdgeSeen({2, 6, 0}, 0).statistics());
  strategy->observe(at(596), faint.statistics());
  strategy->observe(at(597), none.statistics());
  strategy->observe(at(598), hidden.statistics());
  const RawSplats splats = splatsOf(std::vector<Kind>(3, {0.005f, 0.5f}));
  const auto edit = editAt(*strategy, at(600, 3), splats);
  EXPECT_EQ(edit->append.size(), 0u);
  // Over the means of what is positive: 4, 0.002 and 6.
  const std::vector<float> seen = strategy->seen(splats.size()).score;
  ASSERT_EQ(seen.size(), 3u);
  EXPECT_NEAR(seen[0], 0.5f + 0.5f, 1e-6f);
  EXPECT_NEAR(seen[1], 1.5f + 1.5f + 4.0f / 6, 1e-6f);
  EXPECT_EQ(seen[2], 0.0f);
}

/// Iterations [begin, end) that ask for edges of another view each.
std::vector<uint64_t> asking(uint64_t begin, uint64_t end) {
  const auto strategy = makeStrategy(kScored);
  std::vector<uint64_t> asked;
  const std::vector<float> target(6 * 4 * 3, 0.5f);
  for (uint64_t iteration = begin; iteration < end; ++iteration) {
    const TrainingView view{iteration, 6, 4, target};
    FitMoment moment = at(iteration);
    moment.view = &view;
    const StatisticRequest request = strategy->requests(moment);
    if (request.edge_weights.empty()) continue;
    EXPECT_EQ(request.edge_weights.size(), 24u);
    asked.push_back(iteration);
  }
  return asked;
}

TEST(EdgeAwareScore, LooksAtTheViewsBeforeAnEvent) {
  EXPECT_THAT(asking(580, 605), ElementsAre(591, 592, 593, 594, 595, 596, 597, 598, 599, 600));
  EXPECT_TRUE(asking(1, 591).empty());
  EXPECT_EQ(asking(14401, 30001).size(), 10u);  // those before 14,500
  EXPECT_EQ(asking(3301, 3401).size(), 100u);
  EXPECT_EQ(asking(6301, 6401).size(), 100u);
  EXPECT_EQ(asking(3201, 3301).size(), 10u);
}

TEST(EdgeAwareScore, AViewCountsOnce) {
  const auto strategy = makeStrategy(kScored);
  const std::vector<float> target(6 * 4 * 3, 0.5f);
  const TrainingView view{4, 6, 4, target};
  FitMoment moment = at(595);
  moment.view = &view;
  EXPECT_FALSE(strategy->requests(moment).edge_weights.empty());
  strategy->observe(at(595), EdgeSeen({1, 2}, 4).statistics());
  EXPECT_TRUE(strategy->requests(moment).edge_weights.empty());
}

/// Notes which views are drawn.
class FakeViews final : public ViewEvaluator {
 public:
  std::vector<size_t> drawn;

  FakeViews() : seen_({0, 1, 0}) {
    camera_.width = 6;
    camera_.height = 4;
  }
  size_t viewCount() const override { return 5; }
  const SplatCloud& splats() override { return cloud_; }
  const Camera& camera(size_t) const override { return camera_; }
  std::vector<float> target(size_t) override { return std::vector<float>(6 * 4 * 3, 0.0f); }
  std::vector<float> picture(size_t) override { return {}; }
  const ViewStatistics& evaluate(size_t view, const StatisticRequest& request) override {
    EXPECT_EQ(request.edge_weights.size(), 24u);
    drawn.push_back(view);
    seen_.index = view;
    statistics_ = seen_.statistics();
    return statistics_;
  }

 private:
  SplatCloud cloud_;
  Camera camera_;
  EdgeSeen seen_;
  ViewStatistics statistics_;
};

TEST(EdgeAwareScore, EveryViewCountsAfterARecovery) {
  const auto strategy = makeStrategy(kScored);
  for (const uint64_t iteration : {600, 3300, 3350, 3500, 6300, 6500, 14600}) {
    EXPECT_FALSE(strategy->wantsSweep(at(iteration))) << iteration;
  }
  EXPECT_TRUE(strategy->wantsSweep(at(3400)));
  EXPECT_TRUE(strategy->wantsSweep(at(6400)));
  FitMoment tenth = at(500);
  tenth.iterations = 3000;  // splats go at 400 there
  EXPECT_TRUE(strategy->wantsSweep(tenth));
  tenth.iteration = 400;
  EXPECT_FALSE(strategy->wantsSweep(tenth));

  // Only those that no iteration had.
  strategy->observe(at(3320), EdgeSeen({1, 0, 0}, 3).statistics());
  strategy->observe(at(3390), EdgeSeen({1, 0, 0}, 1).statistics());
  FakeViews views;
  strategy->sweep(at(3400), views);
  EXPECT_THAT(views.drawn, ElementsAre(0, 2, 4));
  const RawSplats splats = splatsOf(std::vector<Kind>(3, {0.005f, 0.5f}));
  editAt(*strategy, at(3400, 3), splats);
  EXPECT_THAT(strategy->seen(splats.size()).score, ElementsAre(2, 3, 0));
}

TEST(EdgeAwareScore, GoesOnFromItsStateInTheMiddleOfItsViews) {
  std::vector<float> edges(400);
  for (size_t i = 0; i < 400; ++i) edges[i] = static_cast<float>(i % 7);
  const auto whole = makeStrategy(kScored), half = makeStrategy(kScored);
  whole->observe(at(595), EdgeSeen(edges, 2).statistics());
  half->restore(whole->state());
  const RawSplats splats = splatsOf(std::vector<Kind>(400, {0.005f, 0.5f}));
  std::vector<float> places[2];
  for (const unsigned threads : {1u, 2u}) {
    Strategy& strategy = threads == 1 ? *whole : *half;
    withThreads(threads, [&] {
      std::reverse(edges.begin(), edges.end());
      strategy.observe(at(596), EdgeSeen(std::vector<float>(400, 1.5f), 3).statistics());
      const auto edit = editAt(strategy, at(600, 500), splats);
      places[threads - 1] = {edit->append.positions.begin(), edit->append.positions.end()};
    });
  }
  EXPECT_EQ(places[0].size(), 300u);
  EXPECT_EQ(places[0], places[1]);
  TensorTable table = whole->state();
  table["edge_aware_score.edge_sums"] = {{1}, std::vector<float>{-1}};
  EXPECT_THAT(messageOf([&] { whole->restore(table); }), HasSubstr("0 and more is allowed"));
}

TEST(EdgeAwareScore, ScoresFollowSplatsThatGoBetweenItsViews) {
  // Recovery in the middle of the window: 3663 and 3670 of a fit of 33,300 (events every 111).
  const auto strategy = makeStrategy("adaptive+edge_aware_score+recovery_pruning");
  const RawSplats splats = splatsOf(std::vector<Kind>(10, {0.005f, 0.5f}));
  FitMoment moment = at(3660);
  moment.iterations = 33300;
  strategy->observe(moment, EdgeSeen(std::vector<float>(10, 1), 0).statistics());
  moment.iteration = 3663;
  ASSERT_EQ(3663 % 111, 0);
  const auto edit = editAt(*strategy, moment, splats);
  ASSERT_EQ(edit->countAfter(10), 8u + 8u);
  EXPECT_EQ(strategy->seen(after(*edit, splats).size()).score.size(), 16u);
}

}  // namespace
}  // namespace stipple
