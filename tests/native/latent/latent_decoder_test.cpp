#include "decode/latent/latent_decoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/latent/latent_density.h"
#include "latent/tiny_latent.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;

const std::string kFile = STIPPLE_TEST_DATA "/networks/deg_decoder_b.safetensors";

class LatentDecoderTest : public testing::Test {
 protected:
  AnchorSet anchors(uint64_t count) const {
    return sampleAnchors(LatentDensity(networks_.octree, latent_), {.count = count, .seed = 1});
  }
  SplatCloud decode(const AnchorSet& anchors, Progress* progress = nullptr) const {
    DecodeRequest request;
    request.anchors = &anchors;
    request.gaussians_per_anchor = 32;
    request.progress = progress;
    return decoder_.decode(request);
  }

  LatentNetworks networks_ = readLatentNetworks(tinyFile(kFile));
  std::shared_ptr<const Latent> latent_ = tinyLatent(kFile);
  LatentDecoder decoder_{networks_.gaussians, latent_};
};

TEST_F(LatentDecoderTest, MakesThirtyTwoValidSplatsOfEachAnchorNearIt) {
  const AnchorSet drawn = anchors(200);
  const SplatCloud cloud = decode(drawn);
  ASSERT_EQ(cloud.size(), 200u * 32);
  EXPECT_NO_THROW(validate(cloud, "the cloud"));
  EXPECT_EQ(cloud.frame, Frame::kRFU);
  EXPECT_EQ(cloud.antialias, Antialias::kMip);
  EXPECT_EQ(cloud.colour_space, ColourSpace::kDisplay);
  const std::vector<float> features = networks_.gaussians->features(
      {}, networks_.gaussians->keysOf({}, *latent_), 200, drawn.positions.data());
  for (size_t n = 0; n < cloud.size(); ++n) {
    // Raw spreads stand last; the softplus of one and its bias bounds what a Gaussian may move.
    const double raw = static_cast<double>(features[n / 32 * 480 + 448 + n % 32]);
    const double spread = std::log1p(std::exp(raw - 2.970628109));
    for (size_t axis = 0; axis < 3; ++axis) {
      const double anchor = static_cast<double>(drawn.positions[n / 32 * 3 + axis]) - 0.5;
      EXPECT_LE(std::abs(static_cast<double>(cloud.positions[n * 3 + axis]) - anchor),
                0.75 * spread + 1e-6);
    }
  }
}

TEST_F(LatentDecoderTest, GivesTheSameBitsForAnyNumberOfThreads) {
  const AnchorSet drawn = anchors(300);
  SplatCloud one, many;
  withThreads(1, [&] { one = decode(drawn); });
  withThreads(4, [&] { many = decode(drawn); });
  EXPECT_EQ(one.positions, many.positions);
  EXPECT_EQ(one.rotations, many.rotations);
  EXPECT_EQ(one.scales, many.scales);
  EXPECT_EQ(one.opacities, many.opacities);
  EXPECT_EQ(one.sh, many.sh);
}

TEST_F(LatentDecoderTest, GivesEachAnchorItsSplatsInWhateverOrderAnchorsCome) {
  const AnchorSet drawn = anchors(100);
  AnchorSet turned = drawn;
  for (size_t i = 0; i < 100; ++i) {
    std::copy_n(&drawn.positions[(99 - i) * 3], 3, &turned.positions[i * 3]);
  }
  const SplatCloud cloud = decode(drawn), other = decode(turned);
  for (size_t n = 0; n < cloud.size(); ++n) {
    const size_t m = (99 - n / 32) * 32 + n % 32;
    // Sums of attention in another order.
    for (size_t axis = 0; axis < 3; ++axis) {
      ASSERT_NEAR(static_cast<double>(cloud.positions[n * 3 + axis]),
                  static_cast<double>(other.positions[m * 3 + axis]), 1e-5);
    }
    ASSERT_NEAR(static_cast<double>(cloud.opacities[n]), static_cast<double>(other.opacities[m]),
                1e-4);
  }
}

TEST_F(LatentDecoderTest, LetsEveryAnchorSeeTheOthers) {
  const AnchorSet drawn = anchors(100);
  AnchorSet moved = drawn;
  moved.positions[3 * 99] = 0.01f;
  const SplatCloud cloud = decode(drawn), other = decode(moved);
  float largest = 0;
  for (size_t n = 0; n < 32; ++n) {
    largest = std::max(largest, std::abs(cloud.opacities[n] - other.opacities[n]));
  }
  EXPECT_GT(largest, 1e-6f) << "the first anchor must notice that the last one moved";
}

TEST_F(LatentDecoderTest, StopsInTheMiddleWhenCancelled) {
  const AnchorSet drawn = anchors(6000);
  Progress progress;
  // Progress of decoding alone; the network takes seconds for as many anchors.
  std::thread canceller([&] {
    while (progress.fraction() == 0.0) std::this_thread::yield();
    progress.cancel();
  });
  try {
    decode(drawn, &progress);
    ADD_FAILURE() << "it went on";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
  canceller.join();
  EXPECT_LT(progress.fraction(), 1.0);
}

TEST_F(LatentDecoderTest, DecodesTheSameAgainAndAfterACancelThatStoppedTheFirst) {
  const AnchorSet drawn = anchors(20);
  Progress cancelled;
  cancelled.cancel();
  EXPECT_THROW(decode(drawn, &cancelled), Error);
  const SplatCloud first = decode(drawn), second = decode(drawn);
  const LatentDecoder other(networks_.gaussians, latent_);
  DecodeRequest request;
  request.anchors = &drawn;
  request.gaussians_per_anchor = 32;
  const SplatCloud fresh = other.decode(request);
  EXPECT_EQ(first.positions, second.positions);
  EXPECT_EQ(first.sh, second.sh);
  EXPECT_EQ(first.positions, fresh.positions);
  EXPECT_EQ(first.sh, fresh.sh);
}

TEST_F(LatentDecoderTest, RefusesAnotherNumberOfGaussians) {
  const AnchorSet drawn = anchors(10);
  DecodeRequest request;
  request.anchors = &drawn;
  request.gaussians_per_anchor = 8;
  try {
    decoder_.decode(request);
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_THAT(error.what(), HasSubstr("gaussians per anchor is 8; these weights make 32"));
  }
}

}  // namespace
}  // namespace stipple
