// Based on: Lipman et al., Flow Matching for Generative Modeling, ICLR 2023, for the flow; Esser et
// al., Scaling Rectified Flow Transformers, ICML 2024, section 5.3.2, for the shift of times; Ho,
// Salimans, Classifier-Free Diffusion Guidance, 2022, for the guidance.
#include "generate/flow_sampler.h"

#include <cmath>
#include <span>
#include <string>
#include <variant>

#include "base/error.h"
#include "base/number_text.h"
#include "generate/flow_cost.h"

namespace stipple {

namespace {

constexpr uint32_t kMostSteps = 1000;
constexpr double kMostGuidance = 100;
constexpr double kLeastShift = 0.01, kMostShift = 100;

bool usesGuidance(const FlowSettings& settings) {
  return settings.guidance > 1;
}

void requireBetween(double value, double least, double most, const char* what) {
  if (std::isfinite(value) && value >= least && value <= most) return;
  fail(ErrorCode::kInvalidArgument, std::string(what) + " is " + numberText(value) + "; " +
                                        numberText(least) + " to " + numberText(most) +
                                        " is allowed");
}

/// velocity = guidance * towards_image - (guidance - 1) * velocity, tokens and camera.
void guide(double guidance, const Latent& towards_image, Latent& velocity) {
  const auto more = static_cast<float>(guidance), less = static_cast<float>(guidance - 1);
  for (size_t i = 0; i < velocity.tokens.size(); ++i) {
    velocity.tokens[i] = more * towards_image.tokens[i] - less * velocity.tokens[i];
  }
  for (size_t i = 0; i < kCameraWidth; ++i) {
    velocity.camera[i] = more * towards_image.camera[i] - less * velocity.camera[i];
  }
}

/// from - velocity * time.
Latent moved(const Latent& from, const Latent& velocity, double time) {
  const auto amount = static_cast<float>(time);
  Latent to = from;
  for (size_t i = 0; i < to.tokens.size(); ++i) to.tokens[i] -= velocity.tokens[i] * amount;
  for (size_t i = 0; i < kCameraWidth; ++i) to.camera[i] -= velocity.camera[i] * amount;
  return to;
}

const Tensor& tensorOf(const TensorTable& table, const std::string& name) {
  const auto found = table.find(name);
  if (found == table.end()) {
    fail(ErrorCode::kFormat, "the state of a sampler has no tensor " + name);
  }
  return found->second;
}

template <typename T>
std::span<const T> numbersOf(const TensorTable& table, const std::string& name, size_t count) {
  const Tensor& tensor = tensorOf(table, name);
  const auto* values = std::get_if<std::vector<T>>(&tensor.values);
  if (values == nullptr || values->size() != count) {
    fail(ErrorCode::kFormat, "the state of a sampler has a tensor " + name +
                                 " of another size or type; " + std::to_string(count) +
                                 " numbers are needed");
  }
  return *values;
}

void putLatent(const Latent& latent, const std::string& name, TensorTable& table) {
  table[name + ".tokens"] = {{latent.token_count, latent.width}, latent.tokens};
  table[name + ".camera"] = {{kCameraWidth},
                             std::vector<float>(latent.camera.begin(), latent.camera.end())};
}

Latent takeLatent(const TensorTable& table, const std::string& name) {
  const std::string tokens_name = name + ".tokens";
  const Tensor& tensor = tensorOf(table, tokens_name);
  const auto* tokens = std::get_if<std::vector<float>>(&tensor.values);
  const std::vector<uint64_t>& shape = tensor.shape;
  if (tokens == nullptr || shape.size() != 2 || shape[0] > kMostFlowTokens || shape[1] == 0 ||
      shape[1] > kMostFlowTokens || tokens->size() != shape[0] * shape[1]) {
    fail(ErrorCode::kFormat, "the state of a sampler has a tensor " + name +
                                 ".tokens of another shape or type; float32 [tokens, width] is "
                                 "needed");
  }
  Latent latent;
  latent.token_count = shape[0];
  latent.width = static_cast<uint32_t>(shape[1]);
  latent.tokens = *tokens;
  const std::span<const float> camera = numbersOf<float>(table, name + ".camera", kCameraWidth);
  for (size_t i = 0; i < kCameraWidth; ++i) latent.camera[i] = camera[i];
  for (const std::span<const float> numbers : {std::span<const float>(*tokens), camera}) {
    for (const float value : numbers) {
      if (std::isfinite(value)) continue;
      fail(ErrorCode::kFormat, "the state of a sampler has " + std::to_string(value) + " in " +
                                   name + "; finite numbers are allowed");
    }
  }
  return latent;
}

}  // namespace

void validate(const FlowSettings& settings) {
  requireBetween(settings.steps, 1, kMostSteps, "the number of steps");
  requireBetween(settings.guidance, 0, kMostGuidance, "the guidance");
  requireBetween(settings.shift, kLeastShift, kMostShift, "the shift of times");
}

std::vector<double> flowTimes(const FlowSettings& settings) {
  std::vector<double> times(settings.steps + size_t{1});
  for (uint32_t i = 0; i <= settings.steps; ++i) {
    const double u = 1.0 - static_cast<double>(i) / static_cast<double>(settings.steps);
    times[i] = settings.shift * u / (1.0 + (settings.shift - 1.0) * u);
  }
  return times;
}

SamplerState startSampling(const FlowNetwork& network, uint64_t token_count,
                           const GenerationNoise& noise, const FlowSettings& settings) {
  validate(settings);
  const size_t width = network.sizes().token_width;
  if (token_count == 0 || token_count > kMostFlowTokens) {
    fail(ErrorCode::kInvalidArgument, "a latent of " + std::to_string(token_count) +
                                          " tokens is asked for; 1 to " +
                                          std::to_string(kMostFlowTokens) + " is allowed");
  }
  if (noise.tokens.size() != token_count * width || noise.camera.size() != kCameraWidth) {
    fail(ErrorCode::kInvalidArgument, "the noise of a latent has " +
                                          std::to_string(noise.tokens.size()) + " and " +
                                          std::to_string(noise.camera.size()) + " numbers; " +
                                          std::to_string(token_count * width) + " and " +
                                          std::to_string(kCameraWidth) + " are needed");
  }
  SamplerState state;
  state.settings = settings;
  state.latent.token_count = token_count;
  state.latent.width = static_cast<uint32_t>(width);
  state.latent.tokens = noise.tokens;
  for (size_t i = 0; i < kCameraWidth; ++i) state.latent.camera[i] = noise.camera[i];
  return state;
}

void sampleLatent(const NetworkRun& run, const FlowNetwork& network, const FlowContext& context,
                  SamplerState& state, const FlowListener& listener, ProgressShare share) {
  validate(state.settings);
  const bool guided = usesGuidance(state.settings);
  const std::vector<double> times = flowTimes(state.settings);
  FlowContext nothing;
  if (guided) nothing = network.emptyContext(run, context.rows * context.copies);

  const uint64_t tokens = state.latent.token_count;
  const double image_work = flowCallCost(network.sizes(), tokens, context.rows).flops;
  const double empty_work = guided ? flowCallCost(network.sizes(), tokens, 1).flops : 0;
  const double all_work = static_cast<double>(state.settings.steps) * (image_work + empty_work);
  while (!state.finished()) {
    const double time = times[state.step];
    const double before = static_cast<double>(state.step) * (image_work + empty_work);
    const auto part = [&](double from, double to) {
      return share.part((before + from) / all_work, (before + to) / all_work);
    };
    if (state.towards_image.tokens.empty()) {
      Latent velocity;
      network.velocity(run, state.latent, time, context, velocity, part(0, image_work));
      state.towards_image = std::move(velocity);
    } else if (state.towards_image.tokens.size() != state.latent.tokens.size()) {
      fail(ErrorCode::kInvalidArgument,
           "the state of a sampler has a velocity of " +
               std::to_string(state.towards_image.tokens.size()) + " numbers; " +
               std::to_string(state.latent.tokens.size()) + " are needed");
    }
    Latent velocity;
    if (guided) {
      network.velocity(run, state.latent, time, nothing, velocity,
                       part(image_work, image_work + empty_work));
      guide(state.settings.guidance, state.towards_image, velocity);
    } else {
      velocity = state.towards_image;
    }
    const bool wants_preview = listener.preview && listener.preview_every > 0 &&
                               (state.step + 1) % listener.preview_every == 0 &&
                               state.step + 1 < state.settings.steps;
    FlowPreview preview;
    if (wants_preview) preview.latent = moved(state.latent, velocity, time);
    state.latent = moved(state.latent, velocity, time - times[state.step + 1]);
    state.towards_image = {};
    ++state.step;
    if (wants_preview) {
      preview.step = state.step;
      preview.steps = state.settings.steps;
      listener.preview(preview);
    }
  }
  share.tell(run.progress, 1, "Latent done");
}

TensorTable tensorsOfSampler(const SamplerState& state) {
  TensorTable table;
  table["flow.settings"] = {{3},
                            std::vector<double>{static_cast<double>(state.settings.steps),
                                                state.settings.guidance, state.settings.shift}};
  table["flow.step"] = {{1}, std::vector<uint32_t>{state.step}};
  putLatent(state.latent, "flow.latent", table);
  if (!state.towards_image.tokens.empty()) {
    putLatent(state.towards_image, "flow.towards_image", table);
  }
  return table;
}

SamplerState samplerOfTensors(const TensorTable& table) {
  SamplerState state;
  const std::span<const double> settings = numbersOf<double>(table, "flow.settings", 3);
  if (!std::isfinite(settings[0]) || settings[0] < 1 || settings[0] > kMostSteps) {
    fail(ErrorCode::kFormat, "the state of a sampler has " + numberText(settings[0]) +
                                 " steps in flow.settings; 1 to " + std::to_string(kMostSteps) +
                                 " is allowed");
  }
  state.settings = {static_cast<uint32_t>(settings[0]), settings[1], settings[2]};
  try {
    validate(state.settings);
  } catch (const Error& error) {
    fail(ErrorCode::kFormat,
         std::string("the state of a sampler has wrong flow.settings: ") + error.what());
  }
  state.step = numbersOf<uint32_t>(table, "flow.step", 1)[0];
  if (state.step > state.settings.steps) {
    fail(ErrorCode::kFormat, "the state of a sampler has done " + std::to_string(state.step) +
                                 " steps in flow.step; 0 to " +
                                 std::to_string(state.settings.steps) + " is allowed");
  }
  state.latent = takeLatent(table, "flow.latent");
  if (table.contains("flow.towards_image.tokens")) {
    state.towards_image = takeLatent(table, "flow.towards_image");
  }
  return state;
}

}  // namespace stipple
