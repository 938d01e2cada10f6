// Based on: Yan et al., Generative 3D Gaussians with Learned Density Control, arXiv 2605.16355, and
// its released code; the objective is that of Lipman et al., Flow Matching for Generative Modeling,
// ICLR 2023.
#include "train/networks/trained_flow.h"

#include <algorithm>
#include <utility>

#include "generate/sobol_points.h"
#include "nn/activations.h"
#include "nn/norms.h"
#include "nn/positions.h"
#include "nn/training/norms_backward.h"

namespace stipple {

namespace {

/// Noise that is left at time 0.
constexpr double kLeastNoise = 1e-5;

std::string numbered(const char* name, size_t i) {
  return std::string(name) + "." + std::to_string(i);
}

/// Tokens through blocks; `tape` keeps what is before each, and after the last.
void applyAll(const std::vector<TrainedFlowBlock>& blocks, std::span<const float> values,
              std::span<const float> time, std::vector<float> tokens,
              std::vector<std::vector<float>>& tape) {
  tape.clear();
  tape.push_back(std::move(tokens));
  for (const TrainedFlowBlock& block : blocks) {
    tape.push_back(block.apply(values, time, tape.back()));
  }
}

void backwardOfAll(const std::vector<TrainedFlowBlock>& blocks, std::span<const float> values,
                   std::span<const float> time, const std::vector<std::vector<float>>& tape,
                   std::vector<float>& by, std::span<float> gradients, float* by_time) {
  for (size_t i = blocks.size(); i-- > 0;) {
    blocks[i].backward(values, time, tape[i], by, gradients, by_time);
  }
}

}  // namespace

TrainedFlow::TrainedFlow(ParameterLayout& layout, const FlowSizes& sizes) : sizes_(sizes) {
  const size_t channels = sizes.block.channels;
  shift_table_ = layout.add("shift_table", {1, 2, channels});
  time_in_ = TrainedLinear(layout, "t_embedder.mlp.0", sizes.time_width, channels);
  time_out_ = TrainedLinear(layout, "t_embedder.mlp.2", channels, channels);
  modulation_ = TrainedLinear(layout, "adaLN_modulation.1", channels, 6 * channels);
  input_ = TrainedLinear(layout, "input_layer", sizes.token_width, channels);
  structure_ = TrainedLinear(layout, "cond_embedder", sizes.structure_width, channels);
  colour_ = TrainedLinear(layout, "cond_embedder2", sizes.colour_width, channels);
  camera_in_ = TrainedLinear(layout, "cam_refiner.mlp.0", kCameraWidth, channels);
  camera_out_ = TrainedLinear(layout, "cam_refiner.mlp.2", channels, channels);
  const auto add = [&](std::vector<TrainedFlowBlock>& blocks, size_t count, const char* block,
                       const char* rotary, FlowModulation modulation) {
    for (size_t i = 0; i < count; ++i) {
      blocks.emplace_back(layout, numbered(block, i), numbered(rotary, i), sizes.block, modulation);
    }
  };
  add(noise_refiners_, sizes.noise_refiner_count, "noise_refiner", "noise_repo_layers",
      FlowModulation::kTime);
  add(context_refiners_, sizes.context_refiner_count, "context_refiner", "context_repo_layers",
      FlowModulation::kNone);
  add(blocks_, sizes.block_count, "blocks", "repo_layers", FlowModulation::kTime);
  token_head_ = TrainedLinear(layout, "out_layer", channels, sizes.token_width);
  camera_head_ = TrainedLinear(layout, "cam_out_layer", channels, kCameraWidth);
}

void TrainedFlow::embedTime(std::span<const float> values, double time, Tape& tape) const {
  const size_t channels = sizes_.block.channels;
  tape.encoding = flowTimeEncoding(time, sizes_.time_width);
  tape.time_hidden.resize(channels);
  tape.time.resize(channels);
  tape.modulation.resize(6 * channels);
  time_in_.apply(values, 1, tape.encoding.data(), tape.time_hidden.data());
  tape.time_activated = tape.time_hidden;
  activate(Activation::kSilu, tape.time_activated);
  time_out_.apply(values, 1, tape.time_activated.data(), tape.time.data());
  tape.time_silu = tape.time;
  activate(Activation::kSilu, tape.time_silu);
  modulation_.apply(values, 1, tape.time_silu.data(), tape.modulation.data());
  const std::span<const float> table = values.subspan(shift_table_, 2 * channels);
  tape.shift.assign(table.begin(), table.begin() + static_cast<ptrdiff_t>(channels));
  tape.scale.assign(table.begin() + static_cast<ptrdiff_t>(channels), table.end());
  for (size_t i = 0; i < channels; ++i) {
    tape.shift[i] += tape.time[i];
    tape.scale[i] += tape.time[i];
  }
}

void TrainedFlow::backwardOfTime(std::span<const float> values, const Tape& tape,
                                 std::vector<float> by_time,
                                 const std::vector<float>& by_modulation,
                                 std::span<float> gradients) const {
  const size_t channels = sizes_.block.channels;
  std::vector<float> by_silu(channels), by_hidden(channels);
  modulation_.backward(values, 1, tape.time_silu.data(), by_modulation.data(), gradients,
                       by_silu.data());
  activateBackward(Activation::kSilu, tape.time, by_silu);
  for (size_t i = 0; i < channels; ++i) by_time[i] += by_silu[i];
  time_out_.backward(values, 1, tape.time_activated.data(), by_time.data(), gradients,
                     by_hidden.data());
  activateBackward(Activation::kSilu, tape.time_hidden, by_hidden);
  time_in_.backward(values, 1, tape.encoding.data(), by_hidden.data(), gradients, nullptr);
}

LayerNorm TrainedFlow::headNorm(const Tape& tape) const {
  return {sizes_.block.channels, kFlowHeadEpsilon, {}, {}, tape.scale, tape.shift};
}

Latent TrainedFlow::forward(std::span<const float> values, const Latent& state, double time,
                            const ImageCondition& condition, Tape& tape) const {
  const size_t channels = sizes_.block.channels, tokens = state.token_count;
  embedTime(values, time, tape);
  std::vector<float> noise(tokens * channels), context(condition.rows * channels), colour(context);
  input_.apply(values, tokens, state.tokens.data(), noise.data());
  const std::vector<float> places = sobolPoints(tokens);
  addPositions(PositionEncoding::kPowers, tokens, channels, places.data(), noise.data());
  applyAll(noise_refiners_, values, tape.modulation, std::move(noise), tape.noise);
  structure_.apply(values, condition.rows, condition.structure.data(), context.data());
  colour_.apply(values, condition.rows, condition.colour.data(), colour.data());
  addScaled(condition.rows, channels, {}, colour.data(), context.data());
  applyAll(context_refiners_, values, {}, std::move(context), tape.context);
  tape.camera[0].resize(channels);
  camera_in_.apply(values, 1, state.camera.data(), tape.camera[0].data());
  tape.camera[1] = tape.camera[0];
  activate(Activation::kGeluTanh, tape.camera[1]);
  std::vector<float> all = tape.noise.back();
  all.insert(all.end(), tape.context.back().begin(), tape.context.back().end());
  all.resize(all.size() + channels);
  camera_out_.apply(values, 1, tape.camera[1].data(), &all[all.size() - channels]);
  applyAll(blocks_, values, tape.modulation, std::move(all), tape.all);
  const std::vector<float>& last = tape.all.back();
  tape.normal.resize((tokens + 1) * channels);
  layerNorm(headNorm(tape), tokens, last.data(), tape.normal.data());
  layerNorm(headNorm(tape), 1, &last[last.size() - channels], &tape.normal[tokens * channels]);
  Latent velocity;
  velocity.token_count = tokens;
  velocity.width = state.width;
  velocity.tokens.resize(state.tokens.size());
  token_head_.apply(values, tokens, tape.normal.data(), velocity.tokens.data());
  camera_head_.apply(values, 1, &tape.normal[tokens * channels], velocity.camera.data());
  return velocity;
}

TrainedFlow::InputGradients TrainedFlow::backward(std::span<const float> values,
                                                  const Latent& state,
                                                  const ImageCondition& condition, const Tape& tape,
                                                  const Latent& by,
                                                  std::span<float> gradients) const {
  const size_t channels = sizes_.block.channels, tokens = state.token_count;
  const std::vector<float>& last = tape.all.back();
  const size_t camera = last.size() - channels;
  std::vector<float> by_normal(tape.normal.size()), by_all(last.size(), 0.0f);
  std::vector<float> by_scale(channels, 0.0f), by_shift(channels, 0.0f);
  token_head_.backward(values, tokens, tape.normal.data(), by.tokens.data(), gradients,
                       by_normal.data());
  camera_head_.backward(values, 1, &tape.normal[tokens * channels], by.camera.data(), gradients,
                        &by_normal[tokens * channels]);
  const LayerNormGradients of_norm = {nullptr, nullptr, by_scale.data(), by_shift.data()};
  layerNormBackward(headNorm(tape), tokens, last.data(), by_normal.data(), of_norm, by_all.data());
  layerNormBackward(headNorm(tape), 1, &last[camera], &by_normal[tokens * channels], of_norm,
                    &by_all[camera]);
  std::vector<float> by_time(channels), by_modulation(6 * channels, 0.0f);
  for (size_t i = 0; i < channels; ++i) {
    by_time[i] = by_scale[i] + by_shift[i];
    gradients[shift_table_ + i] += by_shift[i];
    gradients[shift_table_ + channels + i] += by_scale[i];
  }
  backwardOfAll(blocks_, values, tape.modulation, tape.all, by_all, gradients,
                by_modulation.data());
  const auto cut = [&](size_t first, size_t end) {
    return std::vector<float>(by_all.begin() + static_cast<ptrdiff_t>(first),
                              by_all.begin() + static_cast<ptrdiff_t>(end));
  };
  InputGradients made;
  std::vector<float> by_camera(channels);
  camera_out_.backward(values, 1, tape.camera[1].data(), &by_all[camera], gradients,
                       by_camera.data());
  activateBackward(Activation::kGeluTanh, tape.camera[0], by_camera);
  camera_in_.backward(values, 1, state.camera.data(), by_camera.data(), gradients,
                      made.camera.data());
  std::vector<float> by_context = cut(tokens * channels, camera);
  backwardOfAll(context_refiners_, values, {}, tape.context, by_context, gradients, nullptr);
  made.structure.resize(condition.structure.size());
  made.colour.resize(condition.colour.size());
  structure_.backward(values, condition.rows, condition.structure.data(), by_context.data(),
                      gradients, made.structure.data());
  colour_.backward(values, condition.rows, condition.colour.data(), by_context.data(), gradients,
                   made.colour.data());
  std::vector<float> by_noise = cut(0, tokens * channels);
  backwardOfAll(noise_refiners_, values, tape.modulation, tape.noise, by_noise, gradients,
                by_modulation.data());
  made.tokens.resize(state.tokens.size());
  input_.backward(values, tokens, state.tokens.data(), by_noise.data(), gradients,
                  made.tokens.data());
  backwardOfTime(values, tape, std::move(by_time), by_modulation, gradients);
  return made;
}

FlowExample flowExample(const Latent& object, const Latent& noise, double time) {
  FlowExample made = {object, object};
  const auto mix = [&](std::span<const float> of_object, std::span<const float> of_noise,
                       std::span<float> state, std::span<float> velocity) {
    for (size_t i = 0; i < state.size(); ++i) {
      const auto from = static_cast<double>(of_object[i]), to = static_cast<double>(of_noise[i]);
      state[i] =
          static_cast<float>((1 - time) * from + (kLeastNoise + (1 - kLeastNoise) * time) * to);
      velocity[i] = static_cast<float>((1 - kLeastNoise) * to - from);
    }
  };
  mix(object.tokens, noise.tokens, made.state.tokens, made.velocity.tokens);
  mix(object.camera, noise.camera, made.state.camera, made.velocity.camera);
  return made;
}

double flowLoss(const Latent& seen, const Latent& expected, double count, Latent& by) {
  by = seen;
  double sum = 0;
  const auto add = [&](std::span<const float> from, std::span<const float> to,
                       std::span<float> gradient) {
    for (size_t i = 0; i < from.size(); ++i) {
      const double error = static_cast<double>(from[i]) - static_cast<double>(to[i]);
      sum += error * error / count;
      gradient[i] = static_cast<float>(2 * error / count);
    }
  };
  add(seen.tokens, expected.tokens, by.tokens);
  add(seen.camera, expected.camera, by.camera);
  return sum;
}

}  // namespace stipple
