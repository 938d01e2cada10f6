#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "byte_text.h"
#include "data/clouds/cloud_comparison.h"
#include "io/splats/splat_file.h"
#include "random_cloud.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class Splat32 : public ScratchFolder {};

ByteText record(float scale = 3.0f) {
  ByteText bytes;
  bytes.f32(1).f32(-2).f32(0.5f).f32(0.25f).f32(0).f32(scale);
  return bytes.u8(0).u8(255).u8(51).u8(102).u8(128).u8(64).u8(128).u8(192);
}

TEST_F(Splat32, ReadsRecordsByTheirQuantities) {
  const std::string bytes = record().bytes + record(7.0f).bytes;
  const SplatCloud cloud = readSplatFile(store("a.splat", bytes));
  ASSERT_EQ(cloud.size(), 2u);
  EXPECT_EQ(cloud.sh_degree, 0);
  EXPECT_EQ(cloud.frame, Frame::kUnknown);
  EXPECT_EQ(cloud.positions, (std::vector<float>{1, -2, 0.5f, 1, -2, 0.5f}));
  EXPECT_EQ(cloud.scales, (std::vector<float>{0.25f, 0, 3, 0.25f, 0, 7}));
  EXPECT_EQ(cloud.opacities[0], 0.4f);
  // (0, -1/2, 0, 1/2) before it is normalised.
  EXPECT_EQ(cloud.rotations[0], 0.0f);
  EXPECT_FLOAT_EQ(cloud.rotations[1], float(-std::sqrt(0.5)));
  EXPECT_FLOAT_EQ(cloud.rotations[3], float(std::sqrt(0.5)));
  // Display colours 0, 1 and 0.2.
  EXPECT_FLOAT_EQ(cloud.sh[0], -0.5f / kShC0);
  EXPECT_FLOAT_EQ(cloud.sh[1], 0.5f / kShC0);
  EXPECT_FLOAT_EQ(cloud.sh[2], -0.3f / kShC0);
}

TEST_F(Splat32, CountsTheBytesOfRotationsFrom128) {
  // Turns about the axes as other programs write them, q * 128 + 128: 0 is 128, and 1 becomes 255.
  for (size_t axis = 0; axis < 4; ++axis) {
    std::string bytes = record().bytes;
    for (size_t k = 0; k < 4; ++k) bytes[28 + k] = k == axis ? '\xff' : '\x80';
    const SplatCloud cloud = readSplatFile(store("a.splat", bytes));
    for (size_t k = 0; k < 4; ++k) EXPECT_EQ(cloud.rotations[k], k == axis ? 1.0f : 0.0f);
  }
}

TEST_F(Splat32, GivesBackWhatTheStepsOfTheFormatAllow) {
  SplatCloud cloud = randomCloud(5000, 2, 21);
  for (float& value : cloud.sh) value = std::clamp(value, -0.5f / kShC0, 0.5f / kShC0);
  writeSplatFile(cloud, path("a.splat"), {});
  EXPECT_EQ(load(path("a.splat")).size(), 5000u * 32);
  const SplatCloud back = readSplatFile(path("a.splat"));
  SplatCloud base = cloud;
  base.sh_degree = 0;
  base.sh.clear();
  for (size_t i = 0; i < cloud.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) base.sh.push_back(cloud.sh[i * cloud.shStride() + c]);
  }
  const CloudComparison lost = compare(base, back);
  ASSERT_TRUE(lost.same_order);
  EXPECT_EQ(lost.position.max, 0);
  EXPECT_EQ(lost.scale_ratio.max, 0);
  EXPECT_LE(lost.opacity.max, 0.5 / 255 + 1e-6);
  EXPECT_LE(lost.sh.max, 0.5 / 255 / double(kShC0) + 1e-6);
  // Four components off by half of 1/128 each, up to twice that where +1 is cut to 127/128; an
  // angle is twice the error of the quaternion.
  EXPECT_LE(lost.rotation.max, 2 * 2 * (1.0 / 128));
  writeSplatFile(back, path("b.splat"), {});
  EXPECT_LE(compare(back, readSplatFile(path("b.splat"))).sh.max, 1e-6);
}

TEST_F(Splat32, RefusesWhatIsNoRow) {
  expectError(ErrorCode::kFormat, {"a.splat", "33", "32"},
              [&] { readSplatFile(store("a.splat", record().bytes + "x")); });
  expectError(ErrorCode::kFormat, {"a.splat", "0 bytes"},
              [&] { readSplatFile(store("a.splat", "")); });
  expectError(ErrorCode::kFormat, {"b.splat", "scale of splat 1", "-7"},
              [&] { readSplatFile(store("b.splat", record().bytes + record(-7).bytes)); });
  const float nan = std::numeric_limits<float>::quiet_NaN();
  expectError(ErrorCode::kFormat, {"b.splat", "scale of splat 0"},
              [&] { readSplatFile(store("b.splat", record(nan).bytes)); });
  expectError(ErrorCode::kUnsupported, {"0 splats"},
              [&] { writeSplatFile(SplatCloud(), path("c.splat"), {}); });
}

}  // namespace
}  // namespace stipple
