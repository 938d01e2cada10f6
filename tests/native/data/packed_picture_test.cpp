#include "data/views/packed_picture.h"

#include <gtest/gtest.h>

#include "data/views/memory_view_source.h"

namespace stipple {
namespace {

TEST(PackedNumbers, KeepWhatTheyPromise) {
  std::vector<float> bytes, shares, others, seen;
  for (int i = 0; i < 256; ++i) bytes.push_back(static_cast<float>(i) / 255.0f);
  for (int i = 0; i < 1000; ++i) shares.push_back(static_cast<float>(i) / 999.0f);
  others = {-1.0f, 0.5f, 1e9f};
  PackedNumbers packed;
  packed.pack(bytes);
  EXPECT_EQ(packed.byteCount(), 256u);
  packed.unpack(seen);
  EXPECT_EQ(seen, bytes);
  packed.pack(shares);
  EXPECT_EQ(packed.byteCount(), 2000u);
  packed.unpack(seen);
  for (size_t i = 0; i < shares.size(); ++i) EXPECT_NEAR(seen[i], shares[i], 7.7e-6);
  packed.pack(others);
  packed.unpack(seen);
  EXPECT_EQ(seen, others);
  packed.pack({});
  packed.unpack(seen);
  EXPECT_TRUE(seen.empty());
}

/// Two by two pixels, of which every array is there.
ViewPicture smallPicture() {
  ViewPicture picture;
  picture.width = picture.height = 2;
  for (int i = 0; i < 12; ++i) picture.colour.push_back(static_cast<float>(i) / 255.0f);
  picture.alpha = {0.25f, 0.5f, 1.0f, 0.0f};
  picture.weights = {0.0f, 1.0f, 2.0f, 0.5f};
  picture.depth = {0.123456f, 0.7f, 1e6f, 0.0f};
  picture.normals = {0, 0, 1, 0.6f, 0, -0.8f, -1, 0, 0, 0, 0, 0};
  return picture;
}

TEST(PackedPicture, TakesAQuarterOfTheRoomOfEightBits) {
  ViewPicture picture;
  picture.width = picture.height = 100;
  for (size_t i = 0; i < 30000; ++i) picture.colour.push_back(static_cast<float>(i % 256) / 255.0f);
  picture.alpha.assign(10000, 1.0f);
  const PackedPicture packed(picture);
  EXPECT_EQ(packed.bytes() - sizeof(PackedPicture), 40000u);
  EXPECT_EQ(packed.unpacked().colour, picture.colour);
}

TEST(PackedPicture, GivesBackEveryArray) {
  const ViewPicture picture = smallPicture();
  const ViewPicture seen = PackedPicture(picture).unpacked();
  EXPECT_EQ(seen.width, 2u);
  EXPECT_EQ(seen.height, 2u);
  EXPECT_EQ(seen.colour, picture.colour);
  EXPECT_EQ(seen.weights, picture.weights);
  EXPECT_EQ(seen.depth, picture.depth);
  for (size_t i = 0; i < 4; ++i) EXPECT_NEAR(seen.alpha[i], picture.alpha[i], 7.7e-6);
  ASSERT_EQ(seen.normals.size(), 12u);
  for (size_t i = 0; i < 12; ++i) EXPECT_NEAR(seen.normals[i], picture.normals[i], 1.6e-5);
  // Nothing known stays nothing known, and axes stay axes.
  EXPECT_EQ(seen.normals[2], 1.0f);
  EXPECT_EQ(seen.normals[6], -1.0f);
  EXPECT_EQ(seen.normals[9], 0.0f);
}

TEST(MemoryViewSource, KeepsPicturesPackedAndSharesThem) {
  MemoryViewSource views(ColourSpace::kDisplay);
  Camera camera;
  camera.width = camera.height = 2;
  camera.fx = camera.fy = 2;
  views.add(camera, smallPicture());
  EXPECT_EQ(views.load(0).depth, smallPicture().depth);
  const auto packed = views.packed(0);
  EXPECT_EQ(packed, views.packed(0));
  EXPECT_EQ(packed, MemoryViewSource(views).packed(0));
}

}  // namespace
}  // namespace stipple
