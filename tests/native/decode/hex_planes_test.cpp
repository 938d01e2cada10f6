#include "decode/anchors/hex_planes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "decode/anchors/anchor_deformation.h"

namespace stipple {
namespace {

HexPlaneShape smallShape() {
  HexPlaneShape shape;
  shape.lowest = {-1, -2, 0};
  shape.highest = {1, 2, 3};
  shape.texels = 4;
  shape.moments = 5;
  shape.channels = 3;
  shape.seed = 9;
  return shape;
}

float drawn(uint64_t number) {
  return unitFloat(keyedBits(21, RandomUse::kFieldStart, number));
}

/// Planes whose numbers all differ.
HexPlanes livelyPlanes() {
  HexPlanes planes(smallShape());
  uint64_t number = 0;
  for (HexPlane& plane : planes.planes()) {
    for (float& value : plane.values) value = 0.4f + drawn(number++);
  }
  return planes;
}

/// Places in and a little outside the box.
std::vector<float> places(size_t count) {
  std::vector<float> values;
  for (size_t i = 0; i < count; ++i) {
    values.push_back(-1.1f + 2.2f * drawn(1000 + 3 * i));
    values.push_back(-2.1f + 4.2f * drawn(1001 + 3 * i));
    values.push_back(-0.1f + 3.2f * drawn(1002 + 3 * i));
  }
  return values;
}

double lossOf(const HexPlanes& planes, const std::vector<float>& at, double tau) {
  std::vector<float> features(at.size() / 3 * planes.featureWidth());
  HexPlaneTape tape;
  planes.forward(at, tau, features, tape);
  double sum = 0;
  for (size_t i = 0; i < features.size(); ++i) {
    sum += static_cast<double>(features[i]) * (static_cast<double>(drawn(5000 + i)) - 0.5);
  }
  return sum;
}

TEST(HexPlanes, AreProductsOfWhatIsReadInSixPlanes) {
  HexPlanes planes(smallShape());
  for (HexPlane& plane : planes.planes()) plane.values.assign(plane.values.size(), 1.0f);
  // In x and time of the first scale the number is that of the row: time runs over five rows.
  HexPlane& xt = planes.planes()[2];
  for (size_t i = 0; i < xt.values.size(); ++i) {
    xt.values[i] = static_cast<float>(i / (size_t{xt.width} * 3));
  }
  HexPlane& yz = planes.planes()[3];
  yz.values.assign(yz.values.size(), 2.0f);
  const std::vector<float> middle = {0, 0, 1.5f};
  std::vector<float> features(planes.featureWidth());
  HexPlaneTape tape;
  for (const double tau : {-1.0, -0.25, 0.0, 1.0, 7.0}) {
    planes.forward(middle, tau, features, tape);
    EXPECT_FLOAT_EQ(features[0], static_cast<float>(2 * 2 * (std::min(tau, 1.0) + 1))) << tau;
    EXPECT_FLOAT_EQ(features[3], 1.0f) << "of the second scale";
  }
}

TEST(HexPlanes, GradientsAreThoseOfDifferences) {
  HexPlanes planes = livelyPlanes();
  const std::vector<float> at = places(40);
  const double tau = 0.3;
  std::vector<float> features(40 * planes.featureWidth()), gradient(features.size());
  HexPlaneTape tape;
  planes.forward(at, tau, features, tape);
  for (size_t i = 0; i < gradient.size(); ++i) gradient[i] = drawn(5000 + i) - 0.5f;
  auto by_planes = planes.zeros();
  planes.backward(at, tape, gradient, by_planes);
  for (size_t p = 0; p < by_planes.size(); ++p) {
    for (size_t i = 0; i < by_planes[p].size(); i += 7) {
      float& value = planes.planes()[p].values[i];
      const float kept = value;
      const float eps = 0x1.0p-6f;  // linear in each number: rounding alone, 1e-6 / eps
      value = kept + eps;
      const double high = lossOf(planes, at, tau);
      value = kept - eps;
      const double low = lossOf(planes, at, tau);
      value = kept;
      EXPECT_NEAR(static_cast<double>(by_planes[p][i]),
                  (high - low) / (2 * static_cast<double>(eps)), 1e-3)
          << p << " " << i;
    }
  }
}

TEST(HexPlanes, RegulariserHasTheGradientOfDifferences) {
  HexPlanes planes = livelyPlanes();
  auto by_planes = planes.zeros();
  planes.regularise(by_planes);
  for (size_t p = 0; p < by_planes.size(); ++p) {
    for (size_t i = 0; i < by_planes[p].size(); i += 11) {
      float& value = planes.planes()[p].values[i];
      const float kept = value;
      auto unused = planes.zeros();
      const auto at = [&](float moved) {
        value = moved;
        const double sum = planes.regularise(unused);
        value = kept;
        return sum;
      };
      const double eps = 0x1.0p-7;
      const double difference =
          (at(kept + static_cast<float>(eps)) - at(kept - static_cast<float>(eps))) / (2 * eps);
      // |1 - value| has a kink where the value is 1.
      if (std::abs(kept - 1.0f) < 0.01f) continue;
      EXPECT_NEAR(static_cast<double>(by_planes[p][i]), difference, 2e-8) << p << " " << i;
    }
  }
}

TEST(HexPlanes, RefuseShapesWithoutSize) {
  HexPlaneShape shape = smallShape();
  shape.highest[1] = shape.lowest[1];
  EXPECT_THROW(HexPlanes{shape}, Error);
  shape = smallShape();
  shape.texels = 1;
  EXPECT_THROW(HexPlanes{shape}, Error);
  shape = smallShape();
  shape.multipliers = {5000};
  EXPECT_THROW(HexPlanes{shape}, Error);
}

ScaffoldParameters someAnchors(size_t count) {
  ScaffoldParameters scaffold = makeScaffold({.gaussians = 3});
  const std::vector<float> at = places(count);
  for (size_t i = 0; i < count; ++i) addAnchor(scaffold, &at[i * 3], nullptr, 0.5f);
  for (size_t i = 0; i < scaffold.features.size(); ++i) scaffold.features[i] = drawn(9000 + i);
  for (size_t i = 0; i < scaffold.offsets.size(); ++i) scaffold.offsets[i] = drawn(8000 + i);
  return scaffold;
}

TEST(AnchorDeformation, StartsAsNothingAtAnyTime) {
  const ScaffoldParameters anchors = someAnchors(30);
  const AnchorDeformation deformation = makeDeformation(smallShape(), 3);
  for (const double tau : {-1.0, -0.4, 0.0, 1.0}) {
    DeformationTape tape;
    AnchorArrays deformed;
    deform(deformation, anchors, 30, tau, tape, deformed);
    EXPECT_EQ(deformed.positions, anchors.positions);
    EXPECT_EQ(deformed.features, anchors.features);
    EXPECT_EQ(deformed.log_scales, anchors.log_scales);
    EXPECT_EQ(deformed.offsets, anchors.offsets);
  }
}

TEST(AnchorDeformation, IsNothingAtItsKeyFrameWhateverWasLearned) {
  const ScaffoldParameters anchors = someAnchors(30);
  AnchorDeformation deformation = makeDeformation(smallShape(), 3);
  for (float& bias : deformation.heads.layers().back().biases) bias = 0.25f;
  const auto at = [&](double tau) {
    DeformationTape tape;
    AnchorArrays deformed;
    deform(deformation, anchors, 30, tau, tape, deformed);
    return deformed;
  };
  EXPECT_EQ(at(0).positions, anchors.positions);
  EXPECT_EQ(at(0).features, anchors.features);
  EXPECT_EQ(at(0).log_scales, anchors.log_scales);
  EXPECT_EQ(at(0).offsets, anchors.offsets);
  // One number is a velocity, and a look that changes does so on both sides.
  const auto changeOf = [&](const std::vector<float>& values, const std::vector<float>& rest) {
    return static_cast<double>(values[7] - rest[7]);
  };
  const double step = changeOf(at(0.5).positions, anchors.positions);
  EXPECT_NEAR(step, 0.125 * deformation.unit, 1e-6);  // float32 of places about 1
  EXPECT_NEAR(changeOf(at(-1).positions, anchors.positions), -2 * step, 1e-6);
  EXPECT_NEAR(changeOf(at(-0.5).offsets, anchors.offsets), -0.125, 1e-6);
  EXPECT_NEAR(changeOf(at(-0.5).features, anchors.features), 0.125, 1e-6);
  EXPECT_NEAR(changeOf(at(0.5).log_scales, anchors.log_scales), 0.125, 1e-6);
}

class DeformationDerivatives : public testing::TestWithParam<bool> {};

TEST_P(DeformationDerivatives, AreThoseOfDifferences) {
  const ScaffoldParameters anchors = someAnchors(30);
  AnchorDeformation deformation = makeDeformation(smallShape(), 3);
  deformation.grows_from_key = GetParam();
  deformation.planes = livelyPlanes();
  for (size_t i = 0; i < deformation.heads.layers().back().weights.size(); ++i) {
    deformation.heads.layers().back().weights[i] = drawn(300 + i) - 0.5f;
  }
  constexpr size_t kCount = 25;  // others are not deformed
  constexpr double kTau = -0.35;
  const auto arrays = {&AnchorArrays::positions, &AnchorArrays::features, &AnchorArrays::log_scales,
                       &AnchorArrays::offsets};
  const auto loss = [&](AnchorArrays* gradient) {
    DeformationTape tape;
    AnchorArrays deformed;
    deform(deformation, anchors, kCount, kTau, tape, deformed);
    EXPECT_EQ(deformed.size(), kCount);
    double sum = 0;
    uint64_t number = 0;
    for (const auto part : arrays) {
      if (gradient) (gradient->*part).resize((deformed.*part).size());
      for (size_t i = 0; i < (deformed.*part).size(); ++i) {
        const double factor = static_cast<double>(drawn(70000 + number++)) - 0.5;
        sum += factor * static_cast<double>((deformed.*part)[i]);
        if (gradient) (gradient->*part)[i] = static_cast<float>(factor);
      }
    }
    return sum;
  };
  AnchorArrays by_deformed;
  loss(&by_deformed);
  DeformationTape tape;
  AnchorArrays deformed;
  deform(deformation, anchors, kCount, kTau, tape, deformed);
  DeformationGradients gradients;
  deformBackward(deformation, anchors, kCount, by_deformed, tape, gradients);
  size_t compared = 0;
  const auto compare = [&](float& value, float gradient, const std::string& what) {
    const float eps = 0x1.0p-8f;
    const float kept = value;
    value = kept + eps;
    const double high = loss(nullptr);
    value = kept - eps;
    const double low = loss(nullptr);
    value = kept;
    const double difference = (high - low) / (2 * static_cast<double>(eps));
    // 2,000 float32 numbers of size 1: rounding of 1e-6 / eps, and truncation eps^2.
    EXPECT_NEAR(static_cast<double>(gradient), difference, 2e-3 + 0.01 * std::abs(difference))
        << what;
    ++compared;
  };
  for (size_t l = 0; l < gradients.heads.size(); ++l) {
    LinearLayer& layer = deformation.heads.layers()[l];
    for (size_t i = 0; i < layer.weights.size(); i += 37) {
      compare(layer.weights[i], gradients.heads[l].weights[i], "weight");
    }
    for (size_t i = 0; i < layer.biases.size(); i += 5) {
      compare(layer.biases[i], gradients.heads[l].biases[i], "bias");
    }
  }
  for (size_t p = 0; p < gradients.planes.size(); ++p) {
    for (size_t i = 0; i < gradients.planes[p].size(); i += 13) {
      compare(deformation.planes.planes()[p].values[i], gradients.planes[p][i], "plane");
    }
  }
  EXPECT_GT(compared, 300u);
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutTime, DeformationDerivatives, testing::Bool());

}  // namespace
}  // namespace stipple
