#include "math/clusters/vector_palette.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/error.h"
#include "base/parallel.h"
#include "io/splats/sog_codebook.h"

namespace stipple {
namespace {

std::vector<float> randomVectors(size_t n, size_t width, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0.0f, 1.0f);
  std::vector<float> vectors(n * width);
  for (float& value : vectors) value = normal(random);
  return vectors;
}

double squaredError(const std::vector<float>& vectors, size_t width, const VectorPalette& palette) {
  double sum = 0;
  for (size_t i = 0; i < vectors.size(); ++i) {
    const double difference =
        double(vectors[i]) - double(palette.vectors[palette.labels[i / width] * width + i % width]);
    sum += difference * difference;
  }
  return sum;
}

TEST(VectorPalette, KeepsFewDifferentVectorsExactly) {
  const std::vector<float> few = randomVectors(50, 9, 1);
  std::vector<float> vectors;
  for (size_t i = 0; i < 3000; ++i) {
    const auto row = few.begin() + static_cast<std::ptrdiff_t>(i * 7 % 50 * 9);
    vectors.insert(vectors.end(), row, row + 9);
  }
  PaletteOptions options;
  options.max_count = 50;
  const VectorPalette palette = makeVectorPalette(vectors.data(), 3000, 9, options, nullptr);
  EXPECT_EQ(palette.count, 50u);
  EXPECT_EQ(squaredError(vectors, 9, palette), 0.0);
  options.max_count = 49;
  EXPECT_LE(makeVectorPalette(vectors.data(), 3000, 9, options, nullptr).count, 49u);
}

TEST(VectorPalette, FindsClustersThatAreApart) {
  // 64 clusters, 100 apart and 0.01 wide: the best palette's error is that of the clusters' means,
  // n width 1e-4 within the 1 % by which a sum of 46,080 squares varies.
  const size_t n = 5120, width = 9;
  std::vector<float> vectors = randomVectors(n, width, 2);
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < width; ++k) {
      float& value = vectors[i * width + k];
      value = 0.01f * value + (k < 6 && (i % 64 >> k & 1) != 0 ? 100.0f : 0.0f);
    }
  }
  PaletteOptions options;
  options.max_count = 256;
  const VectorPalette palette = makeVectorPalette(vectors.data(), n, width, options, nullptr);
  EXPECT_LE(palette.count, 256u);
  EXPECT_LT(squaredError(vectors, width, palette), 1.01e-4 * double(n * width));
}

TEST(VectorPalette, ComesCloseToPlainKMeans) {
  const size_t n = 4096, width = 9, count = 256;
  const std::vector<float> vectors = randomVectors(n, width, 3);
  // Lloyd's on all vectors with every centre tried, 20 rounds in double.
  std::vector<double> centres(vectors.begin(), vectors.begin() + count * width);
  std::vector<size_t> labels(n);
  double plain = 0;
  for (int round = 0; round < 20; ++round) {
    plain = 0;
    for (size_t i = 0; i < n; ++i) {
      double best = 1e300;
      for (size_t c = 0; c < count; ++c) {
        double distance = 0;
        for (size_t k = 0; k < width; ++k) {
          const double d = double(vectors[i * width + k]) - centres[c * width + k];
          distance += d * d;
        }
        if (distance < best) labels[i] = c;
        best = std::min(best, distance);
      }
      plain += best;
    }
    std::vector<double> sums(count * width, 0.0);
    std::vector<double> members(count, 0.0);
    for (size_t i = 0; i < n; ++i) {
      members[labels[i]] += 1;
      for (size_t k = 0; k < width; ++k) {
        sums[labels[i] * width + k] += double(vectors[i * width + k]);
      }
    }
    for (size_t c = 0; c < count * width; ++c) {
      if (members[c / width] > 0) centres[c] = sums[c] / members[c / width];
    }
  }
  PaletteOptions options;
  options.max_count = count;
  const VectorPalette palette = makeVectorPalette(vectors.data(), n, width, options, nullptr);
  // Round noise has no structure that a tree could use, so this is its worst case: 5 % were seen.
  EXPECT_LT(squaredError(vectors, width, palette), 1.10 * plain);
}

TEST(VectorPalette, IsTheSameForAnyNumberOfThreads) {
  const std::vector<float> vectors = randomVectors(20000, 24, 4);
  PaletteOptions options;
  options.max_count = 2048;
  VectorPalette made[2];
  for (unsigned threads : {1u, 3u}) {
    withThreads(threads, [&] {
      made[threads / 2] = makeVectorPalette(vectors.data(), 20000, 24, options, nullptr);
    });
  }
  EXPECT_EQ(made[0].vectors, made[1].vectors);
  EXPECT_EQ(made[0].labels, made[1].labels);
}

TEST(VectorPalette, TakesAHeapOfEqualVectors) {
  // Most splats of a scene without detail have no harmonics at all.
  std::vector<float> vectors(20000 * 9, 0.0f);
  const std::vector<float> others = randomVectors(2000, 9, 5);
  std::copy(others.begin(), others.end(), vectors.begin());
  PaletteOptions options;
  options.max_count = 1024;
  const VectorPalette palette = makeVectorPalette(vectors.data(), 20000, 9, options, nullptr);
  for (size_t i = 2000; i < 20000; ++i) {
    for (size_t k = 0; k < 9; ++k) {
      // The mean of a heap and its near neighbours, of which there are few.
      ASSERT_NEAR(palette.vectors[palette.labels[i] * size_t{9} + k], 0.0f, 1e-3f);
    }
  }
  EXPECT_EQ(makeVectorPalette(vectors.data(), 0, 9, options, nullptr).count, 0u);
}

TEST(VectorPalette, CanBeCancelled) {
  const std::vector<float> vectors = randomVectors(5000, 9, 6);
  Progress progress;
  progress.cancel();
  PaletteOptions options;
  options.max_count = 1024;
  try {
    makeVectorPalette(vectors.data(), 5000, 9, options, &progress);
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(static_cast<int>(error.code()), static_cast<int>(ErrorCode::kCancelled));
  }
}

TEST(Codebook, KeepsFewDifferentValuesExactly) {
  std::vector<float> values;
  for (int i = 0; i < 5000; ++i) values.push_back(static_cast<float>(i % 256) * 0.37f - 40.0f);
  const Codebook codebook = makeCodebook(values);
  for (const float value : values) EXPECT_EQ(codebook.values[codebook.nearest(value)], value);
  EXPECT_EQ(makeCodebook({}).values[255], 0.0f);
  EXPECT_EQ(makeCodebook({3.0f, 3.0f}).values[0], 3.0f);
  EXPECT_EQ(makeCodebook({3.0f, 3.0f}).values[255], 3.0f);
}

TEST(Codebook, NearestIsTheNearest) {
  const Codebook codebook = makeCodebook(randomVectors(10000, 1, 7));
  EXPECT_TRUE(std::is_sorted(codebook.values.begin(), codebook.values.end()));
  for (const float value : randomVectors(2000, 1, 8)) {
    float best = INFINITY;
    for (const float kept : codebook.values) best = std::min(best, std::abs(kept - value));
    EXPECT_EQ(std::abs(codebook.values[codebook.nearest(value)] - value), best);
  }
}

TEST(Codebook, ComesCloseToTheBestForAGaussian) {
  // Panter and Dite: the least mean squared error of n levels is (∫ p^(1/3))^3 / (12 n^2), for a
  // unit Gaussian sqrt(3) pi / 2 / n^2. 256 levels and 2e5 samples come within 6 % of that limit.
  const std::vector<float> values = randomVectors(200000, 1, 9);
  const Codebook codebook = makeCodebook(values);
  double sum = 0;
  for (const float value : values) {
    const double difference = double(codebook.values[codebook.nearest(value)]) - double(value);
    sum += difference * difference;
  }
  EXPECT_LT(sum / 200000.0, 1.10 * std::sqrt(3.0) * M_PI / 2.0 / 65536.0);
}

TEST(Codebook, StandsForRareValuesToo) {
  std::vector<float> values = randomVectors(5000, 1, 11);
  const Codebook codebook = makeCodebook(values);
  double largest = 0;
  for (const float value : values) {
    largest = std::max(largest,
                       std::abs(double(codebook.values[codebook.nearest(value)]) - double(value)));
  }
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  // Even steps have 1/512 of the range; k-means alone has 1/30 of it, out where values are few.
  EXPECT_LT(largest, 3.0 / 512.0 * (double(*high) - double(*low)));
}

TEST(Codebook, SurvivesOutliers) {
  // Scales of 0 have the logarithm -104 in files.
  std::vector<float> values = randomVectors(100000, 1, 10);
  values.push_back(-104.0f);
  const Codebook codebook = makeCodebook(values);
  EXPECT_EQ(codebook.values[0], -104.0f);
  values.pop_back();
  double sum = 0;
  for (const float value : values) {
    const double difference = double(codebook.values[codebook.nearest(value)]) - double(value);
    sum += difference * difference;
  }
  // The limit for a Gaussian as above, with room for a start that sees it in few bins.
  EXPECT_LT(sum / 100000.0, 1.3 * std::sqrt(3.0) * M_PI / 2.0 / 65536.0);
}

}  // namespace
}  // namespace stipple
