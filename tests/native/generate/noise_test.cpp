#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "generate/seeded_noise.h"
#include "io/bytes/safetensors.h"

namespace stipple {
namespace {

/// PyTorch's vectorised logarithm and cosine are approximations of a few ulp of numbers up to 5.8.
constexpr float kTorchTolerance = 2e-6f;

std::vector<float> recorded(const SafeTensorsReader& file, const char* name) {
  return std::get<std::vector<float>>(file.readTensor(name).values);
}

void expectClose(const std::vector<float>& seen, const std::vector<float>& expected) {
  ASSERT_EQ(seen.size(), expected.size());
  for (size_t i = 0; i < seen.size(); ++i) {
    EXPECT_NEAR(seen[i], expected[i], kTorchTolerance) << "number " << i;
  }
}

TEST(SeededNoise, OfTorchIsThatOfARecordedRun) {
  const SafeTensorsReader file(STIPPLE_TEST_DATA "/networks/deg_pipeline_a.safetensors");
  const GenerationNoise noise =
      drawNoise({.colour = 4 * 8 * 8, .tokens = 64 * 16}, {NoiseSource::kTorchCpu, 42});
  expectClose(noise.colour, recorded(file, "input.vae_noise"));
  expectClose(noise.tokens, recorded(file, "input.latent"));
  expectClose(noise.camera, recorded(file, "input.camera"));
}

TEST(SeededNoise, OfTorchHasTheRecordedBeginningsAtFullSize) {
  const GenerationNoise noise =
      drawNoise({.colour = 32 * 128 * 128, .tokens = 8192 * 16}, {NoiseSource::kTorchCpu, 42});
  const auto head = [](const std::vector<float>& values, size_t count) {
    return std::vector<double>(values.begin(), values.begin() + static_cast<ptrdiff_t>(count));
  };
  const auto expectPrinted = [](const std::vector<double>& seen,
                                const std::vector<double>& printed) {
    for (size_t i = 0; i < printed.size(); ++i) EXPECT_NEAR(seen[i], printed[i], 6e-6);  // 5 digits
  };
  expectPrinted(head(noise.colour, 3), {1.92692, 1.48728, 0.90072});
  expectPrinted(head(noise.tokens, 3), {0.05151, 1.45524, -0.59821});
  expectPrinted(head(noise.camera, 5), {0.45246, -0.32960, 0.84881, 0.70575, -1.00273});
}

TEST(SeededNoise, OfTorchDrawsTheEndOfAnUnevenStreamAgain) {
  // 20 numbers: 20 uniform ones, one block of 16, and 16 new ones for the last 16 places.
  const std::vector<float> seen =
      drawNoise({.colour = 20, .tokens = 0, .camera = 0}, {NoiseSource::kTorchCpu, 7}).colour;
  std::mt19937 bits(7);
  std::vector<double> u(36);
  for (double& value : u) value = (bits() & 0xffffffu) / 16777216.0;
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(seen[i], normalOf(u[i], u[i + 8]), kTorchTolerance);
  }
  for (size_t i = 0; i < 8; ++i) {
    EXPECT_NEAR(seen[4 + i], normalOf(u[20 + i], u[28 + i]), kTorchTolerance);
  }
}

TEST(SeededNoise, OfTorchUsesTheLowerHalfOfASeed) {
  const NoiseSizes sizes{.colour = 40, .tokens = 17};
  EXPECT_EQ(drawNoise(sizes, {NoiseSource::kTorchCpu, 42}).tokens,
            drawNoise(sizes, {NoiseSource::kTorchCpu, 42 + (uint64_t{9} << 32)}).tokens);
}

TEST(SeededNoise, IsTheSameForAnyNumberOfThreads) {
  const NoiseSizes sizes{.colour = 30001, .tokens = 20002};
  GenerationNoise one, four;
  withThreads(1, [&] { one = drawNoise(sizes, {}); });
  withThreads(4, [&] { four = drawNoise(sizes, {}); });
  EXPECT_EQ(one.colour, four.colour);
  EXPECT_EQ(one.tokens, four.tokens);
  EXPECT_EQ(one.camera, four.camera);
}

TEST(SeededNoise, OfAShorterStreamIsTheBeginningOfALongerOne) {
  const std::vector<float> few = drawNoise({.tokens = 1024 * 16}, {}).tokens;
  const std::vector<float> many = drawNoise({.colour = 100, .tokens = 4096 * 16}, {}).tokens;
  EXPECT_TRUE(std::equal(few.begin(), few.end(), many.begin()));
}

TEST(SeededNoise, HasThePublishedBitsOnEveryMachine) {
  const GenerationNoise noise = drawNoise({.colour = 2, .tokens = 2, .camera = 2}, {.seed = 42});
  // From a program of its own in Python.
  const auto bits = [](float value) { return std::bit_cast<uint32_t>(value); };
  EXPECT_EQ(bits(noise.colour[0]), 0xbebe2d76u);
  EXPECT_EQ(bits(noise.colour[1]), 0x3c8880c9u);
  EXPECT_EQ(bits(noise.tokens[0]), 0x3f771019u);
  EXPECT_EQ(bits(noise.tokens[1]), 0x3f6d010au);
  EXPECT_EQ(bits(noise.camera[0]), 0xbf1315a2u);
  EXPECT_EQ(bits(noise.camera[1]), 0xbf10e190u);
}

TEST(SeededNoise, IsNormallyDistributedAndItsStreamsAreIndependent) {
  constexpr size_t kCount = 200000;
  const GenerationNoise noise = drawNoise({.colour = kCount, .tokens = kCount}, {.seed = 5});
  double sum = 0, squares = 0, fourth = 0, product = 0, neighbours = 0;
  for (size_t i = 0; i < kCount; ++i) {
    const double x = noise.colour[i];
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
    product += x * static_cast<double>(noise.tokens[i]);
    if (i > 0) neighbours += x * static_cast<double>(noise.colour[i - 1]);
  }
  // Five standard deviations of each mean: 1, sqrt(2), sqrt(96), 1, 1 over sqrt(count).
  const double deviation = 5 / std::sqrt(static_cast<double>(kCount));
  EXPECT_NEAR(sum / kCount, 0, deviation);
  EXPECT_NEAR(squares / kCount, 1, 1.42 * deviation);
  EXPECT_NEAR(fourth / kCount, 3, 9.8 * deviation);
  EXPECT_NEAR(product / kCount, 0, deviation);
  EXPECT_NEAR(neighbours / kCount, 0, deviation);
}

TEST(SeededNoise, PortableNumbersAreThoseOfTheMathematicalLibrary) {
  const double last = 1 - 0x1.0p-53;
  std::vector<double> places = {0,     0x1.0p-53, 0.125, 0.25,      0.5,
                                0.625, 0.75,      0.875, 0.9999999, last};
  for (uint64_t i = 0; i < 2000; ++i) places.push_back(unitDouble(mixBits(i)));
  for (size_t i = 0; i < places.size(); ++i) {
    const double u = places[i];
    const double v = places[(7 * i + 3) % places.size()];
    // 2e-15 of the radius: the rounding of both, and 2.4e-16 of the angle that cos() is given here.
    const double radius = std::sqrt(-2 * std::log1p(-u));
    EXPECT_NEAR(portableNormal(u, v), normalOf(u, v), 2e-15 * radius + 1e-300) << u << " " << v;
  }
}

TEST(SeededNoise, DiffersBySeed) {
  EXPECT_NE(drawNoise({.tokens = 4}, {.seed = 1}).tokens,
            drawNoise({.tokens = 4}, {.seed = 2}).tokens);
}

}  // namespace
}  // namespace stipple
