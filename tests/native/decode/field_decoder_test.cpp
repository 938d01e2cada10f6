#include "decode/field_decoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "decode/anchor_spacing.h"
#include "decode/cloud_loss.h"

namespace stipple {
namespace {

/// Evenly spread leaves of the plane z = 0.5 at a level, one anchor each.
AnchorSet planeAnchors(int level, uint32_t step) {
  AnchorSet anchors;
  anchors.leaf_level = level;
  const uint32_t side = 1u << level;
  for (uint32_t y = step / 2; y < side; y += step) {
    for (uint32_t x = step / 2; x < side; x += step) {
      const float inverse = 1.0f / static_cast<float>(side);
      anchors.positions.push_back((static_cast<float>(x) + 0.5f) * inverse);
      anchors.positions.push_back((static_cast<float>(y) + 0.5f) * inverse);
      anchors.positions.push_back(0.5f + 0.25f * inverse);
      anchors.log_q.push_back(-5.0f);
      anchors.leaves.push_back(anchors.leaves.size());
    }
  }
  return anchors;
}

FieldShape smallShape(uint32_t gaussians, int sh_degree) {
  FieldShape shape;
  shape.root = {{-1.0, 2.0, 0.5}, 4.0};
  shape.leaf_level = 5;
  shape.layout = {gaussians, sh_degree};
  shape.least_anchors = 16;
  shape.most_anchors = 1024;
  shape.surface_cells = 1 << 14;
  shape.seed = 3;
  return shape;
}

/// A field whose features and colours are not small, so that all of it matters.
FieldParameters livelyField(uint32_t gaussians, int sh_degree) {
  FieldParameters field = makeFieldParameters(smallShape(gaussians, sh_degree));
  uint64_t number = 0;
  const auto fill = [&](FeatureGrid& grid, float size) {
    for (FeatureLevel& level : grid.levels()) {
      for (float& value : level.values) {
        value = size * (unitFloat(keyedBits(5, RandomUse::kFieldStart, number++)) - 0.5f);
      }
    }
  };
  fill(field.features, 2.0f);
  // Colours rise evenly along each axis: between cells they have no kinks, which would keep
  // differences from being derivatives.
  FeatureLevel& colours = field.colours.levels()[0];
  const size_t side = (size_t{1} << colours.level) + 1;
  EXPECT_EQ(colours.row_count, side * side * side);
  for (size_t i = 0; i < colours.values.size(); ++i) {
    const size_t row = i / 3;
    const size_t place[] = {row % side, row / side % side, row / side / side};
    colours.values[i] = 0.1f * static_cast<float>(place[i % 3]);
  }
  for (float& weight : field.network.layers().back().weights) weight *= 5.0f;
  return field;
}

TEST(AnchorSpacing, IsTheSideOfTheAreaThatAnAnchorHas) {
  // On a square lattice of side s the nearest six squared distances of an inner point are 1, 1, 1,
  // 1, 2, 2 s^2: sqrt(8 pi / 21) s = 1.094 s.
  const AnchorSet anchors = planeAnchors(5, 2);
  const std::vector<float> spacing = anchorSpacing(anchors);
  EXPECT_NEAR(static_cast<double>(spacing[8 * 16 + 8]), std::sqrt(8 * 3.14159265358979 / 21) / 16,
              1e-6);
  for (const float s : spacing) {
    EXPECT_GT(s, 1.0f / 16);
    EXPECT_LT(s, 2.2f / 16) << "at a corner of the square";
  }
}

TEST(AnchorSpacing, HalvesWhereTheBudgetIsFourTimesAsLarge) {
  const double coarse = static_cast<double>(anchorSpacing(planeAnchors(6, 4))[8 * 16 + 8]);
  const double fine = static_cast<double>(anchorSpacing(planeAnchors(6, 2))[16 * 32 + 16]);
  EXPECT_NEAR(coarse / fine, 2.0, 1e-5);
}

TEST(AnchorSpacing, TakesFewAnchorsAndManyInOnePlace) {
  AnchorSet anchors = planeAnchors(5, 32);
  ASSERT_EQ(anchors.size(), 1u);
  EXPECT_EQ(anchorSpacing(anchors)[0], 0.5f);
  for (int i = 0; i < 63; ++i) {
    for (int axis = 0; axis < 3; ++axis) anchors.positions.push_back(anchors.positions[axis]);
    anchors.log_q.push_back(0.0f);
    anchors.leaves.push_back(0);
  }
  for (const float s : anchorSpacing(anchors)) EXPECT_FLOAT_EQ(s, 1.0f / 32 / 8);
}

TEST(FieldDecoder, StartsAsGreyGaussiansAroundEveryAnchor) {
  auto field = std::make_shared<FieldParameters>(makeFieldParameters(smallShape(8, 0)));
  const AnchorSet anchors = planeAnchors(5, 2);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = 8;
  const SplatCloud cloud = FieldDecoder(field).decode(request);
  ASSERT_EQ(cloud.size(), anchors.size() * 8);
  EXPECT_NO_THROW(validate(cloud, "cloud"));
  const std::vector<float> spacing = anchorSpacing(anchors);
  for (size_t n = 0; n < cloud.size(); ++n) {
    const double a = 4.0 * static_cast<double>(spacing[n / 8]);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double anchor =
          field->root.origin[axis] + 4.0 * static_cast<double>(anchors.positions[n / 8 * 3 + axis]);
      // The lattice is one spacing wide; small random weights move it by a part of that.
      EXPECT_LT(std::abs(static_cast<double>(cloud.positions[n * 3 + axis]) - anchor), 0.75 * a);
      EXPECT_NEAR(static_cast<double>(cloud.scales[n * 3 + axis]), 0.6 * a / std::sqrt(8.0),
                  0.12 * a);
    }
    EXPECT_NEAR(static_cast<double>(cloud.opacities[n]), 0.3, 0.1);
  }
}

TEST(FieldDecoder, SizesFollowTheBudget) {
  auto field = std::make_shared<FieldParameters>(makeFieldParameters(smallShape(4, 0)));
  field->network.layers().back().weights.assign(field->network.layers().back().weights.size(), 0);
  const FieldDecoder decoder(field);
  const auto sizeOf = [&](uint32_t step, size_t anchor) {
    const AnchorSet anchors = planeAnchors(6, step);
    DecodeRequest request;
    request.anchors = &anchors;
    request.gaussians_per_anchor = 4;
    return static_cast<double>(decoder.decode(request).scales[anchor * 12]);
  };
  EXPECT_NEAR(sizeOf(4, 8 * 16 + 8) / sizeOf(2, 16 * 32 + 16), 2.0, 1e-4);
}

TEST(FieldDecoder, GradientsAreThoseOfDifferences) {
  const AnchorSet anchors = planeAnchors(5, 8);
  FieldParameters field = livelyField(4, 1);
  const auto view = std::shared_ptr<const FieldParameters>(&field, [](const FieldParameters*) {});
  const FieldDecoder decoder(view);
  FieldTape tape;
  SplatCloud cloud;
  decoder.forward(anchors, tape, cloud);
  SplatCloud cloud_gradient = cloud;
  cloudLoss(cloud, &cloud_gradient);
  FieldGradients gradients;
  decoder.backward(anchors, tape, cloud, cloud_gradient, gradients);
  size_t compared = 0;
  double largest = 0;
  const auto compare = [&](float& value, float gradient, const std::string& what) {
    // A loss of 1000 float32 numbers of size 1: rounding of 1e-6 / eps, and truncation eps^2.
    const float eps = 0x1.0p-8f;
    const float kept = value;
    FieldTape other_tape;
    SplatCloud other;
    value = kept + eps;
    decoder.forward(anchors, other_tape, other);
    const double high = cloudLoss(other, nullptr);
    value = kept - eps;
    decoder.forward(anchors, other_tape, other);
    const double low = cloudLoss(other, nullptr);
    value = kept;
    const double difference = (high - low) / (2 * static_cast<double>(eps));
    EXPECT_NEAR(static_cast<double>(gradient), difference, 2e-3 + 0.01 * std::abs(difference))
        << what;
    largest = std::max(largest, std::abs(difference));
    ++compared;
  };
  for (size_t l = 0; l < field.network.layers().size(); ++l) {
    LinearLayer& layer = field.network.layers()[l];
    for (size_t i = 0; i < layer.weights.size(); i += 97) {
      compare(layer.weights[i], gradients.network[l].weights[i], "weight");
    }
    for (size_t i = 0; i < layer.biases.size(); i += 7) {
      compare(layer.biases[i], gradients.network[l].biases[i], "bias");
    }
  }
  const auto compareGrid = [&](FeatureGrid& grid, const std::vector<FeatureGradient>& by,
                               const char* what) {
    for (size_t l = 0; l < grid.levels().size(); ++l) {
      for (size_t i = 0; i < by[l].rows.size(); i += 11) {
        const size_t at = by[l].rows[i] * grid.channels() + i % grid.channels();
        compare(grid.levels()[l].values[at], by[l].values[at], what);
      }
    }
  };
  compareGrid(field.features, gradients.features, "feature");
  compareGrid(field.colours, gradients.colours, "colour");
  EXPECT_GT(compared, 300u);
  EXPECT_GT(largest, 1.0);
}

TEST(FieldDecoder, HasTheSameBitsForAnyNumberOfThreads) {
  auto field = std::make_shared<FieldParameters>(livelyField(8, 0));
  const AnchorSet anchors = planeAnchors(5, 1);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = 8;
  SplatCloud one, other;
  withThreads(1, [&] { one = FieldDecoder(field).decode(request); });
  withThreads(3, [&] { other = FieldDecoder(field).decode(request); });
  EXPECT_EQ(one.positions, other.positions);
  EXPECT_EQ(one.scales, other.scales);
  EXPECT_EQ(one.sh, other.sh);
}

TEST(FieldDecoder, RefusesWhatItWasNotMadeFor) {
  auto field = std::make_shared<FieldParameters>(makeFieldParameters(smallShape(8, 0)));
  const AnchorSet anchors = planeAnchors(5, 8);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = 16;
  EXPECT_THROW(FieldDecoder(field).decode(request), Error);
  FieldShape shape = smallShape(3, 0);
  EXPECT_THROW(makeFieldParameters(shape), Error);
  shape = smallShape(8, 5);
  EXPECT_THROW(makeFieldParameters(shape), Error);
  shape = smallShape(8, 0);
  shape.least_anchors = 0;
  EXPECT_THROW(makeFieldParameters(shape), Error);
  FieldParameters other = *field;
  EXPECT_NO_THROW(validate(other));
  other.layout.gaussians = 12;
  EXPECT_THROW(validate(other), Error);
}

}  // namespace
}  // namespace stipple
