#include "decode/splat_layout.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "base/random.h"
#include "decode/cloud_loss.h"

namespace stipple {
namespace {

constexpr float kAnchor[3] = {0.4f, 0.5f, 0.6f};

SplatCloud activatedZeros(uint32_t gaussians, float unit) {
  const SplatLayout layout = {gaussians, 0};
  const std::vector<float> raw(layout.outputs(), 0.0f);
  SplatCloud cloud;
  activateSplats(layout, {kAnchor, std::span(&unit, 1)}, raw.data(), raw.size(), cloud);
  return cloud;
}

// DeG's own numbers for 32 Gaussians of an anchor whose features are all zero.
TEST(SplatLayout, ZerosAreTheLatticeOfTheSpecification) {
  const SplatCloud cloud = activatedZeros(32, 1.0f);
  ASSERT_EQ(cloud.size(), 32u);
  const struct {
    size_t k;
    double offset[3];
  } kOffsets[] = {{0, {-0.025, -0.025, -0.025}},
                  {1, {-0.0234375, 0, -0.00833333}},
                  {3, {-0.0203125, 0.0125, -0.01944444}},
                  {31, {0.0234375, 0.0234375, -0.00216049}}};
  for (const auto& [k, offset] : kOffsets) {
    for (size_t axis = 0; axis < 3; ++axis) {
      // float32 at 0.6: 6e-8.
      EXPECT_NEAR(
          static_cast<double>(cloud.positions[k * 3 + axis]) - static_cast<double>(kAnchor[axis]),
          offset[axis], 1.2e-7);
    }
  }
  for (size_t k = 0; k < 32; ++k) {
    EXPECT_NEAR(static_cast<double>(cloud.scales[k * 3]), 0.0041, 1e-8);
    EXPECT_NEAR(static_cast<double>(cloud.opacities[k]), 0.1, 1e-8);
    EXPECT_EQ(cloud.sh[k * 3], 0.0f) << "0.5 grey";
    EXPECT_EQ(cloud.rotations[k * 4], 1.0f);
  }
}

TEST(SplatLayout, HasTheBlocksOfTheSpecification) {
  const SplatLayout deg = {32, 0};
  EXPECT_EQ(deg.outputs(), 480u);
  EXPECT_EQ(deg.centre(1), 3u);
  EXPECT_EQ(deg.colour(0), 96u);
  EXPECT_EQ(deg.scale(0), 192u);
  EXPECT_EQ(deg.rotation(0), 288u);
  EXPECT_EQ(deg.opacity(0), 416u);
  EXPECT_EQ(deg.spread(31), 479u);
  const SplatLayout with_harmonics = {4, 2};
  EXPECT_EQ(with_harmonics.outputs(), 4u * (15 + 24));
  EXPECT_EQ(with_harmonics.higher(1), 60u + 24);
}

TEST(SplatLayout, LengthsAreInTheUnitOfTheAnchor) {
  const SplatCloud one = activatedZeros(8, 1.0f);
  const SplatCloud half = activatedZeros(8, 0.5f);
  for (size_t i = 0; i < one.positions.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(half.positions[i] - kAnchor[i % 3]),
                0.5 * static_cast<double>(one.positions[i] - kAnchor[i % 3]), 1.2e-7);
    EXPECT_FLOAT_EQ(half.scales[i], 0.5f * one.scales[i]);
  }
}

TEST(SplatLayout, GradientsAreThoseOfDifferences) {
  const SplatLayout layout = {5, 1};
  const size_t stride = layout.outputs() + 3;
  const std::vector<float> positions = {0.1f, 0.2f, 0.3f, 0.7f, 0.6f, 0.9f};
  const std::vector<float> units = {8.0f, 3.0f};
  const LayoutAnchors anchors = {positions, units};
  std::vector<float> raw(2 * stride);
  for (size_t i = 0; i < raw.size(); ++i) {
    raw[i] = 4.0f * (unitFloat(keyedBits(8, RandomUse::kFieldStart, i)) - 0.5f);
  }
  SplatCloud cloud;
  activateSplats(layout, anchors, raw.data(), stride, cloud);
  SplatCloud gradient = cloud;
  cloudLoss(cloud, &gradient);
  std::vector<float> raw_gradient(raw.size(), -77.0f);
  activateSplatsBackward(layout, anchors, raw.data(), stride, cloud, gradient, raw_gradient.data());
  for (size_t i = 0; i < raw.size(); ++i) {
    if (i % stride >= layout.outputs()) {
      EXPECT_EQ(raw_gradient[i], -77.0f) << "not an output";
      continue;
    }
    // Truncation eps^2 / 6 of third derivatives of a few units; float32 values of size 1 give
    // 1e-7 / eps.
    const float eps = 0x1.0p-6f;
    std::vector<float> moved = raw;
    SplatCloud other;
    moved[i] = raw[i] + eps;
    activateSplats(layout, anchors, moved.data(), stride, other);
    const double high = cloudLoss(other, nullptr);
    moved[i] = raw[i] - eps;
    activateSplats(layout, anchors, moved.data(), stride, other);
    const double low = cloudLoss(other, nullptr);
    EXPECT_NEAR(static_cast<double>(raw_gradient[i]), (high - low) / (2 * static_cast<double>(eps)),
                4e-4)
        << "output " << i % stride;
  }
}

TEST(SplatLayout, ExtremeOutputsGiveValidSplats) {
  const SplatLayout layout = {4, 0};
  for (const float value : {-1e30f, -100.0f, -10.0f, 100.0f, 1e4f}) {
    const std::vector<float> raw(layout.outputs(), value);
    const float unit = 1.0f;
    SplatCloud cloud;
    activateSplats(layout, {kAnchor, std::span(&unit, 1)}, raw.data(), raw.size(), cloud);
    SplatCloud gradient = cloud;
    if (std::abs(value) < 1e20f) {
      EXPECT_NO_THROW(validate(cloud, "cloud")) << value;
    }
    cloudLoss(cloud, &gradient);
    std::vector<float> raw_gradient(raw.size());
    activateSplatsBackward(layout, {kAnchor, std::span(&unit, 1)}, raw.data(), raw.size(), cloud,
                           gradient, raw_gradient.data());
    if (std::abs(value) < 1e20f) {
      for (const float by : raw_gradient) EXPECT_TRUE(std::isfinite(by)) << value;
    }
  }
}

}  // namespace
}  // namespace stipple
