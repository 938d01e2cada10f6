#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "decode/field/field_decoder.h"
#include "density/learned_density.h"
#include "train/loop/field_model.h"
#include "train/toy_views.h"

namespace stipple {
namespace {

void expectFinite(const SplatCloud& cloud) {
  EXPECT_NO_THROW(validate(cloud, "cloud"));
}

void expectFinite(const std::vector<FeatureGradient>& levels) {
  for (const FeatureGradient& level : levels) {
    for (const float value : level.values) EXPECT_TRUE(std::isfinite(value));
  }
}

/// Every derivative that a backward pass leaves: grids, details and all layers.
void expectFinite(const FieldGradients& gradients) {
  EXPECT_FALSE(gradients.network.empty());
  for (const LinearLayer& layer : gradients.network) {
    for (const float value : layer.weights) EXPECT_TRUE(std::isfinite(value));
    for (const float value : layer.biases) EXPECT_TRUE(std::isfinite(value));
  }
  expectFinite(gradients.features);
  expectFinite(gradients.details);
}

TEST(FieldStability, LogitsAtTheirEnds) {
  std::vector<LearnedLevel> levels(4);
  for (size_t l = 0; l < levels.size(); ++l) {
    levels[l] = {{0}, {60, -60, 60, -60, 0, 0, 0, -60}, std::vector<float>(8, 1e-30f)};
  }
  LearnedDensity density({{0, 0, 0}, 1.0}, levels);
  AnchorSamplingOptions options;
  options.count = 5000;
  const AnchorSet anchors = sampleAnchors(density, options);
  std::vector<double> g(anchors.size(), -1e-300);
  g[0] = 1e15;
  for (const auto& level : density.logDensityGradient(anchors, g).levels) {
    for (const double value : level.values) EXPECT_TRUE(std::isfinite(value));
  }
  DensityGradient gradient;
  EXPECT_TRUE(std::isfinite(density.structuralLoss(1.0, &gradient)));
  EXPECT_TRUE(std::isfinite(density.entropy()));
  const std::vector<uint32_t> rows = {0};
  density.setLogits(0, rows, std::vector<float>(8, 1e30f));
  EXPECT_EQ(sampleAnchors(density, options).size(), 5000u);
  EXPECT_GE(density.frozen().leafCount(), 1u);
}

TEST(FieldStability, OneAnchorAndManyInOneLeaf) {
  FieldShape shape;
  shape.leaf_level = 10;
  shape.layout = {32, 3};
  shape.least_anchors = shape.most_anchors = 1;
  const FieldDecoder decoder(std::make_shared<FieldParameters>(makeFieldParameters(shape)));
  for (const size_t count : {1u, 2u, 7u, 1000u}) {
    AnchorSet anchors;
    anchors.leaf_level = 10;
    anchors.positions.assign(count * 3, 1.0f - 0x1.0p-24f);  // the last place of the cube
    anchors.log_q.assign(count, 0.0f);
    anchors.leaves.assign(count, (uint64_t{1} << 30) - 1);
    FieldTape tape;
    SplatCloud cloud;
    decoder.forward(anchors, tape, cloud);
    expectFinite(cloud);
    SplatCloud gradient = cloud;
    FieldGradients gradients;
    decoder.backward(anchors, tape, cloud, gradient, gradients);
    expectFinite(gradients);
  }
}

TEST(FieldStability, NetworksThatHaveRunAway) {
  FieldShape shape;
  for (const float size : {1e3f, -1e3f, 1e6f}) {
    FieldParameters field = makeFieldParameters(shape);
    for (float& bias : field.network.layers().back().biases) bias = size;
    AnchorSet anchors;
    anchors.leaf_level = 8;
    anchors.positions = {0.5f, 0.5f, 0.5f, 0.25f, 0.5f, 0.5f};
    anchors.log_q = {0, 0};
    anchors.leaves = {0, 1};
    FieldTape tape;
    SplatCloud cloud;
    const FieldDecoder decoder(std::make_shared<FieldParameters>(field));
    decoder.forward(anchors, tape, cloud);
    expectFinite(cloud);
    SplatCloud gradient = cloud;
    FieldGradients gradients;
    decoder.backward(anchors, tape, cloud, gradient, gradients);
    expectFinite(gradients);
  }
}

TEST(FieldStability, EmptyViewsOnePointAndBudgetsFarAboveTheLeaves) {
  auto views = toyViews(SplatCloud(), 3, 16, false);
  views->setPoints(toyPoints(toyBall(1)));
  const std::vector<size_t> training = {0, 1, 2};
  FieldModelOptions options;
  options.leaf_level = 2;
  options.least_anchors = 1;
  options.most_anchors = 3000;
  options.gaussians_per_anchor = 4;
  const auto model = makeFieldModel(*cpuBackends(), *views, training, options);
  for (uint64_t i = 1; i <= 30; ++i) {
    FitMoment moment;
    moment.iteration = i;
    moment.iterations = 30;
    StepView view;
    view.camera = &views->camera(i % 3);
    view.background[1] = i % 2 == 0 ? 1.0 : 0.0;
    std::vector<float> target(16 * 16 * 3, 0.0f);
    for (size_t p = 1; p < target.size(); p += 3) {
      target[p] = static_cast<float>(view.background[1]);
    }
    view.target = target.data();
    EXPECT_TRUE(std::isfinite(model->step(moment, view, nullptr, nullptr).loss));
  }
  expectFinite(model->splats(1));
  expectFinite(model->splats(20000));
}

}  // namespace
}  // namespace stipple
