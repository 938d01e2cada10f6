#include "density/octree_density.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "base/parallel.h"
#include "density_fixtures.h"
#include "math/morton.h"

namespace stipple {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// The message of the invalid-argument error that `work` throws; empty where it throws nothing.
template <class Work>
std::string refusal(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "";
}

using Levels = std::pair<std::vector<std::vector<uint64_t>>, std::vector<std::vector<float>>>;

Levels levelsOf(const OctreeDensity& density) {
  Levels levels;
  for (int level = 0; level < density.leafLevel(); ++level) {
    const auto cells = density.cells(level);
    const auto logs = density.logProbabilities(level);
    levels.first.emplace_back(cells.begin(), cells.end());
    levels.second.emplace_back(logs.begin(), logs.end());
  }
  return levels;
}

TEST(OctreeDensity, GivesTheMassesOfAHandCheckedCase) {
  // Cube [0,1] grown by 1 %. Points at the corners (0,0,0), (1,0,0), (1,1,1) with weights 1, 2, 5.
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 1};
  const std::vector<float> weights{1, 2, 5};
  const OctreeDensity density = OctreeDensity::fromPoints(positions, weights, {2});
  EXPECT_DOUBLE_EQ(density.root().side, 1.01);
  EXPECT_NEAR(density.root().origin[0], -0.005, 1e-15);
  EXPECT_EQ(density.leafLevel(), 2);
  EXPECT_EQ(density.leafCount(), 3u);
  ASSERT_EQ(levelsOf(density).first, (std::vector<std::vector<uint64_t>>{{0}, {0, 1, 7}}));
  const auto root = density.logProbabilities(0);
  EXPECT_EQ(root[0], std::log(1.0f / 8.0f));
  EXPECT_EQ(root[1], std::log(2.0f / 8.0f));
  EXPECT_EQ(root[7], std::log(5.0f / 8.0f));
  for (const size_t k : {2, 3, 4, 5, 6}) EXPECT_EQ(root[k], kNoMass);
  // (0,0,0) lies in child 0 of cell 0, (1,0,0) in child 1 of cell 1, (1,1,1) in child 7 of cell 7.
  EXPECT_EQ(density.logProbabilities(1)[0], 0.0f);
  EXPECT_EQ(density.logProbabilities(1)[8 + 1], 0.0f);
  EXPECT_EQ(density.logProbabilities(1)[16 + 7], 0.0f);
}

TEST(OctreeDensity, LeafMassesAreTheSummedWeights) {
  const TestPoints points = wavyPoints(20000, 3);
  const OctreeDensity density = OctreeDensity::fromPoints(points.positions, points.weights, {5});
  std::map<uint64_t, double> expected;
  double total = 0.0;
  for (size_t i = 0; i < points.weights.size(); ++i) {
    std::array<uint32_t, 3> cell;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double u =
          (static_cast<double>(points.positions[3 * i + axis]) - density.root().origin[axis]) /
          density.root().side;
      cell[axis] = static_cast<uint32_t>(u * 32);
    }
    expected[mortonEncode(cell[0], cell[1], cell[2])] += static_cast<double>(points.weights[i]);
    total += static_cast<double>(points.weights[i]);
  }
  EXPECT_EQ(density.leafCount(), expected.size());
  std::map<uint64_t, double> log_q{{0, 0.0}};
  for (int level = 0; level < 5; ++level) {
    std::map<uint64_t, double> next;
    for (size_t i = 0; i < density.cells(level).size(); ++i) {
      for (uint64_t k = 0; k < 8; ++k) {
        const float log_p = density.logProbabilities(level)[8 * i + k];
        if (log_p == kNoMass) continue;
        next[density.cells(level)[i] << 3 | k] =
            log_q.at(density.cells(level)[i]) + static_cast<double>(log_p);
      }
    }
    log_q = next;
  }
  ASSERT_EQ(log_q.size(), expected.size());
  for (const auto& [leaf, mass] : expected) {
    // Five float32 logarithms above -12, each rounded by at most half an ulp of 4.8e-7.
    EXPECT_NEAR(log_q.at(leaf), std::log(mass / total), 5 * 4.8e-7);
  }
}

TEST(OctreeDensity, IsTheSameForAnyThreadCount) {
  const TestPoints points = wavyPoints(200000, 5);
  Levels levels[2];
  for (const unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] {
      levels[threads - 1] =
          levelsOf(OctreeDensity::fromPoints(points.positions, points.weights, {9}));
    });
  }
  EXPECT_TRUE(levels[0] == levels[1]);
}

TEST(OctreeDensity, EmptyWeightsAreEqualWeights) {
  const TestPoints points = wavyPoints(1000, 7);
  const std::vector<float> ones(1000, 1.0f);
  EXPECT_TRUE(levelsOf(OctreeDensity::fromPoints(points.positions, {}, {6})) ==
              levelsOf(OctreeDensity::fromPoints(points.positions, ones, {6})));
}

TEST(OctreeDensity, PointsWithoutWeightMakeNoLeaf) {
  const std::vector<float> positions{0, 0, 0, 1, 1, 1, 0.5f, 0.5f, 0};
  const std::vector<float> weights{0, 3, 0};
  const OctreeDensity density = OctreeDensity::fromPoints(positions, weights, {10});
  EXPECT_EQ(density.leafCount(), 1u);
  EXPECT_EQ(density.logProbabilities(0)[7], 0.0f);
}

TEST(OctreeDensity, ASinglePointGivesACubeOfAMillimetreAroundIt) {
  const std::vector<float> position{3, -2, 7};
  const OctreeDensity density = OctreeDensity::fromPoints(position, {}, {10});
  EXPECT_EQ(density.root().side, 0.001);
  for (size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(density.root().origin[axis], static_cast<double>(position[axis]) - 0.0005, 1e-15);
  }
  EXPECT_EQ(density.leafCount(), 1u);
}

TEST(OctreeDensity, AnswersMinusInfinityForCellsWithoutMass) {
  const OctreeDensity density = wavyOctree(3000, 6);
  const auto stored = density.cells(4);
  std::vector<uint64_t> questions;
  for (uint64_t cell = 0; cell < 4096; cell += 3) questions.push_back(cell);
  std::vector<float> answers(8 * questions.size());
  density.childLogProbabilities(4, questions, answers);
  size_t found = 0;
  for (size_t i = 0; i < questions.size(); ++i) {
    const auto at = std::lower_bound(stored.begin(), stored.end(), questions[i]);
    const bool here = at != stored.end() && *at == questions[i];
    found += here ? 1 : 0;
    for (size_t k = 0; k < 8; ++k) {
      const auto row = static_cast<size_t>(at - stored.begin());
      EXPECT_EQ(answers[8 * i + k], here ? density.logProbabilities(4)[8 * row + k] : kNoMass);
    }
  }
  EXPECT_GT(found, 10u);
  EXPECT_LT(found, questions.size() - 10);
}

TEST(OctreeDensity, RefusesAQuestionThatDoesNotFit) {
  const OctreeDensity density = wavyOctree(100, 3);
  const std::vector<uint64_t> cells{0};
  std::vector<float> out(7);
  EXPECT_THAT(refusal([&] { density.childLogProbabilities(0, cells, out); }),
              HasSubstr("room for 7"));
  out.resize(8);
  EXPECT_THAT(refusal([&] { density.childLogProbabilities(3, cells, out); }),
              AllOf(HasSubstr("level 3"), HasSubstr("0 to 2")));
}

TEST(OctreeDensity, RefusesBadPoints) {
  const auto build = [](std::vector<float> positions, std::vector<float> weights, int level) {
    return refusal([&] { OctreeDensity::fromPoints(positions, weights, {level}); });
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_THAT(build({}, {}, 5), HasSubstr("0 points"));
  EXPECT_THAT(build({0, 0}, {}, 5), HasSubstr("0 points"));
  EXPECT_THAT(build({0, 0, 0, 1}, {}, 5), HasSubstr("4 coordinates"));
  EXPECT_THAT(build({0, 0, 0}, {1, 1}, 5), HasSubstr("2 weights"));
  EXPECT_THAT(build({0, 0, 0, 0, nan, 0}, {}, 5), AllOf(HasSubstr("position 1"), HasSubstr("nan")));
  EXPECT_THAT(build({0, infinity, 0}, {}, 5), HasSubstr("position 0"));
  EXPECT_THAT(build({0, 0, 0}, {nan}, 5), HasSubstr("weight 0"));
  EXPECT_THAT(build({0, 0, 0, 1, 1, 1}, {1, -2}, 5), AllOf(HasSubstr("weight 1"), HasSubstr("-2")));
  EXPECT_THAT(build({0, 0, 0, 1, 1, 1}, {0, 0}, 5), HasSubstr("all 2 weights are 0"));
  EXPECT_THAT(build({0, 0, 0}, {}, 0), AllOf(HasSubstr("level is 0"), HasSubstr("1 to 10")));
  EXPECT_THAT(build({0, 0, 0}, {}, 11), HasSubstr("level is 11"));
}

TEST(OctreeDensity, ComesBackFromItsStoredLevels) {
  const OctreeDensity density = wavyOctree(5000, 7);
  const Levels levels = levelsOf(density);
  const OctreeDensity again =
      OctreeDensity::fromLevels(density.root(), levels.first, levels.second);
  EXPECT_TRUE(levelsOf(again) == levels);
  EXPECT_EQ(again.leafCount(), density.leafCount());
  EXPECT_EQ(again.root().origin, density.root().origin);
}

TEST(OctreeDensity, RefusesHostileLevels) {
  const OctreeDensity density = wavyOctree(2000, 4);
  const Levels good = levelsOf(density);
  const auto build = [&](const RootCube& root, const auto& change) {
    Levels levels = good;
    change(levels);
    return refusal([&] { OctreeDensity::fromLevels(root, levels.first, levels.second); });
  };
  const auto with = [&](const auto& change) { return build(density.root(), change); };
  EXPECT_EQ(with([](Levels&) {}), "");
  EXPECT_THAT(with([](Levels& l) { l = {}; }), HasSubstr("level is 0"));
  EXPECT_THAT(with([](Levels& l) { l.first.resize(11); }), HasSubstr("level is 11"));
  EXPECT_THAT(with([](Levels& l) { l.second.pop_back(); }), HasSubstr("3 levels"));
  EXPECT_THAT(with([](Levels& l) { l.first[0] = {1}; }), HasSubstr("cell 0"));
  EXPECT_THAT(with([](Levels& l) { l.first[0] = {}; }), HasSubstr("level 0 lists 0"));
  EXPECT_THAT(with([](Levels& l) { l.second[2].pop_back(); }), HasSubstr("8 for each"));
  EXPECT_THAT(with([](Levels& l) { l.second[2].resize(0); }), HasSubstr("8 for each"));
  EXPECT_THAT(with([](Levels& l) { std::swap(l.first[3][0], l.first[3][1]); }),
              HasSubstr("ascending"));
  EXPECT_THAT(with([](Levels& l) { l.first[3].back() = 1u << 30; }), HasSubstr("in its place"));
  EXPECT_THAT(
      with([](Levels& l) { l.first[3].pop_back(), l.second[3].resize(l.second[3].size() - 8); }),
      HasSubstr("nothing in its place"));
  EXPECT_THAT(with([](Levels& l) {
                l.first[3].push_back(4095);
                l.second[3].insert(l.second[3].end(), {0, kNoMass, kNoMass, kNoMass, kNoMass,
                                                       kNoMass, kNoMass, kNoMass});
              }),
              HasSubstr("cells with mass"));
  const auto value = [&](float log_p) {
    return with([log_p](Levels& l) { l.second[1][0] = log_p; });
  };
  EXPECT_THAT(value(std::numeric_limits<float>::quiet_NaN()), HasSubstr("nan"));
  EXPECT_THAT(value(std::numeric_limits<float>::infinity()), HasSubstr("inf"));
  EXPECT_THAT(value(0.5f), HasSubstr("0.5"));
  EXPECT_THAT(value(-800.0f), HasSubstr("-800"));
  EXPECT_THAT(
      with([](Levels& l) { std::fill(l.second[1].begin(), l.second[1].begin() + 8, kNoMass); }),
      HasSubstr("sum to 0"));
  EXPECT_THAT(
      with([](Levels& l) { std::fill(l.second[1].begin(), l.second[1].begin() + 8, -1.0f); }),
      HasSubstr("sum to 2.9"));
  EXPECT_THAT(build({{0, 0, 0}, 0.0}, [](Levels&) {}), HasSubstr("side is 0"));
  EXPECT_THAT(build({{0, 0, 0}, -1.0}, [](Levels&) {}), HasSubstr("side is -1"));
  EXPECT_THAT(build({{0, std::nan(""), 0}, 1.0}, [](Levels&) {}), HasSubstr("origin"));
}

}  // namespace
}  // namespace stipple
