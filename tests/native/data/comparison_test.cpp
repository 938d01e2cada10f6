#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "data/clouds/cloud_comparison.h"
#include "data/clouds/splat_frame.h"
#include "data/images/image_comparison.h"

namespace stipple {
namespace {

Image constantImage(float value, uint32_t side = 16) {
  Image image;
  image.width = image.height = side;
  image.channels = 3;
  image.transfer = Transfer::kSrgb;
  image.pixels.assign(size_t{side} * side * 3, value);
  return image;
}

TEST(ImageComparison, EqualPicturesDifferByNothing) {
  const ImageComparison result = compare(constantImage(0.3f), constantImage(0.3f));
  EXPECT_TRUE(std::isinf(result.psnr));
  EXPECT_NEAR(result.ssim, 1.0, 1e-12);
  EXPECT_EQ(result.max_error, 0.0);
}

TEST(ImageComparison, ConstantPicturesHaveTheClosedForm) {
  const double x = 0.25, y = 0.5;
  const ImageComparison result =
      compare(constantImage(static_cast<float>(x)), constantImage(static_cast<float>(y)));
  EXPECT_NEAR(result.psnr, -20 * std::log10(y - x), 1e-9);
  // Without variance SSIM is its luminance term; the second term is 1.
  EXPECT_NEAR(result.ssim, (2 * x * y + 1e-4) / (x * x + y * y + 1e-4), 1e-9);
  EXPECT_NEAR(result.mean_error, 0.25, 1e-12);
}

TEST(ImageComparison, LinearAndDisplayValuesOfOneColourAreEqual) {
  Image linear = constantImage(0.21404114f);  // sRGB 0.5
  linear.transfer = Transfer::kLinear;
  EXPECT_LT(compare(linear, constantImage(0.5f)).max_error, 1e-6);
}

TEST(ImageComparison, OnePixelPicturesWork) {
  EXPECT_NEAR(compare(constantImage(0.5f, 1), constantImage(0.5f, 1)).ssim, 1.0, 1e-12);
}

TEST(ImageComparison, RefusesPicturesOfDifferentSizeAndBadValues) {
  EXPECT_THROW(compare(constantImage(0, 16), constantImage(0, 17)), Error);
  Image bad = constantImage(0);
  bad.pixels[5] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(compare(bad, constantImage(0)), Error);
}

SplatCloud oneSplat() {
  SplatCloud cloud;
  cloud.resize(1);
  cloud.rotations = {1, 0, 0, 0};
  cloud.scales = {1, 2, 3};
  cloud.opacities = {0.5f};
  return cloud;
}

TEST(CloudComparison, MeasuresEachAttributeInItsUnit) {
  const SplatCloud a = oneSplat();
  SplatCloud b = oneSplat();
  b.positions[1] = 0.5f;
  b.scales[0] = std::exp(0.25f);
  b.opacities[0] = 0.75f;
  b.rotations = {-std::cos(0.05f), -std::sin(0.05f), 0, 0};  // 0.1 rad, opposite sign
  const CloudComparison result = compare(a, b);
  EXPECT_TRUE(result.same_order);
  EXPECT_DOUBLE_EQ(result.position.max, 0.5);
  EXPECT_NEAR(result.scale_ratio.max, 0.25, 1e-6);
  EXPECT_DOUBLE_EQ(result.opacity.max, 0.25);
  EXPECT_NEAR(result.rotation.max, 0.1, 1e-6);
}

TEST(CloudComparison, ComparesInOneFrame) {
  SplatCloud a = oneSplat();
  a.positions = {1, 2, 3};
  a.rotations = {0.5f, 0.5f, 0.1f, 0.7f};
  a.frame = Frame::kRDF;
  SplatCloud b = a;
  convertFrame(b, Frame::kRUB);
  EXPECT_EQ(b.positions[1], -2);
  EXPECT_EQ(compare(a, b).position.max, 0);
  // Sign flips are exact; acos is not used, so equal rotations give 0.
  EXPECT_EQ(compare(b, a).rotation.max, 0);
  b.positions[1] = -2.5f;
  EXPECT_EQ(compare(a, b).position.max, 0.5);
  // Files that say nothing are in the frame of trained files.
  a.frame = Frame::kUnknown;
  EXPECT_EQ(compare(a, b).position.max, 0.5);
}

TEST(CloudComparison, DoesNotCompareCloudsOfDifferentCount) {
  SplatCloud b = oneSplat();
  b.resize(2);
  EXPECT_FALSE(compare(oneSplat(), b).same_order);
}

TEST(CloudValidation, NamesTheBadSplat) {
  SplatCloud cloud = oneSplat();
  cloud.opacities[0] = 1.5f;
  try {
    validate(cloud, "splats");
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("opacity of splat 0 is 1.5"), std::string::npos);
  }
  cloud = oneSplat();
  cloud.rotations = {0, 0, 0, 0};
  EXPECT_THROW(validate(cloud, "splats"), Error);
  cloud = oneSplat();
  cloud.scales[1] = -1;
  EXPECT_THROW(validate(cloud, "splats"), Error);
}

}  // namespace
}  // namespace stipple
