#include "decode/latent/latent_density.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "density/anchor_sampling.h"
#include "latent/tiny_latent.h"
#include "math/morton.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;

const std::string kFile = STIPPLE_TEST_DATA "/networks/deg_decoder_b.safetensors";

LatentDensity tinyDensity() {
  return LatentDensity(readLatentNetworks(tinyFile(kFile)).octree, tinyLatent(kFile));
}

/// Cells of a level, more than are worked on at once.
std::vector<uint64_t> manyCells() {
  std::vector<uint64_t> cells;
  for (uint64_t i = 0; i < OctreeNetwork::kRows + 300; ++i) cells.push_back(3 * i);
  return cells;
}

TEST(LatentDensity, AsksTheNetworkAboutTheMiddlesOfCells) {
  // The path that takes child l - 1 at level l.
  const double centres[8][3] = {{.5, .5, .5},
                                {.25, .25, .25},
                                {.375, .125, .125},
                                {.3125, .1875, .0625},
                                {.34375, .21875, .03125},
                                {.328125, .203125, .046875},
                                {.3359375, .1953125, .0546875},
                                {.33203125, .19921875, .05859375}};
  uint64_t cell = 0;
  for (int level = 0; level < 8; ++level) {
    const std::vector<float> centre = OctreeNetwork::centresOf(level, std::span(&cell, 1));
    for (size_t axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(static_cast<double>(centre[axis]), centres[level][axis]) << level;
    }
    cell = cell << 3 | static_cast<uint64_t>(level);
  }
  EXPECT_EQ(cell, mortonEncode(85, 51, 15));
}

TEST(LatentDensity, ProbabilitiesOfEachCellSumToOne) {
  const LatentDensity density = tinyDensity();
  const std::vector<uint64_t> cells = manyCells();
  std::vector<float> logs(8 * cells.size());
  density.childLogProbabilities(5, cells, logs);
  for (size_t i = 0; i < cells.size(); ++i) {
    double sum = 0;
    for (size_t k = 0; k < 8; ++k) sum += std::exp(static_cast<double>(logs[8 * i + k]));
    EXPECT_NEAR(sum, 1.0, 1e-6);  // eight logarithms rounded to float32
  }
}

TEST(LatentDensity, AnswersForACellWhateverIsAskedBesideIt) {
  const LatentDensity density = tinyDensity();
  const std::vector<uint64_t> cells = manyCells();
  std::vector<float> together(8 * cells.size());
  density.childLogProbabilities(5, cells, together);
  // Layers take other ways for few rows than for many.
  for (const size_t count : {size_t{2}, size_t{33}, Linear::kFewRows, Linear::kFewRows + 1}) {
    std::vector<float> some(8 * count);
    density.childLogProbabilities(5, std::span(cells).first(count), some);
    EXPECT_TRUE(std::equal(some.begin(), some.end(), together.begin())) << count;
  }
  for (const size_t i : {size_t{0}, size_t{77}, OctreeNetwork::kRows, cells.size() - 1}) {
    float alone[8];
    density.childLogProbabilities(5, std::span(&cells[i], 1), alone);
    // Bits: anchors of a small budget must be among those of a large one.
    for (size_t k = 0; k < 8; ++k) EXPECT_EQ(alone[k], together[8 * i + k]) << i;
  }
}

TEST(LatentDensity, IsSampledSystematicallyWithCountsBesideTheirExpectation) {
  const LatentDensity density = tinyDensity();
  const AnchorSet anchors = sampleAnchors(density, {.count = 500, .seed = 3});
  ASSERT_EQ(anchors.size(), 500u);
  const uint64_t root = 0;
  float logs[8];
  density.childLogProbabilities(0, std::span(&root, 1), logs);
  std::vector<double> counts(8);
  for (const uint64_t leaf : anchors.leaves) counts[leaf >> 21] += 1;
  for (size_t k = 0; k < 8; ++k) {
    const double expected = 500 * std::exp(static_cast<double>(logs[k]));
    EXPECT_LE(std::abs(counts[k] - expected), 1.0) << "floor or ceiling";
  }
}

TEST(LatentDensity, IsSampledProgressivelyWithNestedBudgets) {
  const LatentDensity density = tinyDensity();
  const auto draw = [&](uint64_t count) {
    const AnchorSet anchors =
        sampleAnchors(density, {.count = count, .order = AnchorOrder::kProgressive, .seed = 5});
    std::multiset<std::pair<uint64_t, float>> places;
    for (size_t i = 0; i < anchors.size(); ++i) {
      places.insert({anchors.leaves[i], anchors.positions[3 * i]});
    }
    return places;
  };
  const auto few = draw(100), many = draw(2000);
  EXPECT_EQ(many.size(), 2000u);
  EXPECT_TRUE(std::includes(many.begin(), many.end(), few.begin(), few.end()));
}

TEST(LatentDensity, GivesTheSameBitsForAnyNumberOfThreads) {
  const LatentDensity density = tinyDensity();
  const std::vector<uint64_t> cells = manyCells();
  std::vector<float> one(8 * cells.size()), many(8 * cells.size());
  withThreads(1, [&] { density.childLogProbabilities(6, cells, one); });
  withThreads(4, [&] { density.childLogProbabilities(6, cells, many); });
  EXPECT_EQ(one, many);
}

/// Cancels while a level is asked about.
class CancellingDensity final : public DensityModel {
 public:
  CancellingDensity(const LatentDensity& density, int at) : density_(density), at_(at) {}
  int leafLevel() const override { return density_.leafLevel(); }
  const RootCube& root() const override { return density_.root(); }
  void childLogProbabilities(int level, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* progress) const override {
    last_level = level;
    if (level == at_) progress->cancel();
    density_.childLogProbabilities(level, cells, out, progress);
    if (level == at_) was_answered = true;
  }
  mutable int last_level = -1;
  mutable bool was_answered = false;

 private:
  const LatentDensity& density_;
  int at_;
};

TEST(LatentDensity, StopsWithinALevelWhenCancelled) {
  const LatentDensity density = tinyDensity();
  const CancellingDensity cancelling(density, 4);
  Progress progress;
  try {
    sampleAnchors(cancelling, {.count = 3000}, &progress);
    FAIL() << "it went on";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
  EXPECT_EQ(cancelling.last_level, 4);
  EXPECT_FALSE(cancelling.was_answered) << "the network stopped, not the sampler behind it";
}

std::string refusal(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "not refused";
}

TEST(LatentDensity, RefusesWhatItCannotAnswer) {
  const LatentDensity density = tinyDensity();
  const std::vector<uint64_t> cells = {0};
  std::vector<float> out(8);
  EXPECT_THAT(refusal([&] { density.childLogProbabilities(8, cells, out); }),
              HasSubstr("level of the cells is 8; allowed is 0 to 7"));
  const auto octree = readLatentNetworks(tinyFile(kFile)).octree;
  auto latent = std::make_shared<Latent>(*tinyLatent(kFile));
  EXPECT_THAT(refusal([&] { LatentDensity(octree, latent, {}, 11); }),
              HasSubstr("leaf level of a latent's density is 11; allowed is 1 to 10"));
  latent->width = 8;
  EXPECT_THAT(refusal([&] { LatentDensity(octree, latent); }),
              HasSubstr("has 8 numbers for each token; these weights read 16"));
  latent->width = 16;
  latent->tokens.pop_back();
  EXPECT_THAT(refusal([&] { LatentDensity(octree, latent); }), HasSubstr("511 numbers for 32"));
  latent->tokens.push_back(std::numeric_limits<float>::quiet_NaN());
  EXPECT_THAT(refusal([&] { LatentDensity(octree, latent); }), HasSubstr("token 31"));
}

TEST(LatentDensity, SaysHowMuchMemoryAnAnswerTakes) {
  const LatentDensity density = tinyDensity();
  // 32 tokens of 16 numbers, once with a 1 behind them; a rate of each for 4 heads of one block, and
  // the keys and values that it comes from; 1,024 rows of tokens and two rooms of 64, an MLP of 256,
  // points.
  EXPECT_EQ(density.answerMemoryBound(),
            (32u * 33 + 32 * 4 + 32 * 2 * 64 + 1024u * (3 * 64 + 256 + 3)) * 4);
}

}  // namespace
}  // namespace stipple
