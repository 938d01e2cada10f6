#include "fit/image_matching.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "train/trained_ball.h"

namespace stipple {
namespace {

constexpr uint32_t kSide = 48;
constexpr uint64_t kAnchors = 128;

/// A ball of one colour, as prepareImage() leaves it.
PreparedImage discOf(const std::array<uint8_t, 3>& colour) {
  PreparedImage image;
  image.size = kSide;
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      const double off = std::hypot(x + 0.5 - 0.5 * kSide, y + 0.5 - 0.5 * kSide);
      const bool shows = off < 0.35 * kSide;
      for (const uint8_t value : colour) image.rgb.push_back(shows ? value : uint8_t{0});
      image.alpha.push_back(shows ? 255 : 0);
    }
  }
  return image;
}

class ColourMatching : public ::testing::Test {
 protected:
  ColourMatching() : networks_(smallSizes()), values_(speakingValues(networks_)) {
    latent_.token_count = 24;
    latent_.width = 8;
    latent_.tokens = networks_.encode(values_, ball(), latent_.token_count);
  }

  SplatCloud splats(const Latent& latent) const {
    return networks_.decode(values_, latent.tokens, kAnchors, 1000);
  }
  Latent matched(const PreparedImage& image, Progress* progress = nullptr) const {
    Latent latent = latent_;
    matchColours(networks_, values_, kAnchors, *cpuBackends(), image, around(3, 12, kSide / 2),
                 latent, progress);
    return latent;
  }
  /// The mean of one channel of splats.
  static double mean(const SplatCloud& cloud, size_t channel) {
    double sum = 0;
    for (size_t i = 0; i < cloud.size(); ++i) sum += static_cast<double>(cloud.sh[3 * i + channel]);
    return sum / static_cast<double>(cloud.size());
  }

  DensityAutoencoder networks_;
  std::vector<float> values_;
  Latent latent_;
};

TEST_F(ColourMatching, LeadsColoursToThoseOfTheImage) {
  const SplatCloud red = splats(matched(discOf({230, 30, 30})));
  const SplatCloud blue = splats(matched(discOf({30, 30, 230})));
  constexpr double kApart = 0.2;  // Of coefficients, of which 3.5 are from black to white.
  EXPECT_GT(mean(red, 0), mean(blue, 0) + kApart);
  EXPECT_GT(mean(blue, 2), mean(red, 2) + kApart);
}

TEST_F(ColourMatching, StaysNearTheLatentThatItBeginsWith) {
  const Latent latent = matched(discOf({230, 30, 30}));
  double squares = 0;
  for (size_t i = 0; i < latent.tokens.size(); ++i) {
    const double off = static_cast<double>(latent.tokens[i] - latent_.tokens[i]);
    ASSERT_TRUE(std::isfinite(off));
    squares += off * off;
  }
  const double moved = std::sqrt(squares / static_cast<double>(latent.tokens.size()));
  EXPECT_GT(moved, 0.02);
  // 60 steps of at most 0.02 that fall along a cosine.
  EXPECT_LT(moved, 0.7);
}

TEST_F(ColourMatching, HasTheSameBitsForAnyNumberOfThreads) {
  const PreparedImage image = discOf({200, 120, 40});
  const Latent together = matched(image);
  Latent alone;
  withThreads(1, [&] { alone = matched(image); });
  EXPECT_EQ(together.tokens, alone.tokens);
}

TEST_F(ColourMatching, EndsWhenItIsCancelled) {
  Progress progress;
  progress.cancel();
  EXPECT_ANY_THROW(matched(discOf({230, 30, 30}), &progress));
}

TEST_F(ColourMatching, TakesAsMuchAsItSays) {
  // But for the few cells at the root of the density, which are asked about once.
  EXPECT_GT(matchingOperations(networks_, 256), 1.7 * matchingOperations(networks_, 128));
  EXPECT_GT(matchingBytes(networks_, 128, kSide),
            networks_.layout().size() * sizeof(float) + uint64_t{kSide} * kSide * 20);
}

}  // namespace
}  // namespace stipple
