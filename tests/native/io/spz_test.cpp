#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "byte_text.h"
#include "data/clouds/cloud_comparison.h"
#include "io/splats/splat_file.h"
#include "random_cloud.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

/// A file of two splats, array by array, put together from the description of the format.
struct RawSpz {
  uint32_t version = 3;
  uint64_t count = 2;
  unsigned degree = 1, fractional_bits = 4, flags = 0;
  std::string positions =
      ByteText().u24(16).u24(0xfffff0).u24(1).u24(32).u24(0).u24(0x7fffff).bytes;
  std::string alphas = ByteText().u8(0).u8(255).bytes;
  std::string colours = ByteText().u8(0).u8(255).u8(51).u8(128).u8(102).u8(204).bytes;
  std::string scales = ByteText().u8(160).u8(0).u8(255).u8(144).u8(176).u8(161).bytes;
  // Largest is w (3), the others 0; largest is x (0), then y = -half, z = 0, w = 256 steps.
  std::string rotations = ByteText().u32(3u << 30).u32(0u << 30 | (512u | 361u) << 20 | 256u).bytes;
  std::string harmonics;
  std::string extensions;

  RawSpz() {
    for (unsigned i = 0; i < 18; ++i) harmonics.push_back(static_cast<char>(120 + i));
  }
  ByteText start() const {
    return ByteText().text("NGSP").u32(version).u32(count).u8(degree).u8(fractional_bits).u8(flags);
  }
  std::string plain() const {
    return start()
        .u8(0)
        .text(positions + alphas + colours + scales + rotations + harmonics + extensions)
        .bytes;
  }
  std::string streams() const {
    std::vector<std::string> parts = {positions, alphas, colours, scales, rotations};
    if (!harmonics.empty()) parts.push_back(harmonics);
    ByteText file = start();
    file.u8(static_cast<unsigned>(parts.size()))
        .u32(32 + extensions.size())
        .zeros(12)
        .text(extensions);
    for (const std::string& part : parts) file.u64(storedZstd(part).size()).u64(part.size());
    for (const std::string& part : parts) file.text(storedZstd(part));
    return file.bytes;
  }
};

class Spz : public ScratchFolder {
 protected:
  SplatCloud readBytes(const std::string& bytes) { return readSplatFile(store("a.spz", bytes)); }
  void expectRefused(const std::string& bytes, std::initializer_list<const char*> texts) {
    store("bad.spz", bytes);
    expectError(ErrorCode::kFormat, {"bad.spz"}, [&] { readSplatFile(path("bad.spz")); });
    expectError(ErrorCode::kFormat, texts, [&] { readSplatFile(path("bad.spz")); });
  }
};

void expectTwoSplats(const SplatCloud& cloud) {
  ASSERT_EQ(cloud.size(), 2u);
  ASSERT_EQ(cloud.sh_degree, 1);
  EXPECT_EQ(cloud.frame, Frame::kRUB);
  EXPECT_EQ(cloud.colour_space, ColourSpace::kDisplay);
  EXPECT_EQ(cloud.positions, (std::vector<float>{1, -1, 0.0625f, 2, 0, 8388607.0f / 16}));
  EXPECT_EQ(cloud.opacities, (std::vector<float>{0, 1}));
  const std::array<double, 6> bytes = {160, 0, 255, 144, 176, 161};
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_FLOAT_EQ(cloud.scales[i], float(std::exp(bytes[i] / 16.0 - 10.0)));
  }
  const std::array<double, 6> colours = {0, 255, 51, 128, 102, 204};
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_FLOAT_EQ(cloud.sh[i / 3 * 12 + i % 3], float((colours[i] / 255.0 - 0.5) / 0.15));
  }
  for (size_t i = 0; i < 2; ++i) {
    for (size_t k = 0; k < 9; ++k) {
      EXPECT_EQ(cloud.sh[i * 12 + 3 + k], (120.0f + float(i * 9 + k) - 128.0f) / 128.0f);
    }
  }
}

void expectPackedRotations(const SplatCloud& cloud) {
  const double y = -361.0 / 511.0 * std::sqrt(0.5);
  const double w = 256.0 / 511.0 * std::sqrt(0.5);
  EXPECT_EQ(std::vector<float>(cloud.rotations.begin(), cloud.rotations.begin() + 4),
            (std::vector<float>{1, 0, 0, 0}));
  EXPECT_FLOAT_EQ(cloud.rotations[4], float(w));
  EXPECT_FLOAT_EQ(cloud.rotations[5], float(std::sqrt(1 - y * y - w * w)));
  EXPECT_FLOAT_EQ(cloud.rotations[6], float(y));
  EXPECT_EQ(cloud.rotations[7], 0.0f);
}

TEST_F(Spz, ReadsEveryVersionByItsOwnQuantities) {
  RawSpz raw;
  expectTwoSplats(readBytes(storedGzip(raw.plain())));
  expectPackedRotations(readBytes(storedGzip(raw.plain())));
  expectTwoSplats(readBytes(raw.plain()));

  RawSpz fourth;
  fourth.version = 4;
  expectTwoSplats(readBytes(fourth.streams()));
  expectPackedRotations(readBytes(fourth.streams()));

  RawSpz second;
  second.version = 2;
  second.rotations = ByteText().u8(255).u8(255).u8(0).u8(153).u8(102).u8(204).bytes;
  const SplatCloud old = readBytes(storedGzip(second.plain()));
  expectTwoSplats(old);
  // (1, 1, -1) is too long for a unit quaternion: w is 0 and the rest is shortened.
  EXPECT_EQ(old.rotations[0], 0.0f);
  EXPECT_FLOAT_EQ(old.rotations[1], float(1 / std::sqrt(3.0)));
  EXPECT_FLOAT_EQ(old.rotations[3], float(-1 / std::sqrt(3.0)));
  EXPECT_FLOAT_EQ(old.rotations[5], 0.2f);
  EXPECT_FLOAT_EQ(old.rotations[6], -0.2f);
  EXPECT_FLOAT_EQ(old.rotations[7], 0.6f);
  EXPECT_FLOAT_EQ(old.rotations[4], float(std::sqrt(1 - 0.04 - 0.04 - 0.36)));

  RawSpz first = second;
  first.version = 1;
  // Halves: 1, -2, 0.5, 65504, 2^-24, 0.
  first.positions = ByteText().u16(0x3c00).u16(0xc000).u16(0x3800).u16(0x7bff).u16(1).u16(0).bytes;
  EXPECT_EQ(readBytes(storedGzip(first.plain())).positions,
            (std::vector<float>{1, -2, 0.5f, 65504, 0x1p-24f, 0}));
  first.positions[7] = 0x7c;
  expectRefused(storedGzip(first.plain()), {"position of splat 1", "finite"});
}

TEST_F(Spz, TellsTheFilterAndTheFrame) {
  RawSpz raw;
  EXPECT_EQ(readBytes(raw.plain()).antialias, Antialias::kClassic);
  raw.flags = 1;
  EXPECT_EQ(readBytes(raw.plain()).antialias, Antialias::kMip);
  raw.flags = 2;
  // An orbit limit that is passed over, then the coordinate system RDF.
  raw.extensions = ByteText().u32(0xadbe0002).u32(12).zeros(12).u32(0xadbe0003).u32(4).u32(6).bytes;
  EXPECT_EQ(readBytes(storedGzip(raw.plain())).frame, Frame::kRDF);
  raw.version = 4;
  EXPECT_EQ(readBytes(raw.streams()).frame, Frame::kRDF);
  raw.extensions = ByteText().u32(0xadbe0003).u32(4).u32(17).bytes;
  expectRefused(raw.streams(), {"byte 32", "1 to 16"});
  raw.extensions = ByteText().u32(0xadbe0003).u32(1u << 31).u32(6).bytes;
  expectRefused(raw.streams(), {"byte 32", "2147483648", "4 are left"});
}

TEST_F(Spz, RefusesCountsThatLie) {
  for (const uint64_t count : {uint64_t{3}, uint64_t{100000}, uint64_t{0xffffffff}}) {
    RawSpz raw;
    raw.count = count;
    expectRefused(storedGzip(raw.plain()), {std::to_string(count).c_str()});
    expectRefused(raw.plain(), {std::to_string(count).c_str()});
    raw.version = 4;
    expectRefused(raw.streams(), {std::to_string(count).c_str()});
  }
  RawSpz raw;
  raw.degree = 5;
  expectRefused(raw.plain(), {"degree 5", "byte 12"});
  raw.degree = 1;
  raw.fractional_bits = 31;
  expectRefused(raw.plain(), {"31", "byte 13"});
  raw.fractional_bits = 4;
  raw.version = 4;
  std::string bytes = raw.streams();
  bytes[16] = 0;  // the table inside the header
  expectRefused(bytes, {"bytes 0 to 96", "32 to"});
  bytes = raw.streams();
  bytes[15] = 0;
  expectRefused(bytes, {"0 streams", "byte 15"});
  bytes = raw.streams();
  bytes[32 + 6] = 1;  // first packed size: 2^48
  expectRefused(bytes, {"truncated", "stream 0"});
  bytes = raw.streams();
  bytes[32 + 8] = 19;  // first unpacked size
  expectRefused(bytes, {"stream 0", "19", "18"});
  raw.version = 9;
  store("new.spz", raw.plain());
  expectError(ErrorCode::kUnsupported, {"new.spz", "version 9", "1 to 4"},
              [&] { readSplatFile(path("new.spz")); });
  expectRefused("NGSP", {"4 bytes"});
  expectRefused("not a splat file", {"NGSP", "byte 0"});
}

TEST_F(Spz, GivesBackWhatTheStepsOfTheFormatAllow) {
  for (const int version : {3, 4}) {
    for (int degree = 0; degree <= 4; ++degree) {
      SCOPED_TRACE(std::to_string(version) + " degree " + std::to_string(degree));
      SplatCloud cloud = randomCloud(3000, degree, 11);
      cloud.frame = Frame::kRUB;
      cloud.antialias = Antialias::kMip;
      // Inside the range that the format has: -1 to 1, e^-10 to e^5.9.
      for (float& value : cloud.sh) value = std::clamp(value * 0.25f, -1.0f, 1.0f);
      for (float& value : cloud.scales) value = std::max(value, 1e-4f);
      writeSplatFile(cloud, path("trip.spz"), {.version = version});
      const SplatCloud back = readSplatFile(path("trip.spz"));
      EXPECT_EQ(back.frame, Frame::kRUB);
      EXPECT_EQ(back.antialias, Antialias::kMip);
      const CloudComparison lost = compare(cloud, back);
      ASSERT_TRUE(lost.same_order);
      // Half a step, and 1e-6 for the float32 of the result.
      EXPECT_LE(lost.position.max, 0.5 / 4096 + 1e-6);
      EXPECT_LE(lost.opacity.max, 0.5 / 255 + 1e-6);
      EXPECT_LE(lost.scale_ratio.max, 0.5 / 16 + 1e-6);
      // Three components off by half a step h each; the largest, which restores the length, by at
      // most 3 h (all four equal). An angle is twice the quaternion's error, sqrt(12) h.
      EXPECT_LE(lost.rotation.max, 2 * std::sqrt(12.0) * (0.5 * std::sqrt(0.5) / 511) + 1e-5);
      for (size_t i = 0; i < cloud.size(); ++i) {
        for (size_t k = 0; k < cloud.shStride(); ++k) {
          const double step = k < 3 ? 1 / (0.15 * 255) : k < 12 ? 8.0 / 128 : 16.0 / 128;
          const double value = double(cloud.sh[i * cloud.shStride() + k]);
          // The last byte is 255, not 256: one number less at the upper end.
          const double end = k < 3 ? 0 : std::max(0.0, value - 127.0 / 128);
          EXPECT_NEAR(double(back.sh[i * cloud.shStride() + k]), value - end, step / 2 + 1e-6);
        }
      }
    }
  }
}

TEST_F(Spz, HoldsScenesThatPackVeryWell) {
  // 60 splats again and again: a thousandth of their bytes, yet no bomb.
  const SplatCloud few = randomCloud(60, 3, 16);
  SplatCloud many = few;
  many.resize(60000);
  for (size_t i = 60; i < many.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) many.positions[i * 3 + k] = few.positions[i % 60 * 3 + k];
    for (size_t k = 0; k < 3; ++k) many.scales[i * 3 + k] = few.scales[i % 60 * 3 + k];
    for (size_t k = 0; k < 4; ++k) many.rotations[i * 4 + k] = few.rotations[i % 60 * 4 + k];
    for (size_t k = 0; k < 48; ++k) many.sh[i * 48 + k] = few.sh[i % 60 * 48 + k];
    many.opacities[i] = few.opacities[i % 60];
  }
  for (const int version : {3, 4}) {
    writeSplatFile(many, path("a.spz"), {.version = version});
    EXPECT_LT(load(path("a.spz")).size(), 60000u);
    EXPECT_EQ(readSplatFile(path("a.spz")).size(), 60000u);
  }
}

TEST_F(Spz, WritesOnceMoreWhatItHasRead) {
  SplatCloud cloud = randomCloud(500, 3, 12);
  writeSplatFile(cloud, path("a.spz"), {});
  writeSplatFile(readSplatFile(path("a.spz")), path("b.spz"), {});
  const CloudComparison lost = compare(readSplatFile(path("a.spz")), readSplatFile(path("b.spz")));
  EXPECT_EQ(lost.position.max, 0);
  EXPECT_EQ(lost.opacity.max, 0);
  EXPECT_EQ(lost.scale_ratio.max, 0);
  EXPECT_EQ(lost.sh.max, 0);
}

TEST_F(Spz, TurnsEveryFrameToItsOwnUnlessItIsToldAnother) {
  SplatCloud cloud = randomCloud(10, 0, 13);
  const auto first = [&](const SplatWriteOptions& options) {
    writeSplatFile(cloud, path("a.spz"), options);
    return readSplatFile(path("a.spz"));
  };
  // Half a step of the fixed-point numbers.
  const double near = 0.5 / 4096 + 1e-6;
  for (const Frame frame : {Frame::kUnknown, Frame::kRDF}) {
    cloud.frame = frame;
    const SplatCloud back = first({});
    EXPECT_EQ(back.frame, Frame::kRUB);
    EXPECT_NEAR(double(back.positions[1]), -double(cloud.positions[1]), near);
  }
  cloud.frame = Frame::kRDF;
  const SplatCloud kept = first({.frame = Frame::kRDF});
  EXPECT_EQ(kept.frame, Frame::kRDF);
  EXPECT_NEAR(double(kept.positions[1]), double(cloud.positions[1]), near);
  EXPECT_EQ(first({.frame = Frame::kRFU}).frame, Frame::kRFU);
  expectError(ErrorCode::kUnsupported, {"RDF", "version 4"},
              [&] { first({.version = 3, .frame = Frame::kRDF}); });
  expectError(ErrorCode::kUnsupported, {"version 2", "3 and 4"}, [&] { first({.version = 2}); });
}

TEST_F(Spz, HoldsEmptyAndHugeScenes) {
  for (const int version : {3, 4}) {
    writeSplatFile(SplatCloud(), path("a.spz"), {.version = version});
    EXPECT_EQ(readSplatFile(path("a.spz")).size(), 0u);
  }
  SplatCloud cloud = randomCloud(4, 0, 14);
  cloud.frame = Frame::kRUB;
  cloud.positions[0] = 8388607.0f;
  writeSplatFile(cloud, path("a.spz"), {});
  EXPECT_EQ(readSplatFile(path("a.spz")).positions[0], 8388607.0f);
  cloud.positions[0] = 8388608.0f;
  expectError(ErrorCode::kUnsupported, {"8388607"},
              [&] { writeSplatFile(cloud, path("a.spz"), {}); });
  for (float& value : cloud.positions) value *= 1e-12f;
  writeSplatFile(cloud, path("a.spz"), {});
  EXPECT_LE(compare(cloud, readSplatFile(path("a.spz"))).position.max, 0x1p-30);
  for (float& value : cloud.positions) value = 0;
  for (float& value : cloud.scales) value = 0;
  for (float& value : cloud.sh) value = 1e30f;
  writeSplatFile(cloud, path("a.spz"), {});
  const SplatCloud ends = readSplatFile(path("a.spz"));
  EXPECT_EQ(ends.scales[0], float(std::exp(-10.0)));
  EXPECT_FLOAT_EQ(ends.sh[0], float(0.5 / 0.15));
}

TEST_F(Spz, ConvertsLinearColoursToTheDisplaySpaceThatItHolds) {
  SplatCloud cloud = randomCloud(1, 0, 15);
  cloud.colour_space = ColourSpace::kLinear;
  // 0.5 grey in scene linear is 0.7354 on a display.
  for (float& value : cloud.sh) value = 0;
  writeSplatFile(cloud, path("a.spz"), {});
  const SplatCloud back = readSplatFile(path("a.spz"));
  EXPECT_EQ(back.colour_space, ColourSpace::kDisplay);
  // Half a step of the colour bytes, times Y_0^0.
  EXPECT_NEAR(double(kShC0 * back.sh[0]) + 0.5, 0.735357, 0.5 / (0.15 * 255) * 0.2821 + 1e-5);
}

}  // namespace
}  // namespace stipple
