#include "splat/edit/cloud_merge.h"

#include <gtest/gtest.h>

#include <string>

#include "base/error.h"
#include "data/clouds/cloud_transform.h"
#include "splat/random_scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::randomCloud;

SplatCloud cloudOf(int degree, uint32_t seed) {
  CloudRecipe recipe;
  recipe.count = 40;
  recipe.degree = degree;
  return randomCloud(recipe, seed);
}

TEST(CloudMerge, MakesThePictureOfItsPartsTogether) {
  const SplatCloud a = cloudOf(1, 2);
  const SplatCloud b = cloudOf(3, 3);
  std::vector<SplatInstance> instances(2);
  instances[0].cloud = &a;
  instances[1].cloud = &b;
  instances[1].object_to_world(0, 3) = 0.4;
  instances[1].object_to_world(2, 2) = -1;  // mirrored
  const SplatCloud both = merged(instances, Frame::kRFU);
  ASSERT_EQ(both.size(), 80u);
  EXPECT_EQ(both.sh_degree, 3);
  EXPECT_EQ(both.frame, Frame::kRFU);
  SplatInstance whole;
  whole.cloud = &both;
  const Camera camera = testing::frontCamera(48, 48, 40, 6);
  const ReferenceResult apart = renderReference(instances, camera, {});
  const ReferenceResult together = renderReference(std::span(&whole, 1), camera, {});
  for (size_t i = 0; i < apart.colour.size(); ++i) {
    // The moved cloud is rounded to float32 once.
    EXPECT_NEAR(apart.colour[i], together.colour[i], 3e-5);
  }
}

TEST(CloudMerge, KeepsBitsAndPadsHarmonicsWithZeros) {
  const SplatCloud a = cloudOf(0, 2);
  const SplatCloud b = cloudOf(2, 3);
  std::vector<SplatInstance> instances(2);
  instances[0].cloud = &a;
  instances[1].cloud = &b;
  const SplatCloud both = merged(instances, Frame::kRFU);
  const size_t stride = both.shStride();
  for (size_t i = 0; i < a.size(); ++i) {
    for (size_t c = 0; c < stride; ++c) {
      EXPECT_EQ(both.sh[i * stride + c], c < 3 ? a.sh[i * 3 + c] : 0.0f);
    }
  }
  EXPECT_TRUE(std::equal(b.sh.begin(), b.sh.end(),
                         both.sh.begin() + static_cast<std::ptrdiff_t>(a.size() * stride)));
  EXPECT_TRUE(std::equal(a.rotations.begin(), a.rotations.end(), both.rotations.begin()));
  EXPECT_TRUE(std::equal(b.positions.begin(), b.positions.end(), both.positions.begin() + 120));
  EXPECT_GE(mergeMemoryBound(instances), both.sh.size() * sizeof(float));
}

TEST(CloudMerge, RefusesCloudsThatDisagreeAndSaysHow) {
  const SplatCloud a = cloudOf(0, 2);
  SplatCloud linear = a;
  linear.colour_space = ColourSpace::kLinear;
  SplatCloud mip = a;
  mip.antialias = Antialias::kMip;
  for (const auto& [other, text] : {std::pair{&linear, "lin_rec709_display"}, {&mip, "mip"}}) {
    std::vector<SplatInstance> instances(2);
    instances[0].cloud = &a;
    instances[1].cloud = other;
    try {
      merged(instances, Frame::kRFU);
      FAIL() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kUnsupported);
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    }
  }
}

TEST(CloudMerge, OfNothingIsEmpty) {
  EXPECT_EQ(merged({}, Frame::kUnknown).size(), 0u);
  const SplatCloud empty;
  std::vector<SplatInstance> instances(2);
  instances[0].cloud = &empty;
  instances[1].cloud = &empty;
  EXPECT_EQ(merged(instances, Frame::kRFU).size(), 0u);
}

}  // namespace
}  // namespace stipple
