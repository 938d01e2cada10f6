#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "io/splats/splat_file.h"
#include "ksplat_builder.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class Ksplat : public ScratchFolder {
 protected:
  SplatCloud read(const RawKsplat& raw) { return readSplatFile(store("a.ksplat", raw.bytes())); }
  void expectRefused(const RawKsplat& raw, std::initializer_list<const char*> texts) {
    expectError(ErrorCode::kFormat, {"a.ksplat"}, [&] { read(raw); });
    expectError(ErrorCode::kFormat, texts, [&] { read(raw); });
  }
};

TEST_F(Ksplat, ReadsEveryLevelAndDegreeByItsQuantities) {
  for (unsigned level = 0; level < 3; ++level) {
    for (unsigned degree = 0; degree < 4; ++degree) {
      SCOPED_TRACE("level " + std::to_string(level) + " degree " + std::to_string(degree));
      RawKsplat raw;
      raw.level = level;
      raw.degree = degree;
      const SplatCloud cloud = read(raw);
      ASSERT_EQ(cloud.size(), 3u);
      ASSERT_EQ(cloud.sh_degree, int(degree));
      EXPECT_EQ(cloud.frame, Frame::kUnknown);
      for (size_t i = 0; i < 3; ++i) {
        const float* p = &cloud.positions[i * 3];
        if (level == 0) {
          EXPECT_EQ(p[0], 1.0f + float(i));
          EXPECT_EQ(p[2], -3.0f);
        } else {
          // A block of 8 is 32767 steps on either side of its centre; the third splat lies in the
          // second bucket.
          EXPECT_FLOAT_EQ(p[0], float(double(i) * 100 * 4 / 32767 + (i == 2 ? 10.0 : 0.0)));
          EXPECT_EQ(p[1], 16.0f);
          EXPECT_EQ(p[2], 34.0f);
        }
        EXPECT_EQ(cloud.scales[i * 3], 0.5f);
        EXPECT_EQ(cloud.scales[i * 3 + 2], 0.125f);
        EXPECT_EQ(std::vector<float>(cloud.rotations.begin() + long(i) * 4,
                                     cloud.rotations.begin() + long(i) * 4 + 4),
                  (std::vector<float>{0, 0.6f, 0, 0.8f}));
        EXPECT_EQ(cloud.opacities[i], 0.4f);
        const float* sh = &cloud.sh[i * cloud.shStride()];
        EXPECT_FLOAT_EQ(sh[1], 0.5f / kShC0);
        // Band by band, channel by channel: number 9 of the file is the first of band 2's red.
        const auto number = [&](unsigned k) {
          if (level == 0) return float(k);
          if (level == 1) return 1.0f + float(k) / 1024;
          return float(-1.5 + k * 5 / 255.0 * 3.0);
        };
        if (degree >= 1) {
          EXPECT_FLOAT_EQ(sh[3 + 1], number(3));
        }
        if (degree >= 1) {
          EXPECT_FLOAT_EQ(sh[3 + 3], number(1));
        }
        if (degree >= 2) {
          EXPECT_FLOAT_EQ(sh[4 * 3], number(9));
        }
        if (degree >= 2) {
          EXPECT_FLOAT_EQ(sh[8 * 3 + 2], number(23));
        }
        if (degree >= 3) {
          EXPECT_FLOAT_EQ(sh[15 * 3 + 1], number(37));
        }
      }
    }
  }
}

TEST_F(Ksplat, TakesTheRangeOfHarmonicsFromTheHeader) {
  RawKsplat raw;
  raw.level = 2;
  raw.degree = 1;
  raw.low = -4;
  raw.high = 2;
  EXPECT_FLOAT_EQ(read(raw).sh[6], float(-4 + 5 / 255.0 * 6));
}

TEST_F(Ksplat, RefusesCountsAndBucketsThatLie) {
  RawKsplat raw;
  raw.count = 0xffffffff;
  expectRefused(raw, {"4294967295", "hold 3"});
  raw = RawKsplat();
  raw.sections = 0xffffffff;
  expectRefused(raw, {"4294967295 sections", "byte 4"});
  raw = RawKsplat();
  raw.level = 3;
  expectRefused(raw, {"compression is 3", "byte 20"});
  raw = RawKsplat();
  raw.degree = 4;
  expectRefused(raw, {"degree is 4", "byte 4136"});
  raw = RawKsplat();
  raw.level = 1;
  raw.length = 0;
  expectRefused(raw, {"2 buckets", "3 splats"});
  raw = RawKsplat();
  raw.level = 1;
  raw.full = 0xffffffff;
  raw.buckets = 1;
  expectRefused(raw, {"1 buckets"});
  RawKsplat whole;
  std::string bytes = whole.bytes();
  bytes[4096 + 7] = 1;  // room for 2^24 splats
  expectError(ErrorCode::kFormat, {"section 0", "byte 4096", "it holds"},
              [&] { readSplatFile(store("a.ksplat", bytes)); });
  bytes = whole.bytes();
  bytes[0] = 1;
  expectError(ErrorCode::kFormat, {"version is 1.1"},
              [&] { readSplatFile(store("a.ksplat", bytes)); });
  bytes = whole.bytes();
  bytes[bytes.size() - 88 + 3] = '\xff';  // not a number in the third of four rows
  bytes[bytes.size() - 88 + 2] = '\xff';
  expectError(ErrorCode::kFormat, {"a.ksplat", "position of splat 2"},
              [&] { readSplatFile(store("a.ksplat", bytes)); });
}

TEST_F(Ksplat, IsNotWritten) {
  expectError(ErrorCode::kUnsupported, {"a.ksplat", ".spz"},
              [&] { writeSplatFile(SplatCloud(), path("a.ksplat"), {}); });
}

}  // namespace
}  // namespace stipple
