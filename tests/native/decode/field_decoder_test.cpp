#include "decode/field/field_decoder.h"

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
#include "decode/field/field_tensors.h"

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

/// A field whose features and details are not small, so that all of it matters.
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
  // Details rise evenly along each axis: between cells they have no kinks, which would keep
  // differences from being derivatives.
  FeatureLevel& details = field.details.levels()[0];
  const size_t side = (size_t{1} << details.level) + 1;
  EXPECT_EQ(details.row_count, side * side * side);
  const size_t channels = field.details.channels();
  for (size_t i = 0; i < details.values.size(); ++i) {
    const size_t row = i / channels;
    const size_t place[] = {row % side, row / side % side, row / side / side};
    details.values[i] = 0.1f * static_cast<float>(place[i % channels % 3]);
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

/// In: tolerance: of float32 losses, for derivatives near 0.
void expectGradientsOfDifferences(bool contracted, double tolerance) {
  AnchorSet anchors = planeAnchors(5, 8);
  FieldParameters field = livelyField(4, 1);
  field.contracted = contracted;
  // Off the diagonals, where the largest coordinate is another one on either side.
  for (size_t i = 0; contracted && i < anchors.size(); ++i) anchors.positions[i * 3] += 0.012f;
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
    EXPECT_NEAR(static_cast<double>(gradient), difference, tolerance + 0.01 * std::abs(difference))
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
  compareGrid(field.details, gradients.details, "detail");
  EXPECT_GT(compared, 300u);
  EXPECT_GT(largest, 1.0);
}

TEST(FieldDecoder, GradientsAreThoseOfDifferences) {
  expectGradientsOfDifferences(false, 2e-3);
}

// Places and sizes are up to ten times as large, and with them the loss and what it rounds.
TEST(FieldDecoder, GradientsAreThoseOfDifferencesAllAround) {
  expectGradientsOfDifferences(true, 2e-2);
}

/// One channel of the details of a field that knows nothing else.
SplatCloud withDetail(size_t channel, float value) {
  auto field = std::make_shared<FieldParameters>(makeFieldParameters(smallShape(4, 0)));
  for (FeatureLevel& level : field->details.levels()) {
    if (level.level != field->details.levels()[0].level) continue;
    for (size_t i = channel; i < level.values.size(); i += kDetailChannels) level.values[i] = value;
  }
  const AnchorSet anchors = planeAnchors(5, 2);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = 4;
  return FieldDecoder(field).decode(request);
}

TEST(FieldDecoder, DetailsChangeWhatTheyStandFor) {
  const SplatCloud plain = withDetail(0, 0.0f);
  const SplatCloud coloured = withDetail(1, 0.5f);
  const SplatCloud clear = withDetail(kDetailOpacity, -3.0f);
  const SplatCloud small = withDetail(kDetailScale, -1.0f);
  const SplatCloud moved = withDetail(kDetailOffset + 2, 0.25f);
  for (size_t n = 0; n < plain.size(); ++n) {
    // The coarsest level counts nearly whole: its cells of a half are far wider than a footprint.
    const float share = (coloured.sh[n * 3 + 1] - plain.sh[n * 3 + 1]) / 0.5f;
    EXPECT_GT(share, 0.97f);
    EXPECT_LE(share, 1.0f + 1e-5f);
    EXPECT_EQ(coloured.sh[n * 3], plain.sh[n * 3]);
    const float odds = std::exp(-3.0f * share) * plain.opacities[n] / (1 - plain.opacities[n]);
    EXPECT_NEAR(clear.opacities[n], odds / (1 + odds), 1e-5f);
    EXPECT_EQ(clear.positions[n * 3], plain.positions[n * 3]);
    EXPECT_NEAR(small.scales[n * 3] / plain.scales[n * 3], std::exp(-share), 1e-4f);
    EXPECT_GT(moved.positions[n * 3 + 2], plain.positions[n * 3 + 2]);
    EXPECT_EQ(moved.positions[n * 3 + 1], plain.positions[n * 3 + 1]);
  }
}

TEST(FieldDecoder, DetailsChangeShapesAxisByAxisAndTurnThem) {
  const SplatCloud plain = withDetail(0, 0.0f);
  const SplatCloud coloured = withDetail(1, 0.5f);
  const SplatCloud narrow = withDetail(kDetailScales + 1, -1.0f);
  const SplatCloud turned = withDetail(kDetailTurn + 2, 0.5f);
  for (size_t n = 0; n < plain.size(); ++n) {
    const float share = (coloured.sh[n * 3 + 1] - plain.sh[n * 3 + 1]) / 0.5f;
    EXPECT_EQ(narrow.scales[n * 3], plain.scales[n * 3]);
    EXPECT_NEAR(narrow.scales[n * 3 + 1] / plain.scales[n * 3 + 1], std::exp(-kShapeShare * share),
                1e-4f);
    EXPECT_EQ(turned.scales[n * 3 + 1], plain.scales[n * 3 + 1]);
    // (1, 0, 0, r) turns about z by twice the angle whose tangent is r.
    const double half = std::atan(static_cast<double>(kShapeShare * 0.5f * share));
    const float* p = &plain.rotations[n * 4];
    const double c = std::cos(half), s = std::sin(half);
    const auto at = [&](size_t k) { return static_cast<double>(p[k]); };
    const double expected[] = {c * at(0) - s * at(3), c * at(1) - s * at(2), c * at(2) + s * at(1),
                               c * at(3) + s * at(0)};
    for (size_t k = 0; k < 4; ++k) {
      EXPECT_NEAR(static_cast<double>(turned.rotations[n * 4 + k]), expected[k], 1e-6);
    }
  }
}

/// A turn that details of no size make, however large they become, leaves unit quaternions and
/// finite derivatives, which fade as a half turn is all that there is.
TEST(FieldDecoder, LargestDetailsLeaveUnitRotationsAndFiniteDerivatives) {
  std::vector<float> details(kDetailChannels, 0.0f);
  SplatCloud plain;
  plain.resize(1);
  plain.positions.assign(3, 0.5f);
  plain.scales.assign(3, 0.01f);
  plain.rotations = {1, 0, 0, 0};
  plain.opacities.assign(1, 0.5f);
  plain.sh.assign(plain.shStride(), 0.0f);
  const std::vector<float> footprint = {0.01f};
  const FieldDetails how = {kDetailChannels, footprint, {}};
  for (const float size : {1e-30f, 1.0f, 1e4f, 1e15f, -1e15f, 1e30f}) {
    std::fill_n(&details[kDetailScale], kDetailChannels - kDetailScale, size);
    std::fill_n(&details[kDetailOffset], 3, 0.0f);
    SplatCloud cloud = plain;
    addDetails(how, details, cloud);
    EXPECT_NO_THROW(validate(cloud, "cloud")) << size;
    SplatCloud gradient = cloud;
    gradient.rotations = {1, -2, 3, -4};
    std::vector<float> by_details(kDetailChannels);
    addDetailsBackward(how, details, 1.0f, cloud, gradient, by_details);
    for (const float value : by_details) EXPECT_TRUE(std::isfinite(value)) << size;
    for (const float value : gradient.rotations) EXPECT_TRUE(std::isfinite(value)) << size;
    if (std::abs(size) > 1e3f) {
      EXPECT_LT(std::abs(by_details[kDetailTurn]), 1e-3f);
    }
  }
}

/// What files hold that were written before shapes were learned: eight numbers a corner.
TEST(FieldDecoder, TakesFieldsWithoutShapes) {
  FieldParameters field = livelyField(4, 0);
  const size_t without = kChannelsWithoutShapes;
  FieldParameters zero = field;
  std::vector<FeatureLevel> levels = field.details.levels();
  for (size_t l = 0; l < levels.size(); ++l) {
    std::vector<float>& full = zero.details.levels()[l].values;
    levels[l].values.clear();
    for (size_t i = 0; i < full.size(); ++i) {
      if (i % kDetailChannels < without) {
        levels[l].values.push_back(full[i]);
      } else {
        full[i] = 0;
      }
    }
  }
  field.details = FeatureGrid(without, levels);
  auto read = std::make_shared<FieldParameters>(fieldOfTensors(tensorsOfField(field), field));
  EXPECT_TRUE(seesNeighbours(*read));
  const AnchorSet anchors = planeAnchors(5, 4);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = 4;
  const SplatCloud old = FieldDecoder(read).decode(request);
  const SplatCloud now = FieldDecoder(std::make_shared<FieldParameters>(zero)).decode(request);
  EXPECT_EQ(old.scales, now.scales);
  EXPECT_EQ(old.positions, now.positions);
  EXPECT_EQ(old.sh, now.sh);
  for (size_t i = 0; i < old.rotations.size(); ++i) {
    EXPECT_NEAR(old.rotations[i], now.rotations[i], 2e-7f) << "float32 normalises once more";
  }
}

/// What the first asset files hold: colours alone, and a network that does not see neighbours.
TEST(FieldDecoder, TakesFieldsWithColoursAlone) {
  FieldParameters field = livelyField(4, 0);
  const TensorTable whole = tensorsOfField(field);
  EXPECT_EQ(whole.count("field.details.level5"), 1u);
  std::vector<FeatureLevel> levels = field.details.levels();
  for (FeatureLevel& level : levels) level.values.assign(level.row_count * kColourChannels, 0.5f);
  field.details = FeatureGrid(kColourChannels, levels);
  const size_t widths[] = {fieldInputWidth(field), 16, fieldOutputWidth(field.layout)};
  field.network = Mlp(widths, 1, 1.0f);
  const TensorTable table = tensorsOfField(field);
  EXPECT_EQ(table.count("field.colours.level5"), 1u);
  EXPECT_EQ(table.count("field.details.level5"), 0u);
  auto read = std::make_shared<FieldParameters>(fieldOfTensors(table, field));
  EXPECT_FALSE(seesNeighbours(*read));
  const AnchorSet anchors = planeAnchors(5, 4);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = 4;
  const SplatCloud cloud = FieldDecoder(read).decode(request);
  EXPECT_NO_THROW(validate(cloud, "cloud"));
  read->details = FeatureGrid(5, {});
  EXPECT_THROW(validate(*read), Error);
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
