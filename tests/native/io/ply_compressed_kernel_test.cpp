// Bits of a compressed PLY to float32, on every instruction set.
#include "io/splats/ply/ply_compressed_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
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

PlyChunkValues randomValues(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0.0f, 1.0f);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  PlyChunkValues values;
  for (size_t i = 0; i < kPlyChunkSplats; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      values.ranged[k][i] = 10.0f * normal(random);
      values.ranged[3 + k][i] = std::pow(10.0f, -12.0f + 22.0f * unit(random));
      values.ranged[6 + k][i] = normal(random);
    }
    values.opacity[i] = unit(random);
    for (auto& part : values.rotation) part[i] = normal(random);
  }
  values.ranged[1].fill(2.5f);  // no extent
  values.ranged[4].fill(0.0f);
  values.opacity[0] = 0.0f;
  values.opacity[1] = 1.0f;
  for (auto& part : values.rotation) part[2] = -0.5f;  // of equals, the first is the largest
  return values;
}

TEST(PlyChunkKernel, PacksTheNearestStepsOnEveryInstructionSet) {
  const auto steps = [](const PlyChunkBits& bits, size_t k, size_t i) {
    constexpr unsigned kShifts[] = {21, 11, 0, 21, 11, 0, 24, 16, 8};
    constexpr uint32_t kLast[] = {2047, 1023, 2047};
    const uint32_t word = bits[k < 3 ? 0 : k < 6 ? 2 : 3][i];
    return word >> kShifts[k] & (k < 6 ? kLast[k % 3] : 255);
  };
  for (unsigned seed = 0; seed < 10; ++seed) {
    const PlyChunkValues values = randomValues(seed);
    PlyChunkRange expected_range;
    PlyChunkBits expected;
    ASSERT_TRUE(plainPlyChunkKernel().encode(values, expected_range, expected));
    for (const PlyChunkKernel& kernel : plyChunkKernels()) {
      SCOPED_TRACE(kernel.target);
      PlyChunkRange range;
      PlyChunkBits bits;
      ASSERT_TRUE(kernel.encode(values, range, bits));
      EXPECT_EQ(bits[1], expected[1]);
      for (size_t k = 0; k < kPlyChunkNumbers; ++k) {
        // Logarithms of two libraries, off by some of the last bits of a double: of 20 at most.
        const float allowed = k >= 6 && k < 12 ? 2e-6f : 0.0f;
        ASSERT_NEAR(range[k], expected_range[k], allowed) << k;
      }
      for (size_t i = 0; i < kPlyChunkSplats; ++i) {
        EXPECT_EQ(bits[3][i] & 255, expected[3][i] & 255);
        for (size_t k = 0; k < 9; ++k) {
          const size_t place = k / 3 * 6 + k % 3;
          const double low = double(range[place]);
          const double extent = double(range[place + 3]) - low;
          const double last = k >= 6 ? 255 : k % 3 == 1 ? 1023 : 2047;
          const double value = double(values.ranged[k][i]);
          const double mapped =
              k < 3   ? value
              : k < 6 ? std::clamp(std::log(std::max(value, 1e-30)), -kPlyLogLimit, kPlyLogLimit)
                      : value * kPlyChunkC0 + 0.5;
          const double place_of = extent > 0 ? (mapped - low) / extent * last : 0.0;
          // Half a step, and as much as ends of the range are rounded by.
          EXPECT_NEAR(steps(bits, k, i), place_of, 0.5 + 1e-4) << k << ", " << i;
        }
      }
    }
  }
}

TEST(PlyChunkKernel, RefusesWhatNoSplatHasWhereverItStands) {
  const float infinity = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const PlyChunkKernel& kernel : plyChunkKernels()) {
    SCOPED_TRACE(kernel.target);
    PlyChunkRange range;
    PlyChunkBits bits;
    const auto refuses = [&](PlyChunkValues values, auto&& damage) {
      damage(values);
      return !kernel.encode(values, range, bits);
    };
    const PlyChunkValues good = randomValues(7);
    EXPECT_FALSE(refuses(good, [](PlyChunkValues&) {}));
    for (const size_t at : {size_t{0}, size_t{101}, kPlyChunkSplats - 1}) {
      for (const float bad : {infinity, -infinity, nan}) {
        for (size_t k = 0; k < 9; ++k) {
          EXPECT_TRUE(refuses(good, [&](PlyChunkValues& v) { v.ranged[k][at] = bad; })) << k;
        }
        EXPECT_TRUE(refuses(good, [&](PlyChunkValues& v) { v.opacity[at] = bad; }));
        EXPECT_TRUE(refuses(good, [&](PlyChunkValues& v) { v.rotation[2][at] = bad; }));
      }
      EXPECT_TRUE(refuses(good, [&](PlyChunkValues& v) { v.ranged[4][at] = -1e-30f; }));
      EXPECT_TRUE(refuses(good, [&](PlyChunkValues& v) { v.opacity[at] = 1.0001f; }));
      EXPECT_TRUE(refuses(good, [&](PlyChunkValues& v) { v.opacity[at] = -1e-30f; }));
      EXPECT_TRUE(refuses(good, [&](PlyChunkValues& v) {
        for (auto& part : v.rotation) part[at] = -0.0f;
      }));
    }
  }
}

TEST(PlyChunkKernel, PacksHarmonicsInTheFilesOrderOnEveryInstructionSet) {
  std::mt19937 random(5);
  std::normal_distribution<float> normal(0.0f, 2.0f);
  for (const size_t numbers : {size_t{9}, size_t{24}, size_t{45}}) {
    constexpr size_t kRows = 50;
    const size_t stride = 3 + numbers;
    // Nothing readable behind the last row.
    std::vector<float> sh(kRows * stride);
    for (float& value : sh) value = normal(random);
    const float ends[] = {-4.0f,  -3.98f, -3.97f, 3.97f,   3.98f,  4.0f,      1e30f,
                          -1e30f, 0.0f,   -0.0f,  -1e-20f, 1e-20f, -0.03125f, 0.03125f};
    for (size_t k = 0; k < std::size(ends); ++k) sh[stride * (k + 1) + 3 + k % numbers] = ends[k];
    PlyHarmonicSources sources{nullptr, kRows, numbers, {}};
    std::vector<const float*> rows;
    for (size_t i = 0; i < kRows; ++i) rows.push_back(&sh[(kRows - 1 - i) * stride]);
    sources.rows = rows.data();
    for (size_t k = 0; k < numbers; ++k) {
      sources.to[k] = static_cast<uint8_t>(k % 3 * (numbers / 3) + k / 3);
    }
    for (const PlyChunkKernel& kernel : plyChunkKernels()) {
      SCOPED_TRACE(kernel.target);
      std::vector<uint8_t> bytes(kRows * numbers + 16);
      ASSERT_TRUE(kernel.encodeHarmonics(sources, bytes.data()));
      for (size_t i = 0; i < kRows; ++i) {
        for (size_t k = 0; k < numbers; ++k) {
          const double value = double(rows[i][3 + k]);
          const uint8_t byte = bytes[i * numbers + sources.to[k]];
          double least = 1e300;
          for (unsigned other = 0; other < 256; ++other) {
            least = std::min(least, std::abs(plyHarmonicOf(static_cast<uint8_t>(other)) - value));
          }
          // Between two that are equally near, either.
          ASSERT_LE(std::abs(plyHarmonicOf(byte) - value), least + 1e-6 * (1 + std::abs(value)))
              << numbers << " numbers, value " << value;
        }
      }
      for (const size_t at : {size_t{0}, size_t{2}, stride - 1}) {
        float& value = sh[17 * stride + at];
        const float before = value;
        value = std::numeric_limits<float>::quiet_NaN();
        EXPECT_FALSE(kernel.encodeHarmonics(sources, bytes.data())) << at;
        value = before;
      }
    }
  }
}

}  // namespace
}  // namespace stipple
