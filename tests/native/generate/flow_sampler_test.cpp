#include "generate/flow_sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "flow_golden.h"

namespace stipple {
namespace {

using testing::expectLatentsNear;
using testing::expectSameLatents;
using testing::flowCondition;
using testing::flowGolden;
using testing::pipelineCondition;
using testing::pipelineGolden;

/// What four steps with guidance make of 5e-5 in a call.
constexpr float kSampleTolerance = 2e-4f;

const FlowNetwork& network() {
  static const FlowNetwork& network = *new FlowNetwork(flowGolden().weights());
  return network;
}
const FlowContext& context() {
  static const FlowContext& context = *new FlowContext(network().context({}, flowCondition()));
  return context;
}

GenerationNoise noiseOf(const Latent& latent) {
  GenerationNoise noise;
  noise.tokens = latent.tokens;
  noise.camera.assign(latent.camera.begin(), latent.camera.end());
  return noise;
}
SamplerState start(const FlowSettings& settings) {
  return startSampling(network(), 64, noiseOf(flowGolden().latent("input")), settings);
}
constexpr FlowSettings kFourSteps = {.steps = 4, .guidance = 3, .shift = 3};

Latent sampled(const FlowSettings& settings) {
  SamplerState state = start(settings);
  sampleLatent({}, network(), context(), state);
  return state.latent;
}

ErrorCode codeOf(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.code();
  }
  ADD_FAILURE() << "no error";
  return ErrorCode::kInternal;
}

TEST(FlowTimes, SpendMoreStepsWhereThereIsNoise) {
  const std::vector<double> times = flowTimes({});
  ASSERT_EQ(times.size(), 21u);
  EXPECT_EQ(times[0], 1);
  EXPECT_NEAR(times[1], 0.98276, 5e-6);  // 2.85 / 2.9, printed with five digits
  EXPECT_NEAR(times[10], 0.75, 1e-15);
  EXPECT_EQ(times[20], 0);
  const std::vector<double> four = flowTimes(kFourSteps);
  const std::vector<float> recorded = pipelineGolden().floats("expect.model_times");
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_FLOAT_EQ(static_cast<float>(1000 * four[i]), recorded[i]);
  }
}

TEST(FlowTimes, AreEvenWithoutAShift) {
  const std::vector<double> times = flowTimes({.steps = 8, .shift = 1});
  for (size_t i = 0; i <= 8; ++i) EXPECT_DOUBLE_EQ(times[i], 1 - static_cast<double>(i) / 8);
}

TEST(FlowSampler, GivesTheRecordedLatents) {
  expectLatentsNear(sampled(kFourSteps), flowGolden().latent("expect.sample"), kSampleTolerance);

  const FlowNetwork half(pipelineGolden().weights());
  SamplerState state =
      startSampling(half, 64, noiseOf(pipelineGolden().latent("input")), kFourSteps);
  sampleLatent({}, half, half.context({}, pipelineCondition()), state);
  expectLatentsNear(state.latent, pipelineGolden().latent("expect.sample"), kSampleTolerance);
}

TEST(FlowSampler, FollowsTheVelocityAloneWithoutGuidance) {
  const FlowSettings settings = {.steps = 3, .guidance = 1, .shift = 2};
  const std::vector<double> times = flowTimes(settings);
  Latent x = flowGolden().latent("input");
  for (size_t step = 0; step < 3; ++step) {
    Latent velocity;
    network().velocity({}, x, times[step], context(), velocity);
    const auto amount = static_cast<float>(times[step] - times[step + 1]);
    for (size_t i = 0; i < x.tokens.size(); ++i) x.tokens[i] -= velocity.tokens[i] * amount;
    for (size_t i = 0; i < kCameraWidth; ++i) x.camera[i] -= velocity.camera[i] * amount;
  }
  expectSameLatents(sampled(settings), x);
  FlowSettings none = settings;
  none.guidance = 0;
  expectSameLatents(sampled(none), x);
}

TEST(FlowSampler, GivesTheSameBitsForAnyNumberOfThreads) {
  Latent one, three;
  withThreads(1, [&] { one = sampled(kFourSteps); });
  withThreads(3, [&] { three = sampled(kFourSteps); });
  expectSameLatents(one, three);
}

TEST(FlowSampler, ContinuesWhereItWasCancelledToTheSameBits) {
  const Latent whole = sampled(kFourSteps);
  for (uint32_t stop = 1; stop < 4; ++stop) {
    SamplerState state = start(kFourSteps);
    Progress progress;
    const FlowListener cancels = {[&](const FlowPreview& preview) {
                                    if (preview.step == stop) progress.cancel();
                                  },
                                  1};
    EXPECT_EQ(codeOf([&] {
                sampleLatent({.progress = &progress}, network(), context(), state, cancels);
              }),
              ErrorCode::kCancelled);
    EXPECT_EQ(state.step, stop);
    SamplerState kept = samplerOfTensors(tensorsOfSampler(state));
    sampleLatent({}, network(), context(), kept);
    EXPECT_TRUE(kept.finished());
    expectSameLatents(kept.latent, whole);
  }
}

TEST(FlowSampler, ContinuesBetweenTheTwoCallsOfAStep) {
  const std::vector<double> times = flowTimes(kFourSteps);
  SamplerState state = start(kFourSteps);
  network().velocity({}, state.latent, times[0], context(), state.towards_image);
  SamplerState kept = samplerOfTensors(tensorsOfSampler(state));
  EXPECT_EQ(kept.towards_image.tokens, state.towards_image.tokens);
  // Another velocity would lead elsewhere, so it is used.
  SamplerState other = kept;
  for (float& value : other.towards_image.tokens) value += 1;
  sampleLatent({}, network(), context(), kept);
  sampleLatent({}, network(), context(), other);
  expectSameLatents(kept.latent, sampled(kFourSteps));
  EXPECT_NE(other.latent.tokens, kept.latent.tokens);
}

TEST(FlowSampler, LeavesAFinishedStateAsItIs) {
  SamplerState state = start({.steps = 1});
  sampleLatent({}, network(), context(), state);
  const Latent done = state.latent;
  sampleLatent({}, network(), context(), state);
  expectSameLatents(state.latent, done);
}

TEST(FlowSampler, ShowsWhereTheFlowPointsTo) {
  SamplerState state = start({.steps = 6, .guidance = 1, .shift = 3});
  const std::vector<double> times = flowTimes(state.settings);
  std::vector<FlowPreview> previews;
  const FlowListener listener = {[&](const FlowPreview& preview) { previews.push_back(preview); },
                                 2};
  sampleLatent({}, network(), context(), state, listener);
  ASSERT_EQ(previews.size(), 2u);  // the last step's would be the result
  EXPECT_EQ(previews[0].step, 2u);
  EXPECT_EQ(previews[1].step, 4u);
  EXPECT_EQ(previews[1].steps, 6u);

  SamplerState again = start({.steps = 6, .guidance = 1, .shift = 3});
  Latent before, velocity;
  Progress progress;
  const FlowListener stops = {[&](const FlowPreview&) { progress.cancel(); }, 1};
  EXPECT_EQ(
      codeOf([&] { sampleLatent({.progress = &progress}, network(), context(), again, stops); }),
      ErrorCode::kCancelled);
  network().velocity({}, again.latent, times[1], context(), velocity);
  for (size_t i = 0; i < velocity.tokens.size(); ++i) {
    const float estimate =
        again.latent.tokens[i] - velocity.tokens[i] * static_cast<float>(times[1]);
    ASSERT_EQ(previews[0].latent.tokens[i], estimate);
  }
}

TEST(FlowSampler, LetsWhatAPreviewThrowsThroughAndKeepsTheState) {
  SamplerState state = start(kFourSteps);
  const FlowListener throws = {[](const FlowPreview&) { throw std::runtime_error("full disk"); },
                               2};
  EXPECT_THROW(sampleLatent({}, network(), context(), state, throws), std::runtime_error);
  EXPECT_EQ(state.step, 2u);
  sampleLatent({}, network(), context(), state);
  expectSameLatents(state.latent, sampled(kFourSteps));
}

TEST(FlowSampler, TellsItsProgressByTheWorkDone) {
  SamplerState state = start(kFourSteps);
  Progress progress;
  std::vector<double> fractions;
  const FlowListener listener = {
      [&](const FlowPreview&) { fractions.push_back(progress.fraction()); }, 1};
  sampleLatent({.progress = &progress}, network(), context(), state, listener, {0.2, 0.6});
  ASSERT_EQ(fractions.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(fractions[i], 0.2 + 0.1 * static_cast<double>(i + 1), 1e-12);
  }
  EXPECT_NEAR(progress.fraction(), 0.6, 1e-12);
}

TEST(FlowSampler, StartsFromASeedOfItsOwn) {
  const GenerationNoise noise = drawNoise({.tokens = 100 * 16}, {.seed = 7});
  SamplerState state = startSampling(network(), 100, noise, {.steps = 2, .guidance = 2});
  sampleLatent({}, network(), context(), state);
  EXPECT_EQ(state.latent.token_count, 100u);
  EXPECT_EQ(state.latent.tokens.size(), 1600u);
}

TEST(FlowSampler, RefusesSettingsAndNoiseOutsideTheirRanges) {
  const GenerationNoise noise = noiseOf(flowGolden().latent("input"));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<FlowSettings> bad = {{.steps = 0},      {.steps = 1001},   {.guidance = -1},
                                         {.guidance = 101}, {.guidance = nan}, {.shift = 0},
                                         {.shift = 1000},   {.shift = nan}};
  for (const FlowSettings& settings : bad) {
    EXPECT_EQ(codeOf([&] { startSampling(network(), 64, noise, settings); }),
              ErrorCode::kInvalidArgument);
  }
  EXPECT_EQ(codeOf([&] { startSampling(network(), 63, noise, {}); }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(codeOf([&] { startSampling(network(), 0, {}, {}); }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(codeOf([&] { startSampling(network(), kMostFlowTokens + 1, noise, {}); }),
            ErrorCode::kInvalidArgument);
  SamplerState state = start(kFourSteps);
  state.towards_image = state.latent;
  state.towards_image.tokens.pop_back();
  EXPECT_EQ(codeOf([&] { sampleLatent({}, network(), context(), state); }),
            ErrorCode::kInvalidArgument);
}

TEST(FlowSampler, RefusesTensorsThatAreNoState) {
  const TensorTable good = tensorsOfSampler(start(kFourSteps));
  using Floats = std::vector<float>;
  const std::vector<std::function<void(TensorTable&)>> changes = {
      [](TensorTable& t) { t.erase("flow.settings"); },
      [](TensorTable& t) {
        t["flow.settings"].values = std::vector<double>{0, 3, 3};
      },
      [](TensorTable& t) {
        t["flow.settings"].values = std::vector<double>{4, 3, -3};
      },
      [](TensorTable& t) {
        t["flow.settings"].values = std::vector<double>{4, std::nan(""), 3};
      },
      [](TensorTable& t) {
        t["flow.settings"].values = Floats{4, 3, 3};
      },
      [](TensorTable& t) { t["flow.step"].values = std::vector<uint32_t>{5}; },
      [](TensorTable& t) { t["flow.step"].values = std::vector<uint32_t>{}; },
      [](TensorTable& t) { t.erase("flow.latent.camera"); },
      [](TensorTable& t) { t["flow.latent.camera"].values = Floats(4); },
      [](TensorTable& t) { t["flow.latent.tokens"].shape = {64}; },
      [](TensorTable& t) {
        t["flow.latent.tokens"].shape = {64, 17};
      },
      [](TensorTable& t) {
        t["flow.latent.tokens"].shape = {uint64_t{1} << 60, 16};
      },
      [](TensorTable& t) { std::get<Floats>(t["flow.latent.tokens"].values)[9] = std::nanf(""); },
      [](TensorTable& t) { t["flow.towards_image.tokens"] = t["flow.latent.tokens"]; },
  };
  EXPECT_EQ(samplerOfTensors(good).latent.tokens, start(kFourSteps).latent.tokens);
  for (size_t i = 0; i < changes.size(); ++i) {
    SCOPED_TRACE(i);
    TensorTable table = good;
    changes[i](table);
    EXPECT_EQ(codeOf([&] { samplerOfTensors(table); }), ErrorCode::kFormat);
  }
}

}  // namespace
}  // namespace stipple
