#include "train/anchors/handed_on.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "decode/anchors/scaffold.h"

namespace stipple {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::IsEmpty;

/// Anchors at x = each of some numbers; all that they have learned is that number and a sign.
ScaffoldParameters anchorsAt(const std::vector<float>& places, float sign) {
  ScaffoldShape shape;
  shape.gaussians = 2;
  ScaffoldParameters scaffold = makeScaffold(shape);
  for (const float x : places) {
    const std::vector<float> position = {x, 0, 0};
    const std::vector<float> feature(kScaffoldFeatures, sign * x);
    addAnchor(scaffold, position.data(), feature.data(), 1.0f);
    for (size_t i = 0; i < 6; ++i) *(scaffold.offsets.end() - 1 - static_cast<int>(i)) = sign * x;
  }
  return scaffold;
}

std::vector<float> everyNth(const std::vector<float>& values, size_t n) {
  std::vector<float> some;
  for (size_t i = 0; i < values.size(); i += n) some.push_back(values[i]);
  return some;
}

TEST(HandedOn, GivesAnchorsWhatThoseOfTheSamePlacesHaveLearned) {
  ScaffoldState finished = startState(anchorsAt({5, 1, 7, 3}, -1));
  finished.steps = 40;
  finished.levels = {0, 1, 2, 0};
  finished.statistics.seen = {9, 9, 9, 9};
  finished.scaffold->opacity.layers().back().biases[0] = 0.5f;
  for (size_t a = 0; a < 4; ++a) {
    for (size_t i = 0; i < kScaffoldFeatures; ++i) {
      const float x = finished.scaffold->positions[a * 3];
      finished.moments[0].first[a * kScaffoldFeatures + i] = 10 * x;
      finished.moments[0].second[a * kScaffoldFeatures + i] = 100 * x;
    }
  }
  // 7 came later, 2 was lost.
  const ScaffoldState state = handedOn(finished, anchorsAt({1, 2, 3, 5}, 1));
  const ScaffoldParameters& scaffold = *state.scaffold;
  EXPECT_THAT(everyNth(scaffold.positions, 3), ElementsAre(1, 3, 5, 2));
  EXPECT_THAT(everyNth(scaffold.features, kScaffoldFeatures), ElementsAre(-1, -3, -5, 2));
  EXPECT_THAT(everyNth(scaffold.offsets, 6), ElementsAre(-1, -3, -5, 2));
  EXPECT_EQ(scaffold.log_scales.size(), 4 * kScaffoldScales);
  EXPECT_EQ(scaffold.opacity.layers().back().biases[0], 0.5f) << "networks belong to features";
  EXPECT_THAT(everyNth(state.moments[0].first, kScaffoldFeatures), ElementsAre(10, 30, 50, 0));
  EXPECT_THAT(everyNth(state.moments[0].second, kScaffoldFeatures), ElementsAre(100, 300, 500, 0));
  EXPECT_EQ(state.steps, 40u);
  EXPECT_THAT(state.levels, IsEmpty());
  EXPECT_EQ(state.statistics.seen.size(), 4u);
  EXPECT_THAT(state.statistics.seen, Each(0u));
}

TEST(HandedOn, OfAnchorsInOnePlaceEachIsTakenOnce) {
  ScaffoldState finished = startState(anchorsAt({1, 1, 4}, -1));
  const ScaffoldState state = handedOn(finished, anchorsAt({1, 4, 1}, 1));
  EXPECT_THAT(everyNth(state.scaffold->positions, 3), ElementsAre(1, 4, 1));
  EXPECT_THAT(everyNth(state.scaffold->features, kScaffoldFeatures), ElementsAre(-1, -4, 1));
}

TEST(HandedOn, HasNothingOfAStateWithoutAnchors) {
  const ScaffoldState state = handedOn(startState(anchorsAt({}, 1)), anchorsAt({1, 2}, 1));
  EXPECT_THAT(everyNth(state.scaffold->features, kScaffoldFeatures), ElementsAre(1, 2));
  EXPECT_EQ(handedOn(startState(anchorsAt({1, 2}, 1)), anchorsAt({}, 1)).scaffold->size(), 0u);
}

}  // namespace
}  // namespace stipple
