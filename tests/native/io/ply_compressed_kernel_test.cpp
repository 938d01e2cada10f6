// Bits of a compressed PLY to float32, on every instruction set.
#include "io/ply_compressed_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace stipple {
namespace {

struct Decoded {
  std::vector<float> positions = std::vector<float>(kPlyChunkSplats * 3, -7.0f);
  std::vector<float> rotations = std::vector<float>(kPlyChunkSplats * 4, -7.0f);
  std::vector<float> opacities = std::vector<float>(kPlyChunkSplats, -7.0f);
  std::array<std::array<float, kPlyChunkSplats>, 3> colours{};

  PlyChunkTarget target() {
    return {positions.data(), rotations.data(), opacities.data(), &colours};
  }
};

PlyChunkBits randomBits(unsigned seed) {
  std::mt19937 random(seed);
  PlyChunkBits bits;
  for (auto& words : bits) {
    for (uint32_t& word : words) word = random();
  }
  // The ends of all numbers, and rotations whose three are longer than 1 together.
  for (size_t k = 0; k < bits.size(); ++k) {
    for (uint32_t largest = 0; largest < 4; ++largest) {
      bits[k][largest] = largest << 30;
      bits[k][4 + largest] = largest << 30 | 0x3fffffffu;
    }
  }
  return bits;
}

PlyChunkRange randomRange(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0.0f, 10.0f);
  PlyChunkRange range;
  for (float& value : range) value = normal(random);
  range[4] = range[1];  // no extent
  return range;
}

TEST(PlyChunkKernel, SpreadsBitsBetweenTheEndsOfTheRange) {
  const PlyChunkBits bits = randomBits(1);
  const PlyChunkRange range = randomRange(2);
  Decoded out;
  plyChunkKernel().decode(bits, range, out.target());
  for (size_t i = 0; i < kPlyChunkSplats; ++i) {
    const uint32_t steps[] = {bits[0][i] >> 21, bits[0][i] >> 11 & 1023, bits[0][i] & 2047};
    for (size_t k = 0; k < 3; ++k) {
      const double low = range[k];
      const double share = steps[k] / (k == 1 ? 1023.0 : 2047.0);
      const double expected = low + (double(range[k + 3]) - low) * share;
      // Rounded to float32 once, of numbers up to 40.
      EXPECT_NEAR(out.positions[i * 3 + k], expected, 2e-6) << i;
      const double colour_share = (bits[3][i] >> (24 - 8 * k) & 255) / 255.0;
      const double colour =
          double(range[12 + k]) + (double(range[15 + k]) - double(range[12 + k])) * colour_share;
      EXPECT_NEAR(out.colours[k][i], (colour - 0.5) / kPlyChunkC0, 1e-5) << i;
    }
    EXPECT_EQ(out.opacities[i], float((bits[3][i] & 255) / 255.0));
    double squares = 0;
    for (size_t k = 0; k < 4; ++k) squares += std::pow(double(out.rotations[i * 4 + k]), 2);
    // Four components that are rounded to float32.
    EXPECT_NEAR(squares, 1.0, 1e-6) << i;
    EXPECT_GE(out.rotations[i * 4 + (bits[1][i] >> 30)], 0.0f);
  }
}

TEST(PlyChunkKernel, GivesTheSameOnEveryInstructionSet) {
  ASSERT_GE(plyChunkKernels().size(), 2u);
  for (unsigned seed = 0; seed < 20; ++seed) {
    const PlyChunkBits bits = randomBits(seed);
    const PlyChunkRange range = randomRange(100 + seed);
    Decoded expected;
    plainPlyChunkKernel().decode(bits, range, expected.target());
    for (const PlyChunkKernel& kernel : plyChunkKernels()) {
      Decoded out;
      kernel.decode(bits, range, out.target());
      EXPECT_EQ(out.positions, expected.positions) << kernel.target;
      EXPECT_EQ(out.rotations, expected.rotations) << kernel.target;
      EXPECT_EQ(out.opacities, expected.opacities) << kernel.target;
      EXPECT_EQ(out.colours, expected.colours) << kernel.target;
    }
  }
}

TEST(PlyChunkKernel, PutsHarmonicsInTheCloudsOrderOnEveryInstructionSet) {
  std::mt19937 random(3);
  for (const size_t numbers : {size_t{9}, size_t{24}, size_t{45}}) {
    constexpr size_t kRows = 300;
    std::vector<uint8_t> bytes(kRows * numbers + PlyHarmonicRows::kReadable);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
    for (size_t byte = 0; byte < 256; ++byte) bytes[byte] = static_cast<uint8_t>(byte);
    PlyHarmonicRows rows{bytes.data(), numbers, kRows, {}};
    for (size_t k = 0; k < numbers; ++k) {
      rows.from[k] = static_cast<uint8_t>(k % 3 * (numbers / 3) + k / 3);
    }
    const size_t stride = 3 + numbers;
    for (const PlyChunkKernel& kernel : plyChunkKernels()) {
      // Behind the last row, nothing is written.
      std::vector<float> sh(kRows * stride + 16, -7.0f);
      kernel.decodeHarmonics(rows, sh.data());
      for (size_t i = 0; i < kRows; ++i) {
        for (size_t k = 0; k < numbers; ++k) {
          const uint8_t byte = bytes[i * numbers + rows.from[k]];
          ASSERT_EQ(sh[i * stride + 3 + k], float(plyHarmonicOf(byte)))
              << kernel.target << ", " << numbers << " numbers, row " << i << ", " << k;
        }
      }
      for (size_t k = kRows * stride; k < sh.size(); ++k) ASSERT_EQ(sh[k], -7.0f);
    }
  }
}

}  // namespace
}  // namespace stipple
