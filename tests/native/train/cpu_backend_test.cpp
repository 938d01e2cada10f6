#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/backward_cases.h"
#include "train/backend/render_backend.h"
#include "train/backend_case.h"

namespace stipple {
namespace {

using testing::camera;
using ::testing::ElementsAre;
using testing::expectEqual;
using testing::fit;
using testing::frontCamera;
using ::testing::HasSubstr;
using testing::kArrays;
using testing::messageOf;
using testing::overGrey;
using testing::pixelCount;
using testing::randomWeights;
using testing::rates;
using testing::smallCloud;
using testing::target;

TEST(CpuBackend, GivesTheBitsOfTheSeparateCalls) {
  const SplatCloud start = smallCloud(60, 2, 600);
  const std::vector<float> wanted = target(601);
  const auto backend = makeCpuBackend();
  backend->upload(start);
  const uint32_t picture = backend->addTarget(camera().width, camera().height, wanted);

  RawSplats raw = rawSplats(start);
  TrainingState expected{raw, zerosLike(raw), zerosLike(raw), {}, 0};
  ImageLoss image_loss;
  for (uint64_t step = 1; step <= 3; ++step) {
    const SplatCloud cloud = activated(raw);
    const SplatInstance instance{&cloud};
    const RenderResult drawn = renderTiled({&instance, 1}, camera(), overGrey());
    std::vector<float> by_picture(drawn.colour.size());
    const ImageLossValue value = image_loss.evaluate(
        camera().width, camera().height, {drawn.colour.data(), PixelLayout::kRgba},
        {wanted.data(), PixelLayout::kRgb}, nullptr, {by_picture.data(), PixelLayout::kRgba});
    std::vector<float> residual(wanted.size());
    for (size_t i = 0; i < residual.size(); ++i) {
      residual[i] = drawn.colour[i / 3 * 4 + i % 3] - wanted[i];
    }
    BackwardInput input;
    input.colour_gradient = by_picture;
    input.residual = residual;
    BackwardResult result = renderBackward({&instance, 1}, camera(), overGrey(), input);
    SplatGradients& by = result.instances[0];
    for (size_t i = 0; i < by.scales.size(); ++i) by.scales[i] *= cloud.scales[i];
    for (size_t i = 0; i < by.opacities.size(); ++i) {
      by.opacities[i] *= cloud.opacities[i] * (1 - cloud.opacities[i]);
    }
    const std::array<double, 6> lr = rates().learning_rates;
    const auto group = [&](RawArray array, std::vector<float>& gradients, size_t offset,
                           size_t length, double rate) {
      return AdamGroup{arrayOf(raw, array).data() + offset,
                       gradients.data() + offset,
                       arrayOf(expected.first_moments, array).data() + offset,
                       arrayOf(expected.second_moments, array).data() + offset,
                       raw.size(),
                       length,
                       rate,
                       rowLength(raw, array)};
    };
    const AdamGroup groups[] = {group(RawArray::kPositions, by.positions, 0, 3, lr[0]),
                                group(RawArray::kRotations, by.rotations, 0, 4, lr[1]),
                                group(RawArray::kLogScales, by.scales, 0, 3, lr[2]),
                                group(RawArray::kLogits, by.opacities, 0, 1, lr[3]),
                                group(RawArray::kSh, by.sh, 0, 3, lr[4]),
                                group(RawArray::kSh, by.sh, 3, 24, lr[5])};
    adamStep(groups, step);

    backend->forward(camera(), overGrey());
    EXPECT_EQ(backend->picture(), drawn.colour);
    EXPECT_EQ(backend->loss(picture, {}).loss, value.loss);
    StatisticRequest request;
    request.contributions = true;
    const BackwardSummary summary = backend->backward(request);
    EXPECT_EQ(summary.camera, result.camera);
    EXPECT_EQ(summary.background, result.background);
    EXPECT_EQ(summary.visible_count, result.visible_count);
    EXPECT_EQ(backend->statistic(Statistic::kContributions), by.contributions);
    EXPECT_EQ(backend->gradients().log_scales, by.scales);
    backend->step(rates());
  }
  const TrainingState seen = backend->state();
  expectEqual(seen.splats, raw);
  expectEqual(seen.first_moments, expected.first_moments);
  expectEqual(seen.second_moments, expected.second_moments);
  EXPECT_EQ(seen.step, 3u);
  EXPECT_NE(seen.splats.sh, start.sh);
}

TEST(CpuBackend, OpacitiesAreWeighedInOneImageAlone) {
  const SplatCloud start = smallCloud(40, 1, 620);
  const auto backend = makeCpuBackend();
  backend->upload(start);
  const SplatCloud whole = backend->download();
  std::vector<float> factors(40, 1.25f);
  for (size_t i = 0; i < factors.size(); i += 3) factors[i] = 0;
  SplatCloud weighed = whole;
  for (size_t i = 0; i < factors.size(); ++i) {
    weighed.opacities[i] = std::min(whole.opacities[i] * factors[i], 1.0f);
  }
  ASSERT_EQ(*std::max_element(weighed.opacities.begin(), weighed.opacities.end()), 1.0f);
  const auto drawn = [](const SplatCloud& cloud) {
    const SplatInstance instance{&cloud};
    return renderTiled({&instance, 1}, camera(), overGrey()).colour;
  };

  backend->weighOpacities(factors);
  backend->forward(camera(), overGrey());
  const std::vector<float> image = backend->picture();
  EXPECT_EQ(image, drawn(weighed));
  EXPECT_NE(image, drawn(whole));
  const std::vector<float> wanted = target(621);
  backend->loss(wanted, {});
  backend->backward({});
  std::vector<float> by_picture(image.size());
  ImageLoss().evaluate(camera().width, camera().height, {image.data(), PixelLayout::kRgba},
                       {wanted.data(), PixelLayout::kRgb}, nullptr,
                       {by_picture.data(), PixelLayout::kRgba});
  BackwardInput input;
  input.colour_gradient = by_picture;
  const SplatInstance instance{&weighed};
  const SplatGradients by =
      renderBackward({&instance, 1}, camera(), overGrey(), input).instances[0];
  const std::vector<float> logits = backend->gradients().logits;
  for (size_t i = 0; i < factors.size(); ++i) {
    const float opacity = whole.opacities[i];
    const float factor = weighed.opacities[i] / opacity;  // less than asked for at an opacity of 1
    EXPECT_FLOAT_EQ(logits[i], by.opacities[i] * factor * (opacity * (1 - opacity))) << i;
    if (factors[i] == 0) {
      EXPECT_EQ(backend->gradients().sh[i * 12], 0) << i;
    }
  }
  EXPECT_EQ(backend->download().opacities, whole.opacities);

  // The next image is whole again, after derivatives and without them.
  for (const bool differentiates : {true, false}) {
    backend->forward(camera(), overGrey());
    EXPECT_EQ(backend->picture(), drawn(whole)) << differentiates;
    backend->weighOpacities(factors);
    backend->forward(camera(), overGrey());
    EXPECT_EQ(backend->picture(), drawn(weighed)) << differentiates;
    if (!differentiates) continue;
    backend->loss(wanted, {});
    backend->backward({});
  }
  backend->forward(camera(), overGrey());
  EXPECT_EQ(backend->picture(), drawn(whole));
}

TEST(CpuBackend, RefusesFactorsThatAreNone) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(3, 1, 620));
  EXPECT_THAT(messageOf([&] { backend->weighOpacities({1, 1}); }), HasSubstr("opacity factors"));
  EXPECT_THAT(messageOf([&] {
                backend->weighOpacities({1, -1, 1});
              }),
              HasSubstr("the opacity factor of splat 1 is -1"));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(messageOf([&] { backend->weighOpacities({1, 1, nan}); }), HasSubstr("splat 2"));
}

TEST(CpuBackend, DerivativesAreThoseByTheRawNumbers) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(40, 1, 610));
  const uint32_t picture = backend->addTarget(camera().width, camera().height, target(611));
  backend->forward(camera(), overGrey());
  backend->loss(picture, {});
  backend->backward({});
  const RawSplats seen = backend->gradients();

  const RawSplats raw = backend->state().splats;
  const SplatCloud cloud = backend->download();
  const SplatInstance instance{&cloud};
  const std::vector<float> drawn = backend->picture();
  const std::vector<float> wanted = target(611);
  std::vector<float> by_picture(drawn.size());
  ImageLoss().evaluate(camera().width, camera().height, {drawn.data(), PixelLayout::kRgba},
                       {wanted.data(), PixelLayout::kRgb}, nullptr,
                       {by_picture.data(), PixelLayout::kRgba});
  BackwardInput input;
  input.colour_gradient = by_picture;
  const SplatGradients stored =
      renderBackward({&instance, 1}, camera(), overGrey(), input).instances[0];
  // Derivatives of the activations by differences: a step of 0.01 leaves 2e-5 of the third order
  // and, of float32, 6e-8 of the value over it.
  const auto judge = [](const std::vector<float>& by_raw, const std::vector<float>& by_stored,
                        const std::vector<float>& at, float (*activate)(float)) {
    for (size_t i = 0; i < at.size(); ++i) {
      const double up = static_cast<double>(activate(at[i] + 0.01f));
      const double slope = (up - static_cast<double>(activate(at[i] - 0.01f))) / 0.02;
      const double expected = slope * static_cast<double>(by_stored[i]);
      EXPECT_NEAR(static_cast<double>(by_raw[i]), expected, 1e-3 * std::abs(expected) + 1e-12);
    }
  };
  judge(seen.log_scales, stored.scales, raw.log_scales, activatedScale);
  judge(seen.logits, stored.opacities, raw.logits, activatedOpacity);
  EXPECT_EQ(seen.positions, stored.positions);
  EXPECT_EQ(seen.rotations, stored.rotations);
  EXPECT_EQ(seen.sh, stored.sh);
  EXPECT_NE(seen.logits, std::vector<float>(40, 0.0f));
}

TEST(CpuBackend, ALittleFitLowersTheLoss) {
  const SplatCloud truth = smallCloud(40, 1, 620);
  const SplatInstance instance{&truth};
  const RenderResult drawn = renderTiled({&instance, 1}, camera(), overGrey());
  std::vector<float> wanted(pixelCount(camera()) * 3);
  for (size_t i = 0; i < wanted.size(); ++i) wanted[i] = drawn.colour[i / 3 * 4 + i % 3];
  SplatCloud start = truth;
  std::fill(start.sh.begin(), start.sh.end(), 0.0f);
  for (size_t i = 0; i < start.positions.size(); ++i) start.positions[i] += i % 2 ? 0.03f : -0.03f;
  const auto backend = makeCpuBackend();
  backend->upload(start);
  const uint32_t picture = backend->addTarget(camera().width, camera().height, wanted);
  StepOptions options = rates();
  for (double& rate : options.learning_rates) rate *= 4;
  const double before = fit(*backend, picture, {}, options);
  double after = before;
  for (int step = 0; step < 80; ++step) after = fit(*backend, picture, {}, options);
  EXPECT_LT(after, 0.25 * before);
  EXPECT_EQ(backend->state().step, 81u);
}

TEST(CpuBackend, GivesTheSameBitsForAnyNumberOfThreads) {
  TrainingState states[2];
  for (const unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] {
      const auto backend = makeCpuBackend();
      backend->upload(smallCloud(3000, 1, 630));
      const uint32_t picture = backend->addTarget(camera().width, camera().height, target(631));
      for (int step = 0; step < 3; ++step) fit(*backend, picture);
      states[threads - 1] = backend->state();
    });
  }
  expectEqual(states[0].splats, states[1].splats);
  expectEqual(states[0].second_moments, states[1].second_moments);
}

TEST(CpuBackend, EditsMoveParametersAndMomentsTogether) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(10, 1, 640));
  const uint32_t picture = backend->addTarget(camera().width, camera().height, target(641));
  for (int step = 0; step < 2; ++step) fit(*backend, picture);
  const TrainingState before = backend->state();

  SplatEdit edit;
  edit.writes.push_back({RawArray::kLogits, {3, 7}, {-4.0f, -5.0f}, true});
  edit.writes.push_back({RawArray::kLogScales, {7}, {0.1f, 0.2f, 0.3f}, false});
  edit.keep = std::vector<uint32_t>{9, 7, 7, 0};
  edit.append = rawSplats(smallCloud(2, 1, 642));
  backend->edit(edit);
  ASSERT_EQ(backend->splatCount(), 6u);
  const TrainingState after = backend->state();
  EXPECT_EQ(after.step, before.step);
  for (const RawArray array : kArrays) {
    const size_t length = rowLength(before.splats, array);
    const auto row = [&](const RawSplats& splats, size_t i) {
      const float* begin = arrayOf(splats, array).data() + i * length;
      return std::vector<float>(begin, begin + length);
    };
    EXPECT_EQ(row(after.splats, 0), row(before.splats, 9));
    EXPECT_EQ(row(after.splats, 3), row(before.splats, 0));
    EXPECT_EQ(row(after.splats, 1), row(after.splats, 2));
    EXPECT_EQ(row(after.splats, 4), row(edit.append, 0));
    EXPECT_EQ(row(after.splats, 5), row(edit.append, 1));
    for (RawSplats TrainingState::*moments :
         {&TrainingState::first_moments, &TrainingState::second_moments}) {
      EXPECT_EQ(row(after.*moments, 0), row(before.*moments, 9));
      EXPECT_EQ(row(after.*moments, 4), std::vector<float>(length, 0.0f));
      if (array == RawArray::kLogits) {
        EXPECT_THAT(row(after.*moments, 1), ElementsAre(0.0f));
      } else {
        EXPECT_EQ(row(after.*moments, 1), row(before.*moments, 7));
        EXPECT_NE(row(after.*moments, 1), std::vector<float>(length, 0.0f));
      }
    }
    if (array == RawArray::kLogits) {
      EXPECT_THAT(row(after.splats, 1), ElementsAre(-5.0f));
    } else if (array == RawArray::kLogScales) {
      EXPECT_THAT(row(after.splats, 1), ElementsAre(0.1f, 0.2f, 0.3f));
    } else {
      EXPECT_EQ(row(after.splats, 1), row(before.splats, 7));
    }
  }
  fit(*backend, picture);  // and training goes on
  EXPECT_EQ(backend->state().step, 3u);

  SplatEdit nothing_left;
  nothing_left.keep = std::vector<uint32_t>{};
  backend->edit(nothing_left);
  EXPECT_EQ(backend->splatCount(), 0u);
  fit(*backend, picture);
  EXPECT_EQ(backend->download().size(), 0u);
}

TEST(CpuBackend, RefusesEditsThatDoNotFitAndChangesNothing) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(10, 1, 650));
  const TrainingState before = backend->state();
  const auto refused = [&](const SplatEdit& edit, const char* part) {
    EXPECT_THAT(messageOf([&] { backend->edit(edit); }), HasSubstr(part));
    expectEqual(backend->state().splats, before.splats);
  };
  SplatEdit good;
  good.writes.push_back({RawArray::kLogits, {1}, {0.5f}, true});
  SplatEdit edit = good;
  edit.writes.push_back({RawArray::kPositions, {10}, {0, 0, 0}, false});
  refused(edit, "write 1 names splat 10; there are 10");
  edit = good;
  edit.writes.push_back({RawArray::kPositions, {4, 4}, {0, 0, 0, 0, 0, 0}, false});
  refused(edit, "write 1 names splat 4 twice; once is allowed");
  edit = good;
  edit.writes.push_back({RawArray::kRotations, {4}, {0, 0, 0}, false});
  refused(edit, "write 1 holds 3 values; 4 are needed");
  edit = good;
  edit.writes[0].values[0] = std::numeric_limits<float>::quiet_NaN();
  refused(edit, "write 0: row 0 holds nan");
  edit = good;
  edit.keep = std::vector<uint32_t>{0, 11};
  refused(edit, "keep names splat 11; there are 10");
  edit = good;
  edit.append = rawSplats(smallCloud(2, 2, 651));
  refused(edit, "append has harmonics of degree 2; the splats have 1");
  edit.append = rawSplats(smallCloud(2, 1, 651));
  edit.append.rotations.pop_back();
  refused(edit, "append.rotations holds 7 values; 8 are needed");
}

TEST(CpuBackend, RefusesPassesOutOfOrderAndPicturesThatDoNotFit) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(10, 0, 660));
  EXPECT_THAT(messageOf([&] { backend->addTarget(0, 0, {}); }), HasSubstr("0 x 0 pixels"));
  const std::vector<float> pixels(6 * 4 * 3, 0.5f);
  EXPECT_THAT(messageOf([&] { backend->addTarget(6, 5, pixels); }),
              HasSubstr("the target holds 72 values; 90 are needed"));
  const uint32_t small = backend->addTarget(6, 4, pixels);
  const uint32_t picture = backend->addTarget(camera().width, camera().height, target(661));
  EXPECT_THAT(messageOf([&] { backend->picture(); }), HasSubstr("call forward first"));
  EXPECT_THAT(messageOf([&] { backend->loss(picture, {}); }), HasSubstr("call forward first"));
  EXPECT_THAT(messageOf([&] { backend->backward({}); }), HasSubstr("call loss first"));
  EXPECT_THAT(messageOf([&] { backend->step(rates()); }), HasSubstr("call backward first"));
  backend->forward(camera(), overGrey());
  EXPECT_THAT(messageOf([&] { backend->loss(2, {}); }), HasSubstr("target is 2; there are 2"));
  EXPECT_THAT(messageOf([&] { backend->loss(small, {}); }),
              HasSubstr("target 0 is 6 x 4 pixels; the image is 47 x 35"));
  EXPECT_THAT(messageOf([&] { backend->backward({}); }), HasSubstr("call loss first"));
  backend->loss(picture, {});
  StatisticRequest request;
  const std::vector<float> few(3, 1.0f);
  request.errors = few;
  EXPECT_THAT(messageOf([&] { backend->backward(request); }), HasSubstr("errors holds 3 values"));
  backend->backward({});
  EXPECT_THAT(messageOf([&] { backend->statistic(Statistic::kErrors); }),
              HasSubstr("errors were not asked for"));
  StepOptions bad = rates();
  bad.learning_rates[2] = -1;
  const TrainingState before = backend->state();
  EXPECT_THAT(messageOf([&] { backend->step(bad); }), HasSubstr("learning_rate is -1"));
  expectEqual(backend->state().splats, before.splats);
  backend->step(rates());
  EXPECT_THAT(messageOf([&] { backend->step(rates()); }), HasSubstr("call backward first"));

  TrainingState broken = backend->state();
  broken.second_moments.logits.pop_back();
  EXPECT_THAT(messageOf([&] { backend->restore(broken); }), HasSubstr("holds "));
  SplatCloud cloud = smallCloud(3, 0, 662);
  cloud.scales[2] = std::numeric_limits<float>::infinity();
  EXPECT_THAT(messageOf([&] { backend->upload(cloud); }), HasSubstr("scale of splat 0"));
  EXPECT_EQ(backend->splatCount(), 10u);
}

TEST(CpuBackend, GoesOnFromAStateAsIfNothingHadHappened) {
  const auto first = makeCpuBackend(), second = makeCpuBackend();
  first->upload(smallCloud(30, 1, 670));
  const std::vector<float> wanted = target(671);
  for (RenderBackend* backend : {first.get(), second.get()}) {
    backend->addTarget(camera().width, camera().height, wanted);
  }
  fit(*first, 0);
  second->restore(first->state());
  for (RenderBackend* backend : {first.get(), second.get()}) fit(*backend, 0);
  expectEqual(first->state().splats, second->state().splats);
  expectEqual(first->state().first_moments, second->state().first_moments);
  EXPECT_EQ(second->state().step, 2u);
}

TEST(CpuBackend, AStepTakesTheDerivativesThatWereKept) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(30, 1, 690));
  const std::vector<float> wanted = target(691);
  const auto pass = [&](RenderBackend& fit) {
    fit.forward(camera(), overGrey());
    fit.loss(wanted, {});
    fit.backward({});
  };
  pass(*backend);
  const RawSplats once = backend->gradients();
  backend->keepGradients();
  EXPECT_THAT(messageOf([&] { backend->keepGradients(); }), HasSubstr("call backward first"));
  // What was kept goes on with a checkpoint, and moves with the splats.
  const auto other = makeCpuBackend();
  other->restore(backend->state());
  SplatEdit edit;
  edit.keep = std::vector<uint32_t>{4, 9, 2};
  edit.append = rawSplats(smallCloud(1, 1, 692));
  other->edit(edit);
  const RawSplats& moved = other->state().kept_gradients;
  ASSERT_EQ(moved.size(), 4u);
  EXPECT_EQ(moved.logits[1], once.logits[9]);
  EXPECT_EQ(moved.positions[2 * 3], once.positions[2 * 3]);
  EXPECT_EQ(moved.positions[3 * 3], 0.0f);

  pass(*backend);
  backend->step(rates());
  EXPECT_EQ(backend->state().kept_gradients.size(), 0u);
  EXPECT_EQ(backend->state().step, 1u);
  // Adam's first moment is a tenth of the sum, which is twice one pass: nothing moved in between.
  for (size_t i = 0; i < once.positions.size(); ++i) {
    EXPECT_NEAR(backend->state().first_moments.positions[i], 0.2f * once.positions[i],
                1e-6f * std::abs(once.positions[i]));
  }
}

TEST(CpuBackend, LendsWhatAPassGathered) {
  const auto backend = makeCpuBackend();
  SplatCloud cloud = smallCloud(40, 0, 720);
  cloud.positions[5 * 3] = 1e4f;  // out of view
  cloud.opacities[7] = 1e-3f;     // below 1/255
  backend->upload(cloud);
  const std::vector<float> wanted = target(721);
  ViewStatistics statistics;
  EXPECT_THAT(messageOf([&] { backend->lendStatistics(statistics); }), HasSubstr("backward first"));
  backend->forward(camera(), overGrey());
  const double loss = backend->loss(wanted, {}).loss;
  StatisticRequest request;
  request.screen_gradients = true;
  const BackwardSummary summary = backend->backward(request);
  statistics.view = 4;
  backend->lendStatistics(statistics);
  EXPECT_TRUE(statistics.splats.positions.empty());  // nobody asked
  EXPECT_EQ(statistics.view, 4u);
  EXPECT_EQ(statistics.loss, loss);
  EXPECT_EQ(statistics.camera, &camera());
  EXPECT_EQ(statistics.width, camera().width);
  EXPECT_EQ(statistics.height, camera().height);
  EXPECT_TRUE(statistics.errors.structure.empty());
  request.error_maps = true;
  EXPECT_THAT(messageOf([&] { backend->backward(request); }),
              HasSubstr("the loss's error map holds 0 values"));
  request.error_maps = false;
  request.drawn_splats = true;
  backend->backward(request);
  backend->lendStatistics(statistics);
  EXPECT_TRUE(std::equal(statistics.splats.positions.begin(), statistics.splats.positions.end(),
                         cloud.positions.begin(), cloud.positions.end()));
  EXPECT_EQ(statistics.splats.scales.size(), 120u);
  EXPECT_EQ(statistics.splats.opacities.size(), 40u);
  ASSERT_EQ(statistics.visible.size(), 40u);
  EXPECT_EQ(statistics.visible[5], 0);
  EXPECT_EQ(statistics.visible[7], 0);
  uint64_t count = 0;
  for (const uint8_t flag : statistics.visible) count += flag;
  EXPECT_EQ(count, summary.visible_count);
  const std::vector<float> expected = backend->statistic(Statistic::kScreenGradients);
  const std::span<const float> seen = statistics.of(Statistic::kScreenGradients);
  EXPECT_EQ(std::vector<float>(seen.begin(), seen.end()), expected);
  EXPECT_TRUE(statistics.of(Statistic::kAbsoluteScreenGradients).empty());
  EXPECT_TRUE(statistics.of(Statistic::kContributions).empty());
}

TEST(CpuBackend, LendsTheErrorsOfItsLastPicture) {
  const auto backend = makeCpuBackend();
  backend->upload(smallCloud(40, 0, 720));
  std::vector<float> wanted = target(721);
  StatisticRequest request;
  request.error_maps = true;
  backend->forward(camera(), overGrey());
  const ImageLossValue value = backend->loss(wanted, lossFor(request, 0.2));
  backend->backward(request);
  ViewStatistics statistics;
  backend->lendStatistics(statistics);
  ViewErrors errors = statistics.errors;
  EXPECT_EQ(errors.target.data(), wanted.data());
  EXPECT_TRUE(errors.weights.empty());
  const size_t pixels = wanted.size() / 3;
  ASSERT_EQ(errors.structure.size(), pixels);
  double structure = 0, difference = 0;
  for (size_t p = 0; p < pixels; ++p) {
    structure += static_cast<double>(errors.structure[p]) / static_cast<double>(pixels);
    difference += errors.differenceAt(p) / static_cast<double>(pixels);
  }
  // Their means are those of the loss, which sums in another order.
  EXPECT_NEAR(structure, 1 - value.ssim, 1e-6);
  EXPECT_NEAR(difference, value.l1, 1e-6);
  const std::vector<float> half(pixels, 0.5f);
  errors.weights = half;
  const double whole = errors.differenceAt(7) * 2;
  errors.weights = {};
  EXPECT_DOUBLE_EQ(errors.differenceAt(7), whole);
}

TEST(CpuBackend, AGroupWithoutARateStaysAsItIs) {
  const auto backend = makeCpuBackend();
  const SplatCloud start = smallCloud(20, 2, 680);
  backend->upload(start);
  const uint32_t picture = backend->addTarget(camera().width, camera().height, target(681));
  StepOptions colours_only;
  colours_only.learning_rates[static_cast<size_t>(ParameterGroup::kShOthers)] = 1e-2;
  fit(*backend, picture, {}, colours_only);
  const TrainingState state = backend->state();
  EXPECT_EQ(state.splats.positions, start.positions);
  EXPECT_EQ(state.first_moments.positions, std::vector<float>(60, 0.0f));
  for (size_t i = 0; i < start.sh.size(); i += 27) {
    EXPECT_EQ(state.splats.sh[i + 2], start.sh[i + 2]);
    EXPECT_NE(state.splats.sh[i + 3], start.sh[i + 3]);
    EXPECT_NE(state.splats.sh[i + 26], start.sh[i + 26]);
  }
}

}  // namespace
}  // namespace stipple
