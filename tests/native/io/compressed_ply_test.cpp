#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "byte_text.h"
#include "io/splats/ply/ply_compressed.h"
#include "io/splats/splat_file.h"
#include "random_cloud.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

/// Two splats in one chunk, put together from the description of the format.
struct RawChunks {
  std::vector<float> range = {0, -1, 2, 2047, 1, 2, -3, 0, 1, -1, 0, 3, 0, 0.25f, 0, 1, 0.75f, 0};
  bool colours = true;
  uint64_t chunks = 1, count = 2, harmonics = 0;
  unsigned harmonic_numbers = 9;
  std::string comments;

  std::string bytes() const {
    ByteText file;
    file.text("ply\nformat binary_little_endian 1.0\n" + comments);
    file.text("element chunk " + std::to_string(chunks) + "\n");
    const char* names[] = {
        "min_x",       "min_y",       "min_z",       "max_x",       "max_y",       "max_z",
        "min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z",
        "min_r",       "min_g",       "min_b",       "max_r",       "max_g",       "max_b"};
    const size_t numbers = colours ? 18 : 12;
    for (size_t k = 0; k < numbers; ++k)
      file.text(std::string("property float ") + names[k] + "\n");
    file.text("element vertex " + std::to_string(count) + "\n");
    for (const char* name : {"position", "rotation", "scale", "color"}) {
      file.text(std::string("property uint packed_") + name + "\n");
    }
    if (harmonics > 0) file.text("element sh " + std::to_string(harmonics) + "\n");
    for (unsigned k = 0; harmonics > 0 && k < harmonic_numbers; ++k) {
      file.text("property uchar f_rest_" + std::to_string(k) + "\n");
    }
    file.text("end_header\n");
    for (size_t k = 0; k < numbers; ++k) file.f32(range[k]);
    // x 100 of 2047, y 1023 of 1023, z 0; rotation: w is largest, x and z are 0 (as near as 1023
    // steps come), y at its end; scales 0, 511 of 1023, 2047; colour and opacity.
    file.u32(100u << 21 | 1023u << 11).u32(0u << 30 | 512u << 20 | 1023u << 10 | 511u);
    file.u32(0u << 21 | 511u << 11 | 2047u).u32(51u << 24 | 255u << 16 | 7u << 8 | 102u);
    file.u32(2047u << 21 | 2047u).u32(3u << 30 | 511u << 20 | 511u << 10 | 511u).u32(0).u32(255);
    for (uint64_t i = 0; i < harmonics; ++i) {
      for (unsigned k = 0; k < harmonic_numbers; ++k) {
        file.u8(k == 0 ? 0 : k == 1 ? 255 : 128 + k + static_cast<unsigned>(i) * 10);
      }
    }
    return file.bytes;
  }
};

class CompressedPly : public ScratchFolder {
 protected:
  SplatCloud read(const RawChunks& raw) {
    return readSplatFile(store("a.compressed.ply", raw.bytes()));
  }
  void expectRefused(const RawChunks& raw, std::initializer_list<const char*> texts) {
    expectError(ErrorCode::kFormat, {"a.compressed.ply"}, [&] { read(raw); });
    expectError(ErrorCode::kFormat, texts, [&] { read(raw); });
  }
};

TEST_F(CompressedPly, ReadsPackedNumbersBetweenTheRangesOfTheirChunk) {
  RawChunks raw;
  raw.harmonics = 2;
  const SplatCloud cloud = read(raw);
  ASSERT_EQ(cloud.size(), 2u);
  ASSERT_EQ(cloud.sh_degree, 1);
  EXPECT_EQ(cloud.frame, Frame::kUnknown);
  EXPECT_EQ(cloud.positions, (std::vector<float>{100, 1, 2, 2047, -1, 2}));
  EXPECT_FLOAT_EQ(cloud.scales[0], float(std::exp(-3.0)));
  EXPECT_EQ(cloud.scales[1], 1.0f);
  EXPECT_FLOAT_EQ(cloud.scales[2], float(std::exp(3.0)));
  EXPECT_FLOAT_EQ(cloud.sh[0], (0.2f - 0.5f) / kShC0);
  EXPECT_FLOAT_EQ(cloud.sh[1], 0.25f / kShC0);
  EXPECT_FLOAT_EQ(cloud.sh[2], -0.5f / kShC0);
  EXPECT_EQ(cloud.opacities, (std::vector<float>{0.4f, 1}));
  const double x = (512 / 1023.0 - 0.5) * std::sqrt(2.0);
  const double y = std::sqrt(0.5);
  EXPECT_FLOAT_EQ(cloud.rotations[1], float(x));
  EXPECT_FLOAT_EQ(cloud.rotations[2], float(y));
  EXPECT_FLOAT_EQ(cloud.rotations[3], float(-x));
  EXPECT_FLOAT_EQ(cloud.rotations[0], float(std::sqrt(1 - 2 * x * x - y * y)));
  EXPECT_NEAR(double(cloud.rotations[7]), 1.0, 1e-5);
  // Red has properties 0 to 2, green 3 to 5: both ends, then the middle of a part.
  EXPECT_EQ(cloud.sh[3], -4.0f);
  EXPECT_EQ(cloud.sh[6], 4.0f);
  EXPECT_EQ(cloud.sh[4], float(((131 + 0.5) / 256 - 0.5) * 8));
  EXPECT_EQ(cloud.sh[12 + 11], float(((146 + 0.5) / 256 - 0.5) * 8));
}

TEST_F(CompressedPly, ReadsOldChunksWithoutRangesOfColour) {
  RawChunks raw;
  raw.colours = false;
  EXPECT_FLOAT_EQ(read(raw).sh[1], 0.5f / kShC0);
  raw.comments = "comment SplatRenderMode: mip\ncomment stipple_frame RFU\n";
  EXPECT_EQ(read(raw).antialias, Antialias::kMip);
  EXPECT_EQ(read(raw).frame, Frame::kRFU);
  // The content tells the format, not the name.
  EXPECT_EQ(readSplatFile(store("plain.ply", raw.bytes())).size(), 2u);
}

TEST_F(CompressedPly, RefusesCountsAndRangesThatLie) {
  RawChunks raw;
  raw.count = uint64_t{1} << 40;
  expectRefused(raw, {"1099511627776"});
  raw = RawChunks();
  raw.chunks = uint64_t{1} << 40;
  expectRefused(raw, {"1099511627776"});
  raw = RawChunks();
  raw.chunks = 0;
  expectRefused(raw, {"2 splats", "1 chunks", "has 0"});
  raw = RawChunks();
  raw.harmonics = 1;
  expectRefused(raw, {"2 splats", "harmonics for 1"});
  raw.harmonics = 2;
  raw.harmonic_numbers = 10;
  expectRefused(raw, {"10", "0, 9, 24 or 45"});
  raw = RawChunks();
  raw.range[4] = std::numeric_limits<float>::infinity();
  expectRefused(raw, {"max_y of chunk 0", "inf"});
  raw = RawChunks();
  raw.range[9] = 89;
  expectRefused(raw, {"max_scale_x of chunk 0", "88.7"});
  raw = RawChunks();
  raw.range[12] = -1e38f;  // -3.5e38 as a harmonic, which no float32 is
  expectRefused(raw, {"min_r of chunk 0", "9.599e37"});
  raw = RawChunks();
  std::string bytes = raw.bytes();
  bytes.replace(bytes.find("packed_scale"), 12, "packed_size_");
  expectError(ErrorCode::kFormat, {"packed_scale"}, [&] { readSplatFile(store("b.ply", bytes)); });
  bytes = raw.bytes();
  bytes.replace(bytes.find("little"), 6, "big");
  expectError(ErrorCode::kUnsupported, {"little"}, [&] { readSplatFile(store("b.ply", bytes)); });
}

TEST_F(CompressedPly, ReadsScalesBetweenEndsOfAnySize) {
  RawChunks raw;
  constexpr float kMost = std::numeric_limits<float>::max();
  // x of the second splat lies at the lowest end, z of the first at the highest.
  raw.range[6] = raw.range[7] = raw.range[8] = -kMost;
  raw.range[9] = raw.range[10] = raw.range[11] = 88.7f;
  const SplatCloud cloud = read(raw);
  // The sum of -3.4e38 and as much more is known to 4e22 only, and must not end beyond the range.
  EXPECT_LE(cloud.scales[2], float(std::exp(double(88.7f))));
  EXPECT_GE(cloud.scales[2], 0.0f);
  EXPECT_EQ(cloud.scales[3], 0.0f);
  // Ends that stand the wrong way round count as they stand.
  raw.range[6] = 2;
  raw.range[9] = -2;
  EXPECT_FLOAT_EQ(read(raw).scales[0], float(std::exp(2.0)));
}

TEST_F(CompressedPly, ReadsEveryStepOfAScaleAsItsExponential) {
  // 2048 splats in chunks of one range: x takes all its steps, y its steps of 1023 twice.
  for (const auto& [low, high] : {std::pair{-9.0f, 3.0f}, std::pair{-299.0f, 80.0f}}) {
    ByteText file;
    file.text("ply\nformat binary_little_endian 1.0\nelement chunk 8\n");
    for (const char* name : kChunkProperties) {
      file.text(std::string("property float ") + name + "\n");
    }
    file.text("element vertex 2048\n");
    for (const char* name : kPackedProperties) {
      file.text(std::string("property uint ") + name + "\n");
    }
    file.text("end_header\n");
    for (size_t i = 0; i < 8 * kPlyChunkNumbers; ++i) {
      const size_t k = i % kPlyChunkNumbers;
      file.f32(k < 6 || k >= 12 ? 0.0f : k < 9 ? low : high);
    }
    for (uint32_t i = 0; i < 2048; ++i) file.u32(0).u32(0).u32(i << 21 | (i / 2) << 11).u32(0);
    const SplatCloud cloud = readSplatFile(store("steps.compressed.ply", file.bytes));
    ASSERT_EQ(cloud.size(), 2048u);
    for (size_t i = 0; i < 2048; ++i) {
      const double extent = double(high) - double(low);
      EXPECT_FLOAT_EQ(cloud.scales[i * 3],
                      float(std::exp(double(low) + extent * double(i) / 2047)));
      EXPECT_FLOAT_EQ(cloud.scales[i * 3 + 1],
                      float(std::exp(double(low) + extent * double(i / 2) / 1023)));
    }
  }
}

/// Which splat of `cloud` each splat of `back` is: writing changes the order.
std::vector<size_t> matched(const SplatCloud& cloud, const SplatCloud& back) {
  std::vector<size_t> order(back.size());
  for (size_t i = 0; i < back.size(); ++i) {
    double best = 1e30;
    for (size_t j = 0; j < cloud.size(); ++j) {
      double distance = 0;
      for (size_t k = 0; k < 3; ++k) {
        const double d = double(back.positions[i * 3 + k]) - double(cloud.positions[j * 3 + k]);
        distance += d * d;
      }
      if (distance < best) order[i] = j;
      best = std::min(best, distance);
    }
  }
  return order;
}

TEST_F(CompressedPly, GivesBackWhatTheStepsOfTheFormatAllow) {
  for (const int degree : {0, 1, 2, 3}) {
    SCOPED_TRACE(degree);
    SplatCloud cloud = randomCloud(1500, degree, 41);
    cloud.colour_space = ColourSpace::kLinear;
    cloud.antialias = Antialias::kMip;
    writeSplatFile(cloud, path("a.compressed.ply"), {});
    const SplatCloud back = readSplatFile(path("a.compressed.ply"));
    EXPECT_EQ(back.colour_space, ColourSpace::kLinear);
    EXPECT_EQ(back.antialias, Antialias::kMip);
    ASSERT_EQ(back.size(), cloud.size());
    ASSERT_EQ(back.sh_degree, degree);
    const std::vector<size_t> order = matched(cloud, back);
    std::vector<size_t> once = order;
    std::sort(once.begin(), once.end());
    for (size_t i = 0; i < once.size(); ++i) ASSERT_EQ(once[i], i);
    const size_t stride = cloud.shStride();
    for (size_t chunk = 0; chunk < back.size(); chunk += 256) {
      const size_t end = std::min(back.size(), chunk + 256);
      // A value of one splat is off by at most half a step of its chunk's range.
      const auto expectSteps = [&](const auto& value_of, size_t stride_of, size_t k, double steps) {
        double low = 1e30, high = -1e30;
        for (size_t i = chunk; i < end; ++i) {
          low = std::min(low, value_of(cloud, order[i] * stride_of + k));
          high = std::max(high, value_of(cloud, order[i] * stride_of + k));
        }
        for (size_t i = chunk; i < end; ++i) {
          // 1e-5: float32 of the range and of the value.
          EXPECT_NEAR(value_of(back, i * stride_of + k), value_of(cloud, order[i] * stride_of + k),
                      (high - low) / steps / 2 + 1e-5);
        }
      };
      const std::array<double, 3> steps = {2047, 1023, 2047};
      for (size_t k = 0; k < 3; ++k) {
        expectSteps([](const SplatCloud& c, size_t at) { return double(c.positions[at]); }, 3, k,
                    steps[k]);
        expectSteps([](const SplatCloud& c, size_t at) { return std::log(double(c.scales[at])); },
                    3, k, steps[k]);
        expectSteps([](const SplatCloud& c, size_t at) { return double(c.sh[at]); }, stride, k,
                    255);
      }
    }
    for (size_t i = 0; i < back.size(); ++i) {
      EXPECT_NEAR(double(back.opacities[i]), double(cloud.opacities[order[i]]), 0.5 / 255 + 1e-6);
      double cosine = 0;
      for (size_t k = 0; k < 4; ++k) {
        cosine += double(back.rotations[i * 4 + k]) * double(cloud.rotations[order[i] * 4 + k]);
      }
      // Steps of sqrt(2)/1023, as for SPZ: an angle of at most 2 sqrt(12) times half a step; 1e-3
      // for the cosine of so small an angle in float32.
      EXPECT_LE(2 * std::acos(std::min(1.0, std::abs(cosine))),
                2 * std::sqrt(12.0) * 0.5 * std::sqrt(2.0) / 1023 + 1e-3);
      for (size_t k = 3; k < stride; ++k) {
        const double value = std::clamp(double(cloud.sh[order[i] * stride + k]), -4.0, 4.0);
        // The last number of each end lies one and a half steps from the one before it.
        EXPECT_NEAR(double(back.sh[i * stride + k]), value,
                    (std::abs(value) > 3.9 ? 0.75 : 0.5) * 8 / 256 + 1e-6);
      }
    }
  }
}

TEST_F(CompressedPly, HoldsExtremeAndEmptyClouds) {
  writeSplatFile(SplatCloud(), path("a.compressed.ply"), {});
  EXPECT_EQ(readSplatFile(path("a.compressed.ply")).size(), 0u);
  SplatCloud cloud = randomCloud(257, 4, 42);
  for (float& value : cloud.scales) value = 0;
  cloud.scales[0] = 1e30f;
  cloud.positions[0] = -3e38f;
  cloud.positions[3] = 3e38f;
  writeSplatFile(cloud, path("a.compressed.ply"), {});
  const SplatCloud back = readSplatFile(path("a.compressed.ply"));
  EXPECT_EQ(back.size(), 257u);
  EXPECT_EQ(back.sh_degree, 3);
  EXPECT_EQ(*std::min_element(back.scales.begin(), back.scales.end()), float(std::exp(-20.0)));
  EXPECT_EQ(*std::max_element(back.scales.begin(), back.scales.end()), float(std::exp(20.0)));
}

}  // namespace
}  // namespace stipple
