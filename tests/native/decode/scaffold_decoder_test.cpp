#include "decode/anchors/scaffold_decoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "decode/anchors/scaffold_tensors.h"
#include "decode/cloud_loss.h"

namespace stipple {
namespace {

/// `count` anchors whose numbers all matter.
ScaffoldParameters livelyScaffold(size_t count, uint32_t gaussians, int sh_degree) {
  ScaffoldShape shape;
  shape.gaussians = gaussians;
  shape.sh_degree = sh_degree;
  shape.seed = 3;
  ScaffoldParameters scaffold = makeScaffold(shape);
  uint64_t number = 0;
  const auto drawn = [&](float size) {
    return size * (unitFloat(keyedBits(11, RandomUse::kFieldStart, number++)) - 0.5f);
  };
  for (size_t i = 0; i < count; ++i) {
    const float position[] = {drawn(4), drawn(4), drawn(4)};
    addAnchor(scaffold, position, nullptr, 0.5f);
  }
  for (float& value : scaffold.features) value = drawn(2);
  for (float& value : scaffold.log_scales) value += drawn(1);
  for (float& value : scaffold.offsets) value = drawn(2);
  for (Mlp* network : {&scaffold.opacity, &scaffold.covariance, &scaffold.colour}) {
    for (float& weight : network->layers().back().weights) weight *= 3.0f;
  }
  return scaffold;
}

std::shared_ptr<const ScaffoldParameters> viewOf(const ScaffoldParameters& scaffold) {
  return {&scaffold, [](const ScaffoldParameters*) {}};
}

TEST(ScaffoldDecoder, ActivatesAsPublished) {
  // With networks of zeros but for biases every number has a closed form.
  ScaffoldParameters scaffold = makeScaffold({.gaussians = 2, .sh_degree = 1});
  const float position[] = {1, 2, 3};
  addAnchor(scaffold, position, nullptr, 0.5f);
  for (Mlp* network : {&scaffold.opacity, &scaffold.covariance, &scaffold.colour}) {
    for (LinearLayer& layer : network->layers()) layer.weights.assign(layer.weights.size(), 0.0f);
  }
  scaffold.log_scales = {std::log(2.0f), std::log(3.0f), std::log(4.0f),
                         std::log(0.1f), std::log(0.2f), std::log(0.4f)};
  scaffold.offsets = {1, -1, 0.5f, 0, 0, 0};
  scaffold.opacity.layers().back().biases = {0.5f, -0.1f};  // the second is not there
  scaffold.covariance.layers().back().biases = {0, std::log(3.0f), 0, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0,
                                                0};
  scaffold.colour.layers().back().biases = {
      std::log(3.0f), 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  ScaffoldTape tape;
  SplatCloud cloud;
  ScaffoldDecoder(viewOf(scaffold)).forward(scaffold, 1, tape, cloud);
  ASSERT_EQ(cloud.size(), 1u);
  EXPECT_THAT(tape.slots, testing::ElementsAre(0u));
  const auto near = [](const std::vector<double>& wanted) {
    std::vector<testing::Matcher<float>> all;
    for (const double value : wanted) {
      all.push_back(testing::FloatNear(static_cast<float>(value), 1e-5f));
    }
    return testing::ElementsAreArray(all);
  };
  EXPECT_THAT(cloud.positions, near({1 + 2.0, 2 - 3.0, 3 + 2.0}));
  EXPECT_THAT(cloud.scales, near({0.05, 0.15, 0.2}));  // logistic: 1/2, 3/4, 1/2
  EXPECT_THAT(cloud.rotations, near({0, 0, 0, 1}));
  EXPECT_THAT(cloud.opacities, near({std::tanh(0.5)}));
  EXPECT_THAT(cloud.sh, near({0.25 / 0.28209479, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_NO_THROW(validate(cloud, "cloud"));
}

TEST(ScaffoldDecoder, StartsWithEverySplatThere) {
  ScaffoldParameters scaffold = makeScaffold({.gaussians = 10, .sh_degree = 2, .seed = 5});
  const float position[] = {0, 0, 0};
  addAnchor(scaffold, position, nullptr, 0.5f);
  DecodeRequest request;
  request.budget = 1;
  request.gaussians_per_anchor = 10;
  const SplatCloud cloud = ScaffoldDecoder(viewOf(scaffold)).decode(request);
  EXPECT_EQ(cloud.size(), 10u);
  EXPECT_NO_THROW(validate(cloud, "cloud"));
}

TEST(ScaffoldDecoder, BudgetsAreTheFirstAnchors) {
  const ScaffoldParameters scaffold = livelyScaffold(40, 4, 0);
  const ScaffoldDecoder decoder(viewOf(scaffold));
  DecodeRequest request;
  request.gaussians_per_anchor = 4;
  request.budget = 40;
  const SplatCloud all = decoder.decode(request);
  request.budget = 17;
  const SplatCloud some = decoder.decode(request);
  ASSERT_GT(some.size(), 0u);
  ASSERT_LT(some.size(), all.size());
  for (size_t i = 0; i < some.positions.size(); ++i) {
    EXPECT_EQ(some.positions[i], all.positions[i]);
    EXPECT_EQ(some.scales[i], all.scales[i]);
  }
}

TEST(ScaffoldDecoder, GradientsAreThoseOfDifferences) {
  ScaffoldParameters scaffold = livelyScaffold(24, 3, 1);
  const ScaffoldDecoder decoder(viewOf(scaffold));
  constexpr size_t kAnchors = 20;  // others learn nothing
  ScaffoldTape tape;
  SplatCloud cloud;
  decoder.forward(scaffold, kAnchors, tape, cloud);
  // Some splats are not there, and some of what is there is near the border.
  ASSERT_LT(cloud.size(), kAnchors * 3);
  const std::vector<uint32_t> there = tape.slots;
  SplatCloud by_cloud = cloud;
  cloudLoss(cloud, &by_cloud);
  ScaffoldGradients gradients;
  decoder.backward(scaffold, tape, cloud, by_cloud, gradients);
  size_t compared = 0;
  const auto compare = [&](float& value, float gradient, const std::string& what) {
    // A loss of 1000 float32 numbers of size 1: rounding of 1e-6 / eps, and truncation eps^2.
    const float eps = 0x1.0p-8f;
    const float kept = value;
    const auto lossAt = [&](float moved) {
      value = moved;
      ScaffoldTape other_tape;
      SplatCloud other;
      decoder.forward(scaffold, kAnchors, other_tape, other);
      value = kept;
      return other_tape.slots == there ? cloudLoss(other, nullptr) : std::nan("");
    };
    const double difference =
        (lossAt(kept + eps) - lossAt(kept - eps)) / (2 * static_cast<double>(eps));
    if (std::isnan(difference)) return;  // a splat came or went
    EXPECT_NEAR(static_cast<double>(gradient), difference, 0.01 + 0.01 * std::abs(difference))
        << what;
    ++compared;
  };
  const auto compareAll = [&](std::vector<float>& values, const std::vector<float>& by, size_t step,
                              const char* what) {
    ASSERT_EQ(values.size(), by.size()) << what;
    for (size_t i = 0; i < values.size(); i += step) compare(values[i], by[i], what);
  };
  compareAll(scaffold.features, gradients.anchors.features, 5, "feature");
  compareAll(scaffold.log_scales, gradients.anchors.log_scales, 1, "scale");
  compareAll(scaffold.positions, gradients.anchors.positions, 1, "position");
  compareAll(scaffold.offsets, gradients.anchors.offsets, 1, "offset");
  const auto compareNetwork = [&](Mlp& network, const std::vector<LinearLayer>& by,
                                  const char* what) {
    for (size_t l = 0; l < by.size(); ++l) {
      compareAll(network.layers()[l].weights, by[l].weights, 13, what);
      compareAll(network.layers()[l].biases, by[l].biases, 3, what);
    }
  };
  compareNetwork(scaffold.opacity, gradients.opacity, "network of opacities");
  compareNetwork(scaffold.covariance, gradients.covariance, "network of covariances");
  compareNetwork(scaffold.colour, gradients.colour, "network of colours");
  EXPECT_GT(compared, 600u);
}

TEST(ScaffoldDecoder, RefusesAnotherCountOfGaussians) {
  const ScaffoldParameters scaffold = livelyScaffold(2, 4, 0);
  DecodeRequest request;
  request.budget = 2;
  request.gaussians_per_anchor = 5;
  EXPECT_THROW(ScaffoldDecoder(viewOf(scaffold)).decode(request), Error);
}

TEST(ScaffoldDecoder, MakesSplatsOfFewerAnchorsLarger) {
  ScaffoldParameters scaffold = livelyScaffold(8, 2, 0);
  const auto decoded = [&](double coarsening, size_t count, ScaffoldTape& tape) {
    scaffold.coarsening = coarsening;
    SplatCloud cloud;
    ScaffoldDecoder(viewOf(scaffold)).forward(scaffold, count, tape, cloud);
    return cloud;
  };
  ScaffoldTape tape;
  EXPECT_EQ(decoded(0.5, 8, tape).scales, decoded(0, 8, tape).scales);
  const SplatCloud plain = decoded(0, 2, tape), grown = decoded(0.5, 2, tape);
  ASSERT_GT(grown.size(), 0u);
  EXPECT_EQ(grown.positions, plain.positions);
  for (size_t i = 0; i < grown.scales.size(); ++i) {
    EXPECT_FLOAT_EQ(grown.scales[i], 2 * plain.scales[i]);  // the root of a quarter of the anchors
  }
  // A logarithm that rises by d lengthens them by e^d, whatever they are multiplied by.
  SplatCloud by_cloud = grown;
  for (auto values : {&SplatCloud::positions, &SplatCloud::rotations, &SplatCloud::scales,
                      &SplatCloud::opacities, &SplatCloud::sh}) {
    std::fill((by_cloud.*values).begin(), (by_cloud.*values).end(), 0.0f);
  }
  std::fill(by_cloud.scales.begin(), by_cloud.scales.end(), 1.0f);
  ScaffoldGradients gradients;
  ScaffoldDecoder(viewOf(scaffold)).backward(scaffold, tape, grown, by_cloud, gradients);
  for (size_t axis = 0; axis < 3; ++axis) {
    double sum = 0;
    for (size_t n = 0; n < grown.size(); ++n) {
      if (tape.slots[n] < 2) sum += static_cast<double>(grown.scales[n * 3 + axis]);
    }
    EXPECT_NEAR(gradients.anchors.log_scales[3 + axis], sum, 1e-5 * sum);
  }
}

TEST(Scaffold, ComesBackFromTensorsBitForBit) {
  const ScaffoldParameters scaffold = livelyScaffold(9, 3, 2);
  const TensorTable table = tensorsOfScaffold(scaffold);
  const ScaffoldShape shape = {3, 2, scaffold.colour_space, scaffold.antialias, 99};
  const ScaffoldParameters seen = scaffoldOfTensors(table, shape);
  EXPECT_EQ(seen.positions, scaffold.positions);
  EXPECT_EQ(seen.features, scaffold.features);
  EXPECT_EQ(seen.log_scales, scaffold.log_scales);
  EXPECT_EQ(seen.offsets, scaffold.offsets);
  EXPECT_EQ(seen.colour.layers().back().weights, scaffold.colour.layers().back().weights);
}

TEST(Scaffold, RefusesTensorsThatDoNotFitTogether) {
  const ScaffoldParameters scaffold = livelyScaffold(9, 3, 2);
  const ScaffoldShape shape = {3, 2, scaffold.colour_space, scaffold.antialias, 0};
  const auto refuses = [&](const std::string& name, std::vector<float> values) {
    TensorTable table = tensorsOfScaffold(scaffold);
    table[name].values = std::move(values);
    try {
      scaffoldOfTensors(table, shape);
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kFormat) << name;
    }
  };
  refuses("scaffold.positions", std::vector<float>(8 * 3));
  refuses("scaffold.features", std::vector<float>(9 * 32 - 1));
  refuses("scaffold.offsets", std::vector<float>(9 * 3 * 3, NAN));
  refuses("scaffold.colour.layer0.biases", std::vector<float>(31));
  TensorTable table = tensorsOfScaffold(scaffold);
  table.erase("scaffold.opacity.layer1.weights");
  EXPECT_THROW(scaffoldOfTensors(table, shape), Error);
}

TEST(Scaffold, KeepsTheAnchorsThatAreListed) {
  ScaffoldParameters scaffold = livelyScaffold(6, 2, 0);
  const ScaffoldParameters before = scaffold;
  keepAnchors(scaffold, {4, 1});
  ASSERT_EQ(scaffold.size(), 2u);
  for (size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(scaffold.positions[axis], before.positions[4 * 3 + axis]);
    EXPECT_EQ(scaffold.positions[3 + axis], before.positions[3 + axis]);
  }
  EXPECT_EQ(scaffold.offsets[0], before.offsets[4 * 6]);
  EXPECT_EQ(scaffold.features[32], before.features[32]);
}

}  // namespace
}  // namespace stipple
