#include "splat/cpu/tiles/tile_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>

#include "base/error.h"
#include "splat/cpu/tiles/tile_kernel_backward.h"
#include "splat/cpu/tiles/tile_splats.h"

namespace stipple {
namespace {

struct Rng {
  std::mt19937 random;
  float operator()(float low, float high) {
    return low + (high - low) * (static_cast<float>(random() >> 8) * 0x1.0p-24f);
  }
};

std::vector<TileSplat> randomSplats(size_t count, float opacity_low, uint32_t seed) {
  Rng uniform{std::mt19937(seed)};
  std::vector<TileSplat> splats(count);
  for (TileSplat& s : splats) {
    s.l00 = uniform(0.05f, 0.6f);
    s.l10 = uniform(-0.4f, 0.4f);
    s.l11 = uniform(0.05f, 0.6f);
    const float x = uniform(-2, 18);
    const float y = uniform(-2, 18);
    s.g0 = -s.l00 * x;
    s.g1 = -s.l10 * x - s.l11 * y;
    s.log2_opacity = std::log2(uniform(opacity_low, 1.0f));
    s.doubt_low = s.doubt_high = 5e-5f;
    s.finish_doubt = 2e-3f;
    for (float& c : s.colour) c = uniform(0, 1);
    s.depth = uniform(1, 5);
    s.row_begin = 0;
    s.row_end = kTileSide;
  }
  return splats;
}

TilePixels emptyPixels() {
  TilePixels pixels{};
  for (uint32_t i = 0; i < kTilePixelCount; ++i) {
    pixels.transmittance[i] = 1;
    pixels.median_depth[i] = kNoMedian;
    pixels.cut[i] = kLog2MinAlpha;
  }
  // Outside the picture: must stay untouched.
  pixels.cut[kTilePixelCount - 1] = kFinished;
  pixels.unfinished = kTilePixelCount - 1;
  return pixels;
}

TEST(TileKernel, HasTheScalarOneAndAtLeastOneVectorTarget) {
  const std::vector<NamedTileKernel> kernels = tileKernels();
  ASSERT_GE(kernels.size(), 2u);
  EXPECT_EQ(std::string(kernels.front().target), "scalar");
}

TEST(TileKernel, EveryTargetBlendsAsTheScalarOne) {
  for (const float opacity_low : {0.005f, 0.3f, 0.9f}) {
    for (const TileKernelOptions& options :
         {TileKernelOptions{false, false}, TileKernelOptions{true, false},
          TileKernelOptions{false, true}, TileKernelOptions{true, true}}) {
      const std::vector<TileSplat> splats = randomSplats(300, opacity_low, 11);
      TilePixels expected = emptyPixels();
      blendTileScalar(splats.data(), splats.size(), options, expected);
      for (const NamedTileKernel& named : tileKernels()) {
        SCOPED_TRACE(named.target);
        TilePixels seen = emptyPixels();
        named.kernel(splats.data(), splats.size(), options, seen);
        size_t doubts_differ = 0;
        for (uint32_t i = 0; i < kTilePixelCount; ++i) {
          if (seen.doubt[i] != 0 || expected.doubt[i] != 0) {
            doubts_differ += seen.doubt[i] != expected.doubt[i];
            continue;
          }
          // Fused products and the polynomial change the last bits: 3e-7 per alpha, grown by at
          // most 1/(1 - alpha) = 100 in T, whose own size is then 0.01.
          EXPECT_NEAR(seen.transmittance[i], expected.transmittance[i], 1e-6);
          EXPECT_NEAR(seen.red[i], expected.red[i], 5e-6);
          EXPECT_NEAR(seen.green[i], expected.green[i], 5e-6);
          EXPECT_NEAR(seen.blue[i], expected.blue[i], 5e-6);
          EXPECT_NEAR(seen.weighted_depth[i], expected.weighted_depth[i], 2e-5);
          EXPECT_EQ(seen.median_depth[i], expected.median_depth[i]);
          EXPECT_EQ(seen.count[i], expected.count[i]);
          EXPECT_EQ(seen.cut[i], expected.cut[i]);
        }
        // Only a pixel at the very rim of the doubtful band can fall in on one side and out on the
        // other.
        EXPECT_LE(doubts_differ, 2u);
        EXPECT_EQ(seen.transmittance[kTilePixelCount - 1], 1.0f);
      }
    }
  }
}

/// Random splats whose boxes are as high as they can show: |g|^2 <= 8 + log2(opacity).
std::vector<TileSplat> boxedSplats(size_t count) {
  std::vector<TileSplat> splats = randomSplats(count, 0.005f, 12);
  for (TileSplat& s : splats) {
    const float x = -s.g0 / s.l00;
    const float y = -(s.g1 + s.l10 * x) / s.l11;
    const float half =
        std::sqrt(8.0f + s.log2_opacity) * std::hypot(1.0f, s.l10 / s.l00) / s.l11 + 0.01f;
    s.row_begin = static_cast<uint32_t>(std::clamp(std::ceil(y - half), 0.0f, 16.0f));
    s.row_end = static_cast<uint32_t>(std::clamp(std::floor(y + half) + 1.0f, 0.0f, 16.0f));
  }
  return splats;
}

constexpr TileCulling kLesserCullings[] = {TileCulling::kNothing, TileCulling::kRows};

TEST(TileKernel, GivesTheSameBitsWithoutCullingBelowTheTile) {
  const std::vector<TileSplat> splats = boxedSplats(300);
  for (const NamedTileKernel& named : tileKernels()) {
    SCOPED_TRACE(named.target);
    TileKernelOptions options{true, false};
    TilePixels culled = emptyPixels();
    named.kernel(splats.data(), splats.size(), options, culled);
    EXPECT_LT(culled.unfinished, kTilePixelCount - 1);
    for (const TileCulling culling : kLesserCullings) {
      TilePixels whole = emptyPixels();
      options.culling = culling;
      named.kernel(splats.data(), splats.size(), options, whole);
      EXPECT_EQ(std::memcmp(&culled, &whole, sizeof(TilePixels)), 0);
    }
  }
}

TEST(TileKernel, TakesOffTheSameBitsWithoutCullingBelowTheTile) {
  const std::vector<TileSplat> splats = boxedSplats(300);
  const BackwardWants wants{BackwardMode::kGradients, false};
  const auto neverShows = [](const void*, size_t, uint32_t, BackwardPixels&, float*) {};
  for (const BackwardKernel& kernel : backwardKernels()) {
    SCOPED_TRACE(kernel.target);
    TilePixels blended = emptyPixels();
    std::fill_n(blended.end, kTilePixelCount - 1, kNeverEnded);
    kernel.blend(splats.data(), splats.size(), {true, false}, blended);
    BackwardPixels before{};
    for (size_t i = 0; i < kTilePixelCount; ++i) {
      before.transmittance[i] = blended.transmittance[i];
      before.end[i] = blended.end[i];
      int32_t& row_end = before.row_end[i / kTileSide];
      row_end = std::max(row_end, before.end[i]);
      for (size_t c = 0; c < 4; ++c)
        before.gradient[c][i] = std::sin(static_cast<float>(i * 4 + c));
    }
    const auto takeOff = [&](TileCulling culling, BackwardPixels& pixels) {
      std::vector<float> sums(splats.size() * backwardFieldCount(wants));
      kernel.take_off(splats.data(), splats.size(), {wants, 0, neverShows, nullptr, culling},
                      pixels, sums.data());
      return sums;
    };
    BackwardPixels culled_pixels = before;
    const std::vector<float> culled = takeOff(TileCulling::kAll, culled_pixels);
    EXPECT_GT(std::count_if(culled.begin(), culled.end(), [](float sum) { return sum != 0; }), 500);
    for (const TileCulling culling : kLesserCullings) {
      BackwardPixels pixels = before;
      EXPECT_EQ(takeOff(culling, pixels), culled);
      EXPECT_EQ(std::memcmp(&pixels, &culled_pixels, sizeof pixels), 0);
    }
  }
}

TEST(TileSplats, HaveTheSameBitsOnEveryTarget) {
  Rng uniform{std::mt19937(5)};
  // Ordinary ones, needles thinner than float32 can hold, and some that lie outside the tile.
  std::vector<VisibleSplat> splats(kTileSplatBatch);
  std::vector<uint32_t> list;
  for (VisibleSplat& s : splats) {
    const float sharp = list.size() % 7 == 0 ? 1e4f : 1.0f;
    s.mean_x = static_cast<double>(uniform(1950, 2000));
    s.mean_y = static_cast<double>(uniform(950, 1000));
    s.l00 = static_cast<double>(sharp * uniform(0.05f, 1.5f));
    s.l10 = static_cast<double>(uniform(-1, 1));
    s.l11 = static_cast<double>(uniform(0.05f, 1.5f));
    s.half_y = uniform(0.5f, 30);
    s.log2_opacity = uniform(-7, 0);
    s.depth = uniform(1, 9);
    for (float& c : s.colour) c = uniform(0, 1);
    list.push_back(static_cast<uint32_t>(list.size()));
  }
  std::reverse(list.begin(), list.end());
  Tile tile{1968, 976, kTileSide, kTileSide, list};
  // No count is a multiple of every number of lanes.
  for (const size_t count : {size_t{1}, size_t{3}, size_t{61}, size_t{127}, kTileSplatBatch}) {
    std::vector<TileSplat> expected(count);
    const size_t begin = kTileSplatBatch - count;
    const float largest = makeTileSplatsScalar(splats.data(), tile, begin, count, expected.data());
    EXPECT_GT(largest, 0.0f);
    for (const NamedTileSplatMaker& named : tileSplatMakers()) {
      SCOPED_TRACE(::testing::Message() << named.target << " count " << count);
      std::vector<TileSplat> seen(count);
      EXPECT_EQ(named.make(splats.data(), tile, begin, count, seen.data()), largest);
      for (size_t i = 0; i < count; ++i) {
        expected[i].finish_doubt = seen[i].finish_doubt = 0;
        EXPECT_EQ(std::memcmp(&seen[i], &expected[i], offsetof(TileSplat, row_end) + 4), 0) << i;
        TileSplat alone = makeTileSplat(splats[list[begin + i]], tile);
        alone.finish_doubt = 0;
        EXPECT_EQ(std::memcmp(&seen[i], &alone, offsetof(TileSplat, row_end) + 4), 0) << i;
        // The rows are those that hold a pixel centre within half_y of the splat's.
        const VisibleSplat& splat = splats[list[begin + i]];
        for (uint32_t y = 0; y < kTileSide; ++y) {
          const double dy = std::abs(tile.y0 + y + 0.5 - splat.mean_y);
          EXPECT_EQ(y >= seen[i].row_begin && y < seen[i].row_end,
                    dy <= static_cast<double>(splat.half_y))
              << i;
        }
      }
    }
  }
}

TEST(TileKernel, FollowsTheEnvironmentVariable) {
  // In a process of its own each time: the choice is made once.
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  for (const NamedTileKernel& named : tileKernels()) {
    EXPECT_EXIT(
        {
          setenv("STIPPLE_FORCE_TARGET", named.target, 1);
          std::exit(chosenTileKernel() == named.kernel ? 7 : 1);
        },
        ::testing::ExitedWithCode(7), "")
        << named.target;
  }
  EXPECT_EXIT(
      {
        setenv("STIPPLE_FORCE_TARGET", "abacus", 1);
        try {
          chosenTileKernel();
        } catch (const Error& error) {
          std::fputs(error.what(), stderr);
          std::exit(7);
        }
      },
      ::testing::ExitedWithCode(7), "abacus.*scalar");
}

TEST(TileKernel, MarksPixelsWhereRoundingCouldDecide) {
  // Exponent at column 0: exactly the threshold; at column 1: far from it.
  TileSplat splat{};
  splat.log2_opacity = 0;
  splat.g0 = std::sqrt(-kLog2MinAlpha);
  splat.l00 = -0.5f;
  splat.doubt_low = splat.doubt_high = 1e-5f;
  splat.row_end = 1;
  for (const NamedTileKernel& named : tileKernels()) {
    SCOPED_TRACE(named.target);
    TilePixels pixels = emptyPixels();
    named.kernel(&splat, 1, {true, true}, pixels);
    EXPECT_EQ(pixels.doubt[0], 1.0f);
    EXPECT_EQ(pixels.cut[0], kFinished);
    EXPECT_EQ(pixels.doubt[1], 0.0f);
    EXPECT_EQ(pixels.count[1], 1.0f);
    EXPECT_EQ(pixels.unfinished, kTilePixelCount - 2);
  }
}

}  // namespace
}  // namespace stipple
