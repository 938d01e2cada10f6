#include "decode/field/feature_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"

namespace stipple {
namespace {

std::vector<float> numbers(size_t count, uint64_t seed) {
  std::vector<float> out(count);
  for (size_t i = 0; i < count; ++i) {
    out[i] = unitFloat(keyedBits(seed, RandomUse::kFieldStart, i));
  }
  return out;
}

/// One level that is dense, one that is hashed.
FeatureGrid smallGrid(size_t channels) {
  const int levels[] = {2, 5};
  const uint32_t rows[] = {1 << 12, 1 << 6};
  return FeatureGrid(channels, levels, rows, 1.0f, 3);
}

TEST(FeatureGrid, IsTrilinearBetweenCorners) {
  const int levels[] = {1};
  const uint32_t rows[] = {1 << 12};
  FeatureGrid grid(1, levels, rows, 0.0f, 1);
  ASSERT_EQ(grid.levels()[0].row_count, 27u);
  // x + 10 y + 100 z at the corners of half cubes: trilinear interpolation gives it everywhere.
  for (size_t i = 0; i < 27; ++i) {
    const size_t x = i % 3, y = i / 3 % 3, z = i / 9;
    grid.levels()[0].values[i] = 0.5f * static_cast<float>(x + 10 * y + 100 * z);
  }
  const std::vector<float> places = {0, 0,    0,    0.25f, 0.5f, 0.75f, 1,   1,
                                     1, 0.9f, 0.1f, 0.3f,  -1,   2,     0.5f};
  const std::vector<float> footprints(5, 1e-5f);
  std::vector<float> out(5);
  grid.concatenate({places, footprints}, out.data(), 1);
  const float expected[] = {0, 80.25f, 111, 31.9f, 60};
  for (size_t i = 0; i < 5; ++i) EXPECT_NEAR(out[i], expected[i], 2e-5f) << i;
}

TEST(FeatureGrid, CoarseFootprintsFadeFineLevels) {
  const FeatureGrid grid = smallGrid(2);
  const std::vector<float> place = {0.3f, 0.4f, 0.5f};
  std::vector<float> sharp(4), wide(4);
  grid.concatenate({place, std::vector<float>{1e-4f}}, sharp.data(), 4);
  grid.concatenate({place, std::vector<float>{0.5f}}, wide.data(), 4);
  // Cells of 1/4 and 1/32, half and a sixteenth of the footprint.
  for (size_t c = 0; c < 2; ++c) {
    EXPECT_NEAR(wide[c] / sharp[c], 1 / std::sqrt(1 + 1.25 * 4), 1e-5);
    EXPECT_NEAR(wide[2 + c] / sharp[2 + c], 1 / std::sqrt(1 + 1.25 * 256), 1e-5);
  }
}

TEST(FeatureGrid, GradientsAreThoseOfDifferences) {
  constexpr size_t kCount = 40;
  constexpr size_t kChannels = 3;
  FeatureGrid grid = smallGrid(kChannels);
  std::vector<float> places = numbers(kCount * 3, 4);
  const std::vector<float> footprints(kCount, 0.02f);
  const std::vector<float> factors = numbers(kCount * 8, 5);
  const auto lossOf = [&](bool sum) {
    std::vector<float> out(kCount * 8, 0.0f);
    if (sum) {
      grid.addSum({places, footprints}, out.data(), 8);
    } else {
      grid.concatenate({places, footprints}, out.data(), 8);
    }
    double loss = 0;
    for (size_t i = 0; i < out.size(); ++i) {
      const size_t column = i % 8;
      if (column < (sum ? kChannels : 2 * kChannels)) {
        loss += static_cast<double>(out[i]) * static_cast<double>(factors[i]);
      }
    }
    return loss;
  };
  std::vector<float> by_place(kCount * 3, 0.0f);
  grid.addPositionGradient({places, footprints}, factors.data(), 8, by_place);
  for (const bool sum : {false, true}) {
    std::vector<FeatureGradient> gradients;
    if (sum) {
      grid.backwardSum({places, footprints}, factors.data(), 8, gradients);
    } else {
      grid.backwardConcatenated({places, footprints}, factors.data(), 8, gradients);
    }
    for (size_t l = 0; l < 2; ++l) {
      for (size_t i = 0; i < grid.levels()[l].values.size(); i += 7) {
        float& value = grid.levels()[l].values[i];
        const float kept = value;
        value = kept + 0.5f;  // linear: only rounding, of sums of 200 numbers below 1
        const double high = lossOf(sum);
        value = kept - 0.5f;
        const double low = lossOf(sum);
        value = kept;
        EXPECT_NEAR(static_cast<double>(gradients[l].values[i]), high - low, 2e-5);
        if (gradients[l].values[i] != 0) {
          EXPECT_EQ(gradients[l].listed[i / kChannels], 1);
        }
      }
    }
  }
  for (size_t i = 0; i < places.size(); ++i) {
    const float kept = places[i];
    // Within a cell the sum is trilinear: exact but for rounding, and for places whose step
    // crosses a corner plane of the finer level, 1/32 apart.
    const float eps = 1e-4f;
    const float scaled = 32.0f * kept;
    if (std::abs(scaled - std::round(scaled)) < 64 * eps) continue;
    places[i] = kept + eps;
    const double above = static_cast<double>(places[i]);
    const double high = lossOf(true);
    places[i] = kept - eps;
    const double below = static_cast<double>(places[i]);
    const double low = lossOf(true);
    places[i] = kept;
    // float32 outputs of about 2: 2.4e-7 / 2e-4, times a few.
    EXPECT_NEAR(static_cast<double>(by_place[i]), (high - low) / (above - below), 2e-2);
  }
}

TEST(FeatureGrid, ListsTheRowsThatItTouchesAndClearsThem) {
  const FeatureGrid grid = smallGrid(2);
  const std::vector<float> place = {0.3f, 0.4f, 0.5f};
  const std::vector<float> footprint = {0.01f};
  const std::vector<float> factors = {1, 1, 1, 1};
  std::vector<FeatureGradient> gradients;
  grid.backwardConcatenated({place, footprint}, factors.data(), 4, gradients);
  EXPECT_EQ(gradients[0].rows.size(), 8u);
  EXPECT_LE(gradients[1].rows.size(), 8u) << "corners may share a row";
  for (FeatureGradient& gradient : gradients) {
    gradient.clear(2);
    EXPECT_TRUE(gradient.rows.empty());
    for (const float value : gradient.values) EXPECT_EQ(value, 0.0f);
    for (const uint8_t listed : gradient.listed) EXPECT_EQ(listed, 0);
  }
}

TEST(FeatureGrid, HasTheSameBitsForAnyNumberOfThreads) {
  const FeatureGrid grid = smallGrid(4);
  const std::vector<float> places = numbers(3000, 6);
  const std::vector<float> footprints(1000, 0.01f);
  const std::vector<float> factors = numbers(8000, 7);
  std::vector<float> first, first_gradient;
  for (const unsigned threads : {1u, 3u}) {
    std::vector<float> out(8000);
    std::vector<FeatureGradient> gradients;
    withThreads(threads, [&] {
      grid.concatenate({places, footprints}, out.data(), 8);
      grid.backwardConcatenated({places, footprints}, factors.data(), 8, gradients);
    });
    if (first.empty()) first = out, first_gradient = gradients[1].values;
    EXPECT_EQ(out, first);
    EXPECT_EQ(gradients[1].values, first_gradient);
  }
}

TEST(FeatureGrid, RefusesStoredLevelsOfOtherSizes) {
  const auto messageOf = [](std::vector<FeatureLevel> levels) -> std::string {
    try {
      FeatureGrid grid(2, std::move(levels));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  const std::vector<FeatureLevel> good = smallGrid(2).levels();
  EXPECT_EQ(messageOf(good), "");
  std::vector<FeatureLevel> levels = good;
  levels[1].row_count = 63;
  EXPECT_THAT(messageOf(levels), ::testing::HasSubstr("features of level 5 have 63 rows"));
  levels = good;
  levels[0].values.pop_back();
  EXPECT_THAT(messageOf(levels), ::testing::HasSubstr("features of level 2"));
  levels = good;
  levels[0].level = 40;
  EXPECT_THAT(messageOf(levels), ::testing::HasSubstr("features of level 40"));
}

}  // namespace
}  // namespace stipple
