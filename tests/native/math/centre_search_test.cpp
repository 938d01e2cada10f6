#include "math/clusters/centre_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "io/splats/sog_codebook.h"

namespace stipple {
namespace {

std::vector<float> randomVectors(size_t count, size_t width, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0.0f, 1.0f);
  std::vector<float> vectors(count * width);
  for (float& value : vectors) value = normal(random);
  return vectors;
}

TEST(CentreSearch, GivesTheSameBitsOnEveryInstructionSet) {
  // Counts around the tile of 32 centres and the four vectors that share their loads.
  for (const size_t width : {size_t{1}, size_t{9}, size_t{45}}) {
    for (const size_t centre_count : {size_t{1}, size_t{2}, size_t{31}, size_t{33}, size_t{256}}) {
      std::vector<float> centres = randomVectors(centre_count, width, 1);
      // Equal centres: the first one counts.
      if (centre_count > 5) {
        std::copy_n(&centres[2 * width], width, &centres[(centre_count - 1) * width]);
      }
      const CentreTable table(centres.data(), centre_count, width);
      for (const size_t count : {size_t{1}, size_t{3}, size_t{4}, size_t{66}}) {
        std::vector<float> vectors = randomVectors(count, width, 2);
        std::copy_n(&centres[(centre_count > 5 ? 2 : 0) * width], width, vectors.data());
        std::vector<NearestTwo> expected(count);
        searchCentresPlainly(vectors.data(), count, table, expected.data());
        for (const NamedCentreSearch& named : centreSearches()) {
          std::vector<NearestTwo> found(count);
          named.search(vectors.data(), count, table, found.data());
          for (size_t i = 0; i < count; ++i) {
            for (size_t place = 0; place < 2; ++place) {
              EXPECT_EQ(found[i].index[place], expected[i].index[place]) << named.target;
              EXPECT_EQ(std::bit_cast<uint32_t>(found[i].score[place]),
                        std::bit_cast<uint32_t>(expected[i].score[place]))
                  << named.target;
            }
          }
        }
      }
    }
  }
}

TEST(CentreSearch, FindsTheNearestByDistancesInDouble) {
  const size_t width = 45, count = 200, centre_count = 100;
  const std::vector<float> centres = randomVectors(centre_count, width, 3);
  const std::vector<float> vectors = randomVectors(count, width, 4);
  const CentreTable table(centres.data(), centre_count, width);
  std::vector<NearestTwo> found(count);
  chosenCentreSearch()(vectors.data(), count, table, found.data());
  const auto distance = [&](size_t i, size_t c) {
    double sum = 0;
    for (size_t k = 0; k < width; ++k) {
      const double d = double(vectors[i * width + k]) - double(centres[c * width + k]);
      sum += d * d;
    }
    return sum;
  };
  for (size_t i = 0; i < count; ++i) {
    double half_square = 0;
    for (size_t k = 0; k < width; ++k) {
      half_square += 0.5 * double(vectors[i * width + k]) * double(vectors[i * width + k]);
    }
    // Sums of 45 products near 1: rounding stays below 45 * 45 * 6e-8.
    const double slack = 1.3e-4;
    int below_first = 0, below_second = 0;
    for (size_t c = 0; c < centre_count; ++c) {
      below_first += 0.5 * distance(i, c) < 0.5 * distance(i, found[i].index[0]) - slack ? 1 : 0;
      below_second += 0.5 * distance(i, c) < 0.5 * distance(i, found[i].index[1]) - slack ? 1 : 0;
    }
    EXPECT_EQ(below_first, 0);
    EXPECT_LE(below_second, 1);
    for (size_t place = 0; place < 2; ++place) {
      EXPECT_NEAR(double(found[i].score[place]) + half_square,
                  0.5 * distance(i, found[i].index[place]), slack);
    }
    EXPECT_NE(found[i].index[0], found[i].index[1]);
  }
}

TEST(CentreSearch, SaysWhereThereIsNoSecond) {
  const float centre[] = {1.0f, 2.0f};
  const CentreTable table(centre, 1, 2);
  NearestTwo found;
  const float vector[] = {1.0f, 0.0f};
  chosenCentreSearch()(vector, 1, table, &found);
  EXPECT_EQ(found.index[0], 0u);
  EXPECT_EQ(found.score[0], 1.5f);  // (1 + 4) / 2 - 1
  EXPECT_EQ(found.score[1], std::numeric_limits<float>::max());
}

TEST(NearestCode, IsTheNearestOfTheCodebook) {
  std::mt19937 random(7);
  std::normal_distribution<float> normal(0.0f, 1.0f);
  for (const float spread : {1e-30f, 1.0f, 1e30f}) {
    std::vector<float> values(5000);
    for (float& value : values) value = spread * normal(random);
    const Codebook codebook = makeCodebook(values);
    const NearestCode code(codebook);
    for (int i = 0; i < 20000; ++i) {
      const float value = 1.3f * spread * normal(random);
      ASSERT_EQ(code(value), codebook.nearest(value)) << value;
    }
    for (size_t k = 0; k < 256; ++k) {
      ASSERT_EQ(code(codebook.values[k]), codebook.nearest(codebook.values[k]));
    }
    for (const float value :
         {0.0f, -0.0f, std::numeric_limits<float>::max(), std::numeric_limits<float>::lowest()}) {
      EXPECT_EQ(code(value), codebook.nearest(value));
    }
  }
  // One value for all, and ends so far apart that their difference is infinite.
  Codebook flat;
  flat.values.fill(2.0f);
  EXPECT_EQ(NearestCode(flat)(3.0f), flat.nearest(3.0f));
  EXPECT_EQ(NearestCode(flat)(1.0f), flat.nearest(1.0f));
  EXPECT_EQ(NearestCode(flat)(2.0f), flat.nearest(2.0f));
  Codebook wide = flat;
  wide.values.front() = std::numeric_limits<float>::lowest();
  wide.values.back() = std::numeric_limits<float>::max();
  for (const float value : {-3e38f, -1.0f, 2.0f, 5.0f, 3e38f}) {
    EXPECT_EQ(NearestCode(wide)(value), wide.nearest(value)) << value;
  }
}

}  // namespace
}  // namespace stipple
