// What numbers come out is compared with other programs' by golden files (tests/network_golden);
// here is what must hold for any weights.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "generate/dino_encoder.h"
#include "generate/image_condition.h"
#include "generate/image_preparation.h"
#include "generate/made_encoders.h"
#include "generate/peak_memory.h"
#include "generate/vae_encoder.h"

namespace stipple {
namespace {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;

const DinoOptions kSmallHeads = {16};

std::vector<float> picture(size_t height, size_t width) {
  std::vector<float> rgb = numbers(height * width * 3, 21);
  for (float& value : rgb) value = 0.5f + 0.5f * value;
  return rgb;
}

std::string messageOf(ErrorCode code, const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  return "";
}

TEST(DinoEncoder, TakesItsSizesFromTheFile) {
  const DinoEncoder encoder(madeDino(32, 48, 3).table(), kSmallHeads);
  EXPECT_EQ(encoder.width(), 32u);
  EXPECT_EQ(encoder.patchSize(), 16u);
  EXPECT_EQ(encoder.prefixRows(), 5u);
  EXPECT_EQ(encoder.rowsFor(48, 32), 5u + 6);
  const std::vector<float> features = encoder.encode({}, picture(48, 32), 48, 32);
  ASSERT_EQ(features.size(), 11u * 32);
  // The last normalisation has no weights: each row has mean 0 and mean square 1.
  for (size_t row = 0; row < 11; ++row) {
    double sum = 0.0, squares = 0.0;
    for (size_t i = 0; i < 32; ++i) {
      const auto value = static_cast<double>(features[row * 32 + i]);
      sum += value;
      squares += value * value;
    }
    EXPECT_NEAR(sum / 32, 0.0, 1e-6);
    EXPECT_NEAR(squares / 32, 1.0, 1e-3);  // epsilon 1e-5 beside variances of about 1
  }
}

TEST(DinoEncoder, GivesTheSameBitsForAnyNumberOfThreads) {
  const DinoEncoder encoder(madeDino(64, 96, 2).table(), kSmallHeads);
  const std::vector<float> rgb = picture(160, 128);
  std::vector<float> one;
  withThreads(1, [&] { one = encoder.encode({}, rgb, 160, 128); });
  withThreads(3, [&] { EXPECT_EQ(encoder.encode({}, rgb, 160, 128), one); });
}

TEST(DinoEncoder, ReadsTheNamesOfNewerExporters) {
  const std::vector<float> rgb = picture(32, 32);
  const DinoEncoder plain(madeDino(32, 48, 2).table(), kSmallHeads);
  const DinoEncoder prefixed(madeDino(32, 48, 2, "model.layer.").table(), kSmallHeads);
  EXPECT_EQ(prefixed.encode({}, rgb, 32, 32), plain.encode({}, rgb, 32, 32));
}

TEST(DinoEncoder, NamesTheTensorThatIsMissing) {
  for (const char* name : {"embeddings.cls_token", "embeddings.register_tokens", "norm.bias",
                           "layer.1.attention.k_proj.weight", "layer.0.mlp.gate_proj.bias"}) {
    const std::string message = messageOf(ErrorCode::kFormat, [&] {
      DinoEncoder(madeDino(32, 48, 2, "layer.", name).table(), kSmallHeads);
    });
    EXPECT_THAT(message, AllOf(HasSubstr("net.safetensors"), HasSubstr(name)));
  }
}

TEST(DinoEncoder, RefusesOtherNetworksAndSizes) {
  EXPECT_NE(messageOf(ErrorCode::kFormat, [] { DinoEncoder(madeVae({32}, 2).table()); }), "");
  // Heads of 64 do not divide tokens of 32 numbers.
  EXPECT_THAT(messageOf(ErrorCode::kFormat, [] { DinoEncoder(madeDino(32, 48, 1).table()); }),
              HasSubstr("tokens have 32 numbers; heads of 64"));
  // No layers at all.
  EXPECT_THAT(messageOf(ErrorCode::kFormat, [] { DinoEncoder(madeDino(64, 48, 0).table()); }),
              HasSubstr("layer.0."));
  const DinoEncoder encoder(madeDino(32, 48, 1).table(), kSmallHeads);
  const auto encode = [&](const std::vector<float>& rgb, size_t height, size_t width) {
    return messageOf(ErrorCode::kInvalidArgument, [&] { encoder.encode({}, rgb, height, width); });
  };
  EXPECT_THAT(encode(picture(16, 24), 16, 24), HasSubstr("24 x 16"));
  EXPECT_THAT(encode({}, 0, 0), HasSubstr("0 x 0"));
  EXPECT_THAT(encode(picture(16, 15), 16, 16), HasSubstr("it needs 768"));
  std::vector<float> bad = picture(16, 16);
  bad[7] = std::numeric_limits<float>::infinity();
  EXPECT_NE(encode(bad, 16, 16), "");
}

TEST(DinoEncoder, RefusesWeightsThatAreNotFinite) {
  MadeWeights made = madeDino(32, 48, 1, "layer.", "layer.0.mlp.up_proj.weight");
  made.leaveOut("");
  std::vector<float> values = numbers(48 * 32, 2);
  values[1000] = std::numeric_limits<float>::quiet_NaN();
  made.add("layer.0.mlp.up_proj.weight", {48, 32}, values);
  const DinoEncoder encoder(made.table(), kSmallHeads);
  EXPECT_THAT(messageOf(ErrorCode::kFormat, [&] { encoder.encode({}, picture(16, 16), 16, 16); }),
              HasSubstr("layer.0.mlp.up_proj.weight"));
}

TEST(VaeEncoder, TakesItsSizesFromTheFile) {
  const VaeEncoder encoder(madeVae({32, 64, 64}, 3).table());
  EXPECT_EQ(encoder.latentChannels(), 3u);
  EXPECT_EQ(encoder.tokenWidth(), 12u);
  EXPECT_EQ(encoder.tokenSize(), 8u);
  EXPECT_EQ(encoder.noiseCount(16, 24), 72u);
  EXPECT_EQ(encoder.encode({}, picture(16, 24), 16, 24, {}).size(), 72u);
}

TEST(VaeEncoder, AddsNoiseByTheLatentsSpread) {
  const VaeEncoder encoder(madeVae({32, 32}, 2).table());
  const std::vector<float> rgb = picture(8, 12);
  std::vector<float> moments;
  const std::vector<float> mean =
      encoder.encode({}, rgb, 8, 12, {}, [&](const std::string& stage, const StageNumbers& at) {
        if (stage == "moments") moments.assign(at.values, at.values + at.rows * at.width);
      });
  std::vector<float> zeros(encoder.noiseCount(8, 12), 0.0f);
  EXPECT_EQ(encoder.encode({}, rgb, 8, 12, zeros), mean);
  // Channel 1, row 2, column 3 of [2, 4, 6]: token (1, 1) of [2, 3], number 4 * 1 + 2 * 0 + 1.
  zeros[24 + 2 * 6 + 3] = 2.0f;
  const std::vector<float> seen = encoder.encode({}, rgb, 8, 12, zeros);
  const size_t at = (1 * 3 + 1) * 8 + 5;
  const double spread = std::exp(0.5 * static_cast<double>(moments[(2 * 6 + 3) * 4 + 2 + 1]));
  // float32 of numbers near 1.
  EXPECT_NEAR(static_cast<double>(seen[at] - mean[at]), 2.0 * spread / std::sqrt(0.8 + 1e-5), 1e-5);
  for (size_t i = 0; i < seen.size(); ++i) {
    if (i != at) {
      ASSERT_EQ(seen[i], mean[i]);
    }
  }
}

TEST(VaeEncoder, GivesTheSameBitsForAnyNumberOfThreads) {
  const VaeEncoder encoder(madeVae({32, 64, 96}, 4).table());
  const std::vector<float> rgb = picture(64, 48);
  const std::vector<float> noise = numbers(encoder.noiseCount(64, 48), 6);
  std::vector<float> one;
  withThreads(1, [&] { one = encoder.encode({}, rgb, 64, 48, noise); });
  withThreads(3, [&] { EXPECT_EQ(encoder.encode({}, rgb, 64, 48, noise), one); });
}

TEST(VaeEncoder, NamesTheTensorThatIsMissing) {
  for (const char* name :
       {"encoder.conv_in.weight", "encoder.down_blocks.1.resnets.0.conv_shortcut.weight",
        "encoder.down_blocks.0.downsamplers.0.conv.bias",
        "encoder.mid_block.attentions.0.to_out.0.weight", "encoder.conv_norm_out.weight",
        "quant_conv.weight", "bn.running_var"}) {
    const std::string message = messageOf(ErrorCode::kFormat, [&] {
      VaeEncoder(madeVae({32, 64}, 2, name).table());
    });
    EXPECT_THAT(message, AllOf(HasSubstr("net.safetensors"), HasSubstr(name)));
  }
}

TEST(VaeEncoder, RefusesOtherNetworksAndSizes) {
  EXPECT_NE(messageOf(ErrorCode::kFormat, [] { VaeEncoder(madeDino(64, 96, 1).table()); }), "");
  MadeWeights negative = madeVae({32}, 2, "bn.running_var");
  negative.leaveOut("");
  negative.add("bn.running_var", {8}, std::vector<float>(8, -1.0f));
  EXPECT_THAT(messageOf(ErrorCode::kFormat, [&] { VaeEncoder(negative.table()); }),
              HasSubstr("bn.running_var has a negative number, -1"));
  // 20 channels make no 32 groups.
  EXPECT_THAT(messageOf(ErrorCode::kFormat, [] { VaeEncoder(madeVae({20}, 2).table()); }),
              HasSubstr("a multiple of 32"));
  const VaeEncoder encoder(madeVae({32, 32}, 2).table());
  const auto encode = [&](size_t height, size_t width, const std::vector<float>& noise) {
    return messageOf(ErrorCode::kInvalidArgument,
                     [&] { encoder.encode({}, picture(height, width), height, width, noise); });
  };
  EXPECT_THAT(encode(8, 10, {}), HasSubstr("10 x 8"));
  EXPECT_THAT(encode(8, 8, {1.0f}), HasSubstr("it needs 32, or 0"));
  EXPECT_NE(encode(8, 8, std::vector<float>(32, std::numeric_limits<float>::quiet_NaN())), "");
}

TEST(VaeEncoder, TakesTwoMapsOfItsFirstLevel) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizer's own memory would be measured";
#endif
  const VaeEncoder encoder(madeVae({128, 128, 128, 128}, 8).table());
  const std::vector<float> rgb = picture(256, 256);
  uint64_t peak = 0;
  withThreads(2, [&] { peak = peakMemoryOf([&] { encoder.encode({}, rgb, 256, 256, {}); }); });
  const uint64_t maps = 2 * 4 * uint64_t{256} * 256 * 128;
  // Weights of a layer packed, 0.6 MiB, and the same again for each thread that packs; 96 rows of
  // 1152 inputs, a tile of 10 x 26 x 128 and its sums, 0.7 MB, for each of two threads; what the
  // store of scratch memory keeps beside them, at most 64 MiB but no more than was in use; the
  // allocator's rounding.
  const uint64_t others = uint64_t{16} << 20;
  EXPECT_GT(peak, maps);  // else this measures nothing
  EXPECT_LT(peak, maps + others);
}

TEST(Encoders, StopWithinASecondWhenCancelled) {
  // Seconds of work each, so that they are cancelled in the middle.
  const DinoEncoder structure(madeDino(512, 2048, 4).table());
  const VaeEncoder colour(madeVae({128, 256}, 8).table());
  const auto secondsToStop = [](const std::function<void(const NetworkRun&)>& encode) {
    using Clock = std::chrono::steady_clock;
    Progress progress;
    NetworkRun run;
    run.progress = &progress;
    Clock::time_point cancelled;
    std::thread user([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(150));
      cancelled = Clock::now();
      progress.cancel();
    });
    const std::string message = messageOf(ErrorCode::kCancelled, [&] { encode(run); });
    const Clock::time_point stopped = Clock::now();
    user.join();
    EXPECT_EQ(message, "cancelled");
    return std::chrono::duration<double>(stopped - cancelled).count();
  };
  const std::vector<float> rgb = picture(512, 512);
  EXPECT_LT(secondsToStop([&](const NetworkRun& run) { structure.encode(run, rgb, 512, 512); }),
            1.0);
  EXPECT_LT(secondsToStop([&](const NetworkRun& run) { colour.encode(run, rgb, 512, 512, {}); }),
            1.0);
}

TEST(ImageCondition, PutsZerosBesideTheTokensOfTheWholeImage) {
  const DinoEncoder structure(madeDino(32, 48, 2).table(), kSmallHeads);
  const VaeEncoder colour(madeVae({32, 32, 32, 32}, 2).table());
  PreparedImage image;
  image.size = 48;
  for (const float value : picture(48, 48)) {
    image.rgb.push_back(static_cast<uint8_t>(255.0f * value));
  }
  std::vector<float> rgb;
  for (const uint8_t value : image.rgb) rgb.push_back(static_cast<float>(value) / 255.0f);
  const std::vector<float> noise = numbers(colour.noiseCount(48, 48), 4);
  Progress progress;
  NetworkRun run;
  run.progress = &progress;
  const ImageCondition condition = encodeImage(run, structure, colour, image, noise);
  EXPECT_EQ(condition.rows, 5u + 9);
  EXPECT_EQ(condition.structure_width, 32u);
  EXPECT_EQ(condition.colour_width, 8u);
  EXPECT_EQ(condition.structure, structure.encode({}, rgb, 48, 48));
  ASSERT_EQ(condition.colour.size(), 14u * 8);
  const auto tokens = condition.colour.begin() + 5 * 8;
  EXPECT_THAT(std::vector<float>(condition.colour.begin(), tokens), Each(0.0f));
  EXPECT_EQ(std::vector<float>(tokens, condition.colour.end()),
            colour.encode({}, rgb, 48, 48, noise));
  EXPECT_EQ(progress.fraction(), 1.0);
}

TEST(ImageCondition, OfFeaturesIsThatOfTheImageForEveryNoise) {
  const DinoEncoder structure(madeDino(32, 48, 1).table(), kSmallHeads);
  const VaeEncoder colour(madeVae({32, 32, 32, 32}, 2).table());
  PreparedImage image;
  image.size = 48;
  for (const float value : picture(48, 48)) {
    image.rgb.push_back(static_cast<uint8_t>(255.0f * value));
  }
  const ImageFeatures features = featuresOf({}, structure, colour, image);
  for (const uint32_t seed : {4, 5}) {
    const std::vector<float> noise = numbers(colour.noiseCount(48, 48), seed);
    const ImageCondition once = conditionOf(structure, colour, features, noise);
    const ImageCondition anew = encodeImage({}, structure, colour, image, noise);
    EXPECT_EQ(once.structure, anew.structure);
    EXPECT_EQ(once.colour, anew.colour);
    EXPECT_EQ(once.rows, anew.rows);
  }
  EXPECT_THAT(
      messageOf(ErrorCode::kInvalidArgument,
                [&] { conditionOf(structure, colour, features, std::vector<float>(7, 0.0f)); }),
      HasSubstr("The noise has 7 numbers"));
  ImageFeatures other = features;
  other.structure.pop_back();
  EXPECT_THAT(
      messageOf(ErrorCode::kInvalidArgument, [&] { conditionOf(structure, colour, other, {}); }),
      HasSubstr("14 rows of 32"));
}

TEST(ImageCondition, TellsProgressAsAPartOfTheWhole) {
  const DinoEncoder structure(madeDino(32, 48, 1).table(), kSmallHeads);
  const VaeEncoder colour(madeVae({32, 32, 32, 32}, 2).table());
  PreparedImage image;
  image.size = 32;
  image.rgb.assign(32 * 32 * 3, 90);
  Progress progress;
  NetworkRun run;
  run.progress = &progress;
  encodeImage(run, structure, colour, image, {}, {0.25, 0.5});
  EXPECT_EQ(progress.fraction(), 0.5);
}

TEST(ImageCondition, RefusesEncodersWhosePatchesDiffer) {
  const DinoEncoder structure(madeDino(32, 48, 1).table(), kSmallHeads);
  const VaeEncoder colour(madeVae({32, 32}, 2).table());
  PreparedImage image;
  image.size = 32;
  image.rgb.assign(32 * 32 * 3, 90);
  EXPECT_THAT(messageOf(ErrorCode::kFormat, [&] { encodeImage({}, structure, colour, image, {}); }),
              HasSubstr("patches of 16 pixels, the other of 4"));
}

}  // namespace
}  // namespace stipple
