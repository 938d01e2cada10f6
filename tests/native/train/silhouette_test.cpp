#include "train/prior/silhouette.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "base/random.h"

namespace stipple {
namespace {

/// Whether pixels of the blocks from (x0, y0) to before (x1, y1) show something, one by one.
bool anyShown(uint32_t width, uint32_t height, const std::vector<float>& alpha,
              const std::vector<float>& weights, uint32_t block, uint32_t x0, uint32_t y0,
              uint32_t x1, uint32_t y1) {
  for (uint32_t y = y0 * block; y < std::min(y1 * block, height); ++y) {
    for (uint32_t x = x0 * block; x < std::min(x1 * block, width); ++x) {
      const size_t i = size_t{y} * width + x;
      if (alpha[i] > 0.3f || weights[i] == 0) return true;
    }
  }
  return false;
}

TEST(Silhouette, AnswersAsItsPixelsDo) {
  const uint32_t width = 13, height = 9;
  std::vector<float> alpha(width * height, 0.3f), weights(width * height, 1.0f);
  for (uint64_t k = 0; k < 6; ++k) {
    const auto at = static_cast<size_t>(mixBits(k) % alpha.size());
    (k < 4 ? alpha : weights)[at] = k < 4 ? 0.31f : 0.0f;
  }
  for (const uint32_t block : {1u, 2u, 4u, 20u}) {
    const Silhouette silhouette(width, height, alpha, weights, block, 0.3f);
    const uint32_t columns = (width + block - 1) / block, rows = (height + block - 1) / block;
    ASSERT_EQ(silhouette.width(), columns);
    ASSERT_EQ(silhouette.height(), rows);
    for (uint32_t y0 = 0; y0 <= rows; ++y0) {
      for (uint32_t y1 = y0; y1 <= rows; ++y1) {
        for (uint32_t x0 = 0; x0 <= columns; ++x0) {
          for (uint32_t x1 = x0; x1 <= columns; ++x1) {
            EXPECT_EQ(silhouette.shows(x0, y0, x1, y1),
                      anyShown(width, height, alpha, weights, block, x0, y0, x1, y1));
          }
        }
      }
    }
  }
}

TEST(Silhouette, LooksAroundABlockUpToTheEdges) {
  std::vector<float> alpha(5 * 4, 0.0f);
  alpha[3 * 5 + 4] = 1;  // the last one
  const Silhouette silhouette(5, 4, alpha, {}, 1, 0.5f);
  for (uint32_t y = 0; y < 4; ++y) {
    for (uint32_t x = 0; x < 5; ++x) EXPECT_EQ(silhouette.showsAround(x, y), x >= 3 && y >= 2);
  }
}

TEST(Silhouette, APictureOfNothingShowsNothing) {
  const std::vector<float> alpha(6, 0.0f), masked(6, 0.0f);
  EXPECT_FALSE(Silhouette(3, 2, alpha, {}, 1, 0.0f).shows(0, 0, 3, 2));
  EXPECT_TRUE(Silhouette(3, 2, alpha, masked, 1, 0.0f).shows(0, 0, 1, 1)) << "all may be hidden";
}

}  // namespace
}  // namespace stipple
