#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "train/backend/render_backend.h"
#include "train/backend_case.h"

// What the backend adds to the loss of a picture, and parameters of another kind.

namespace stipple {
namespace {

using testing::camera;
using ::testing::ElementsAre;
using testing::expectEqual;
using ::testing::HasSubstr;
using testing::messageOf;
using testing::overGrey;
using testing::pixelCount;
using testing::rates;
using testing::smallCloud;
using testing::target;

/// Half the sum of squares of the scales, and a sum of opacities.
class SmallScales final : public Regulariser {
 public:
  double evaluate(const SplatCloud& cloud, const CloudGradient& gradient) override {
    double sum = 0;
    for (size_t i = 0; i < cloud.scales.size(); ++i) {
      gradient.scales[i] += cloud.scales[i];
      sum += 0.5 * static_cast<double>(cloud.scales[i] * cloud.scales[i]);
    }
    for (size_t i = 0; i < cloud.size(); ++i) {
      gradient.opacities[i] += 1;
      sum += static_cast<double>(cloud.opacities[i]);
    }
    EXPECT_EQ(cloud.positions.size(), 3 * cloud.size());
    return sum;
  }
};

TEST(CpuBackend, RegularisersActThroughTheActivations) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(30, 1, 700));
  const std::vector<float> wanted = target(701);
  backend->forward(camera(), overGrey());
  backend->loss(wanted, {});
  EXPECT_EQ(backend->backward({}).regularisation, 0);
  const RawSplats without = backend->gradients();
  SmallScales regulariser;
  const double value = backend->backward({}, &regulariser).regularisation;
  const RawSplats with = backend->gradients();
  const SplatCloud cloud = backend->download();
  double expected = 0;
  for (size_t i = 0; i < cloud.scales.size(); ++i) {
    const float s = cloud.scales[i];
    expected += 0.5 * static_cast<double>(s * s);
    EXPECT_NEAR(with.log_scales[i] - without.log_scales[i], s * s, 1e-5f * s * s + 1e-7f);
  }
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float o = cloud.opacities[i];
    expected += static_cast<double>(o);
    EXPECT_NEAR(with.logits[i] - without.logits[i], o * (1 - o), 1e-6f);
  }
  EXPECT_NEAR(value, expected, 1e-6 * expected);
  EXPECT_EQ(with.positions, without.positions);
}

/// Some of the light that passes all splats.
class Light final : public Regulariser {
 public:
  double evaluate(const SplatCloud&, const CloudGradient&) override { return 0; }
  double transmittanceWeight() const override { return 3; }
};

TEST(CpuBackend, TheLossHasTheMeanTransmittanceAndItsDerivative) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(30, 1, 740));
  RenderOptions options = overGrey();
  const std::vector<float> wanted = target(741);
  Light light;
  backend->forward(camera(), options);
  backend->loss(wanted, {});
  EXPECT_THAT(messageOf([&] { backend->backward({}, &light); }), HasSubstr("drawn with it"));
  options.with_transmittance = true;
  const auto regularisation = [&](RenderBackend& of) {
    of.forward(camera(), options);
    of.loss(wanted, {});
    return of.backward({}, &light).regularisation;
  };
  const double value = regularisation(*backend);
  EXPECT_GT(value, 0.1);
  EXPECT_LT(value, 2.9);
  const RawSplats with = backend->gradients();
  backend->backward({});
  const RawSplats without = backend->gradients();

  // Every third logit by central differences. A step of 2^-5 leaves 1e-4 of the slope; means of
  // float32 transmittances are off by 6e-8, over the step 2e-6. The end of a splat at alpha = 1/255
  // is taken as fixed, but moves with its opacity o: a share (1/255) / (o - 1/255) of the slope
  // in the mean; with few pixels at its end up to three times that.
  const TrainingState start = backend->state();
  double largest = 0;
  for (size_t i = 0; i < start.splats.size(); i += 3) {
    double values[2];
    for (int side = 0; side < 2; ++side) {
      TrainingState moved = start;
      moved.splats.logits[i] += side == 0 ? 0.03125f : -0.03125f;
      const auto other = makeCpuBackend();
      other->restore(moved);
      values[side] = regularisation(*other);
    }
    const double expected = (values[0] - values[1]) / 0.0625;
    largest = std::max(largest, std::abs(expected));
    const double opacity = static_cast<double>(activatedOpacity(start.splats.logits[i]));
    const double share = 3.0 / 255 / (opacity - 1.0 / 255);
    EXPECT_NEAR(with.logits[i] - without.logits[i], expected, share * std::abs(expected) + 1e-5);
  }
  EXPECT_GT(largest, 1e-3);
}

TEST(CpuBackend, StructureErrorsAreThoseOfTheLoss) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(40, 0, 750));
  const std::vector<float> wanted = target(751);
  StatisticRequest request;
  request.structure_errors = true;
  EXPECT_TRUE(request.any());
  backend->forward(camera(), overGrey());
  backend->loss(wanted, {});
  EXPECT_THAT(messageOf([&] { backend->backward(request); }), HasSubstr("with structure errors"));
  ImageLossOptions options;
  options.with_structure_errors = true;
  backend->loss(wanted, options);
  backend->backward(request);
  const std::vector<float> seen = backend->statistic(Statistic::kErrors);

  const std::vector<float> drawn = backend->picture();
  ImageLoss loss;
  loss.evaluate(camera().width, camera().height, {drawn.data(), PixelLayout::kRgba},
                {wanted.data(), PixelLayout::kRgb}, nullptr, {}, options);
  const std::span<const float> errors = loss.structureErrors();
  StatisticRequest by_hand;
  by_hand.errors.assign(errors.begin(), errors.end());
  backend->backward(by_hand);
  EXPECT_EQ(backend->statistic(Statistic::kErrors), seen);
  EXPECT_GT(*std::max_element(seen.begin(), seen.end()), 0.1f);
  by_hand.structure_errors = true;
  EXPECT_THAT(messageOf([&] { backend->backward(by_hand); }), HasSubstr("one of them is allowed"));
}

/// Positions that are moved by three extra numbers per splat, doubled.
class Moved final : public Parameterisation {
 public:
  void activate(const RawSplats& raw, SplatCloud& cloud) const override {
    for (size_t i = 0; i < cloud.positions.size(); ++i) cloud.positions[i] += 2 * raw.extras[0][i];
  }
  void adjoint(const RawSplats&, const SplatCloud&, const CloudGradient& by_cloud,
               RawSplats& by_raw) const override {
    for (size_t i = 0; i < by_cloud.positions.size(); ++i) {
      by_raw.extras[0][i] = 2 * by_cloud.positions[i];
    }
  }
};

TEST(CpuBackend, ExtraParametersAreTrainedThroughTheirParameterisation) {
  const SplatCloud start = smallCloud(30, 1, 710);
  const std::vector<float> wanted = target(711);
  const auto plain = makeCpuBackend(), backend = makeCpuBackend();
  SplatCloud moved_start = start;
  TrainingState state;
  {
    plain->upload(start);
    state = plain->state();
  }
  for (RawSplats* splats : {&state.splats, &state.first_moments, &state.second_moments}) {
    splats->extra_lengths = {3};
    splats->extras = {std::vector<float>(90, 0.0f)};
  }
  for (size_t i = 0; i < 90; ++i) {
    state.splats.extras[0][i] = i % 2 ? 0.01f : -0.02f;
    moved_start.positions[i] += 2 * state.splats.extras[0][i];
  }
  const Moved how;
  backend->parameterise(&how);
  backend->restore(state);
  plain->upload(moved_start);
  for (RenderBackend* fit : {plain.get(), backend.get()}) {
    fit->forward(camera(), overGrey());
    fit->loss(wanted, {});
    fit->backward({});
  }
  EXPECT_EQ(backend->picture(), plain->picture());
  EXPECT_EQ(backend->download().positions, moved_start.positions);
  const RawSplats seen = backend->gradients();
  const RawSplats expected = plain->gradients();
  expectEqual(seen, expected);
  for (size_t i = 0; i < 90; ++i) EXPECT_EQ(seen.extras[0][i], 2 * expected.positions[i]);
  StepOptions options = rates();
  options.extra_rates = {1e-3};
  backend->step(options);
  for (size_t i = 0; i < 90; ++i) {
    // The first step of Adam has the size of the rate, against the sign of the derivative.
    const float by = expected.positions[i];
    const float step = by == 0 ? 0.0f : by > 0 ? -1e-3f : 1e-3f;
    EXPECT_NEAR(backend->state().splats.extras[0][i], state.splats.extras[0][i] + step, 1e-6f);
  }

  SplatEdit edit;
  edit.writes.push_back({extraArray(0), {1}, {7, 8, 9}, true});
  edit.keep = std::vector<uint32_t>{0, 1, 5};
  edit.append = rawSplats(smallCloud(1, 1, 712));
  EXPECT_THAT(messageOf([&] { backend->edit(edit); }), HasSubstr("append has 0 extra parameters"));
  edit.append.extra_lengths = {3};
  edit.append.extras = {{4, 5, 6}};
  const TrainingState before = backend->state();
  backend->edit(edit);
  const RawSplats& after = backend->state().splats;
  EXPECT_THAT(std::vector<float>(after.extras[0].begin() + 3, after.extras[0].begin() + 6),
              ElementsAre(7, 8, 9));
  EXPECT_THAT(std::vector<float>(after.extras[0].begin() + 9, after.extras[0].end()),
              ElementsAre(4, 5, 6));
  EXPECT_EQ(after.extras[0][6], before.splats.extras[0][15]);
  const RawSplats& moments = backend->state().first_moments;
  EXPECT_EQ(moments.extras[0][3], 0.0f);
  EXPECT_EQ(moments.extras[0][6], before.first_moments.extras[0][15]);
  EXPECT_NE(moments.extras[0][6], 0.0f);
  EXPECT_EQ(moments.extras[0].size(), 12u);
}

}  // namespace
}  // namespace stipple
