// Based on: Yan et al., Generative 3D Gaussians with Learned Density Control, arXiv 2605.16355, and
// its released code.
// Differs: the context of an empty image is one row that counts as many times as there are rows,
// which is the same sum; refiners of a context run once for an image, not in every step.
#include "generate/flow_network.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "generate/sobol_points.h"
#include "nn/activations.h"
#include "nn/norms.h"
#include "nn/positions.h"

namespace stipple {

namespace {

constexpr double kLongestPeriod = 10000.0;
/// The network was trained with times of 0 to 1000.
constexpr double kTimeUnits = 1000.0;
/// A buffer of the training program that files of one's own training hold: the places of tokens,
/// which are known.
constexpr const char* kPlacesBuffer = "pos_pe";
/// What layers of nn/ hold packed at a time: keys and values, weights, and what every thread works
/// in. The store of idle memory keeps no more than was in use.
uint64_t layerBytes(const FlowBlockSizes& sizes, uint64_t rows) {
  constexpr uint64_t kMostKeys = uint64_t{32} << 20, kMostWeights = uint64_t{16} << 20;
  constexpr uint64_t kThread = uint64_t{1} << 20;
  const uint64_t keys = sizeof(float) * 2 * rows * sizes.channels;
  const uint64_t weights =
      sizeof(float) * sizes.channels * std::max(3 * sizes.channels, sizes.mlp_width);
  return std::min(keys, kMostKeys) + std::min(weights, kMostWeights) + threadLimit() * kThread;
}

std::string numbered(const char* name, size_t i) {
  return std::string(name) + "." + std::to_string(i);
}

[[noreturn]] void refuseExtra(const WeightTable& weights, const std::vector<std::string>& extra,
                              const FlowSizes& sizes) {
  fail(ErrorCode::kFormat,
       weights.source() + " has " + std::to_string(extra.size()) +
           (extra.size() == 1 ? " tensor" : " tensors") +
           " that a flow network has no place for, the first is " + extra.front() +
           "; allowed are those of " + std::to_string(sizes.block_count) + " blocks, " +
           std::to_string(sizes.noise_refiner_count) + " refiners of noise and " +
           std::to_string(sizes.context_refiner_count) + " of the context");
}

}  // namespace

std::vector<float> flowTimeEncoding(double time, size_t width) {
  return timeEncoding(kTimeUnits * time, kLongestPeriod, width);
}

/// A time as the network sees it.
struct FlowNetwork::Time {
  std::vector<float> embedding;   ///< [channels]
  std::vector<float> modulation;  ///< [6 channels]
};

FlowNetwork::FlowNetwork(const WeightTable& weights) : source_(weights.source()) {
  readSizes(weights);
  readBlocks(weights);
  std::vector<std::string> extra = weights.unread();
  std::erase_if(extra, [](const std::string& name) { return name.ends_with(kPlacesBuffer); });
  if (!extra.empty()) refuseExtra(weights, extra, sizes_);
}

void FlowNetwork::readSizes(const WeightTable& weights) {
  input_ = Linear(weights, "input_layer", kAnySize, kAnySize);
  const size_t channels = input_.outputs();
  structure_ = Linear(weights, "cond_embedder", kAnySize, channels);
  colour_ = Linear(weights, "cond_embedder2", kAnySize, channels);
  camera_in_ = Linear(weights, "cam_refiner.mlp.0", kCameraWidth, channels);
  camera_out_ = Linear(weights, "cam_refiner.mlp.2", channels, channels);
  time_in_ = Linear(weights, "t_embedder.mlp.0", kAnySize, channels);
  time_out_ = Linear(weights, "t_embedder.mlp.2", channels, channels);
  modulation_ = Linear(weights, "adaLN_modulation.1", channels, 6 * channels);
  token_head_ = Linear(weights, "out_layer", channels, input_.inputs());
  camera_head_ = Linear(weights, "cam_out_layer", channels, kCameraWidth);
  shift_table_ = weights.floats("shift_table", {1, 2, channels});

  const WeightTensor& heads = weights.require("blocks.0.attn.q_norm.gamma", {kAnySize, kAnySize});
  const WeightTensor& mlp = weights.require("blocks.0.mlp.mlp.0.weight", {kAnySize, channels});
  const WeightTensor& rotary =
      weights.require("repo_layers.0.gate_map.weight", {kAnySize, channels});
  sizes_.block = {.channels = channels,
                  .heads = static_cast<size_t>(heads.shape[0]),
                  .head_width = static_cast<size_t>(heads.shape[1]),
                  .mlp_width = static_cast<size_t>(mlp.shape[0]),
                  .rotary_width = static_cast<size_t>(rotary.shape[0])};
  sizes_.token_width = input_.inputs();
  sizes_.structure_width = structure_.inputs();
  sizes_.colour_width = colour_.inputs();
  sizes_.time_width = time_in_.inputs();
  sizes_.block_count = weights.countBlocks("blocks.");
  sizes_.noise_refiner_count = weights.countBlocks("noise_refiner.");
  sizes_.context_refiner_count = weights.countBlocks("context_refiner.");
  // Shapes are products of 64 bits, none of which can overflow: every tensor lies in the file.
  const FlowBlockSizes& block = sizes_.block;
  if (block.heads * block.head_width != channels || block.head_width % 2 != 0 || channels == 0) {
    fail(ErrorCode::kFormat,
         source_ + ": blocks.0.attn.q_norm.gamma is of shape [" + std::to_string(block.heads) +
             ", " + std::to_string(block.head_width) + "]; the heads of " +
             std::to_string(channels) + " channels have as many together, an even number each");
  }
  if (sizes_.time_width % 2 != 0) {
    fail(ErrorCode::kFormat, source_ + ": t_embedder.mlp.0.weight has " +
                                 std::to_string(sizes_.time_width) +
                                 " columns; sines and cosines need an even number");
  }
}

void FlowNetwork::readBlocks(const WeightTable& weights) {
  for (size_t i = 0; i < sizes_.noise_refiner_count; ++i) {
    noise_refiners_.emplace_back(weights, numbered("noise_refiner", i),
                                 numbered("noise_repo_layers", i), sizes_.block,
                                 FlowModulation::kTime);
  }
  for (size_t i = 0; i < sizes_.context_refiner_count; ++i) {
    context_refiners_.emplace_back(weights, numbered("context_refiner", i),
                                   numbered("context_repo_layers", i), sizes_.block,
                                   FlowModulation::kNone);
  }
  for (size_t i = 0; i < sizes_.block_count; ++i) {
    blocks_.emplace_back(weights, numbered("blocks", i), numbered("repo_layers", i), sizes_.block,
                         FlowModulation::kTime);
  }
}

FlowContext FlowNetwork::context(const NetworkRun& run, const ImageCondition& condition,
                                 ProgressShare share) const {
  if (condition.rows == 0 || condition.structure_width != sizes_.structure_width ||
      condition.colour_width != sizes_.colour_width ||
      condition.structure.size() != condition.rows * sizes_.structure_width ||
      condition.colour.size() != condition.rows * sizes_.colour_width) {
    fail(ErrorCode::kInvalidArgument,
         "a condition has " + std::to_string(condition.rows) + " rows of " +
             std::to_string(condition.structure_width) + " and " +
             std::to_string(condition.colour_width) + " features; the flow network of " + source_ +
             " wants at least one row of " + std::to_string(sizes_.structure_width) + " and " +
             std::to_string(sizes_.colour_width));
  }
  requireFinite(condition.structure.data(), condition.structure.size(), sizes_.structure_width,
                "structure of a condition");
  requireFinite(condition.colour.data(), condition.colour.size(), sizes_.colour_width,
                "colour of a condition");
  const size_t channels = sizes_.block.channels;
  FlowContext context;
  context.rows = condition.rows;
  context.values.resize(condition.rows * channels);
  structure_.apply(run, condition.rows, condition.structure.data(), context.values.data());
  {
    std::vector<float> colour(condition.rows * channels);
    colour_.apply(run, condition.rows, condition.colour.data(), colour.data());
    addScaled(condition.rows, channels, {}, colour.data(), context.values.data());
  }
  FlowBlockMemory memory;
  const auto count = static_cast<double>(context_refiners_.size());
  for (size_t i = 0; i < context_refiners_.size(); ++i) {
    const auto at = static_cast<double>(i);
    context_refiners_[i].apply(run, condition.rows, context.values.data(), {}, {}, memory,
                               share.part(at / count, (at + 1) / count), "Reading the image");
  }
  return context;
}

FlowContext FlowNetwork::emptyContext(const NetworkRun& run, uint64_t rows) const {
  ImageCondition nothing;
  nothing.rows = 1;
  nothing.structure_width = static_cast<uint32_t>(sizes_.structure_width);
  nothing.colour_width = static_cast<uint32_t>(sizes_.colour_width);
  nothing.structure.resize(sizes_.structure_width);
  nothing.colour.resize(sizes_.colour_width);
  NetworkRun quiet = run;
  quiet.progress = nullptr;  // two rows' worth of work, which no listener would see
  FlowContext context = this->context(quiet, nothing);
  context.copies = rows;
  return context;
}

FlowNetwork::Time FlowNetwork::embedTime(const NetworkRun& run, double time) const {
  const size_t channels = sizes_.block.channels;
  const std::vector<float> waves = flowTimeEncoding(time, sizes_.time_width);
  Time result;
  std::vector<float> hidden(channels);
  result.embedding.resize(channels);
  result.modulation.resize(6 * channels);
  time_in_.apply(run, 1, waves.data(), hidden.data());
  activate(Activation::kSilu, hidden);
  time_out_.apply(run, 1, hidden.data(), result.embedding.data());
  hidden = result.embedding;
  activate(Activation::kSilu, hidden);
  modulation_.apply(run, 1, hidden.data(), result.modulation.data());
  return result;
}

/// Tokens with their places, and behind the context the camera. Out: h [tokens + context + 1].
void FlowNetwork::embed(const NetworkRun& run, const Latent& state, float* h) const {
  const size_t channels = sizes_.block.channels;
  input_.apply(run, state.token_count, state.tokens.data(), h);
  const std::vector<float> places = sobolPoints(state.token_count);
  addPositions(PositionEncoding::kPowers, state.token_count, channels, places.data(), h);
}

void FlowNetwork::requireState(const Latent& state, double time, const FlowContext& context) const {
  const size_t channels = sizes_.block.channels;
  if (state.token_count == 0 || state.token_count > kMostFlowTokens ||
      state.width != sizes_.token_width ||
      state.tokens.size() != state.token_count * sizes_.token_width) {
    fail(ErrorCode::kInvalidArgument, "a latent has " + std::to_string(state.token_count) +
                                          " tokens of " + std::to_string(state.width) +
                                          " numbers; the flow network of " + source_ +
                                          " wants 1 to " + std::to_string(kMostFlowTokens) +
                                          " of " + std::to_string(sizes_.token_width));
  }
  requireFinite(state.tokens.data(), state.tokens.size(), sizes_.token_width, "tokens of a latent");
  requireFinite(state.camera.data(), kCameraWidth, kCameraWidth, "camera of a latent");
  if (!std::isfinite(time) || time < 0 || time > 1) {
    fail(ErrorCode::kInvalidArgument,
         "the time of a flow is " + numberText(time) + "; 0 to 1 is allowed");
  }
  if (context.rows == 0 || context.copies == 0 ||
      context.values.size() != context.rows * channels) {
    fail(ErrorCode::kInvalidArgument, "a context has " + std::to_string(context.values.size()) +
                                          " numbers in " + std::to_string(context.rows) +
                                          " rows; the flow network of " + source_ + " wants " +
                                          std::to_string(channels) + " in each");
  }
}

/// In: h [rows, channels]: tokens first, the camera last; written over.
void FlowNetwork::readOut(const NetworkRun& run, const Time& time, size_t rows, float* h,
                          Latent& velocity) const {
  const size_t channels = sizes_.block.channels;
  std::vector<float> shift(shift_table_.begin(),
                           shift_table_.begin() + static_cast<ptrdiff_t>(channels));
  std::vector<float> scale(shift_table_.begin() + static_cast<ptrdiff_t>(channels),
                           shift_table_.end());
  for (size_t i = 0; i < channels; ++i) {
    shift[i] += time.embedding[i];
    scale[i] += time.embedding[i];
  }
  LayerNorm norm;
  norm.width = channels;
  norm.epsilon = kFlowHeadEpsilon;
  norm.scale = scale;
  norm.shift = shift;
  float* camera = h + (rows - 1) * channels;
  layerNorm(norm, velocity.token_count, h, h);
  token_head_.apply(run, velocity.token_count, h, velocity.tokens.data());
  layerNorm(norm, 1, camera, camera);
  camera_head_.apply(run, 1, camera, velocity.camera.data());
  bool finite = true;
  for (const float value : velocity.tokens) finite &= std::isfinite(value);
  for (const float value : velocity.camera) finite &= std::isfinite(value);
  if (!finite) {
    fail(ErrorCode::kFormat, source_ +
                                 ": the flow network gives a velocity that is not finite; its "
                                 "weights are not those of a trained network, or too large for "
                                 "float32");
  }
}

void FlowNetwork::velocity(const NetworkRun& run, const Latent& state, double time,
                           const FlowContext& context, Latent& velocity,
                           ProgressShare share) const {
  requireState(state, time, context);
  const char* stage =
      context.copies == 1 ? "Flowing towards the image" : "Flowing without an image";
  share.tell(run.progress, 0, stage);
  const size_t channels = sizes_.block.channels;
  const size_t tokens = state.token_count;
  const size_t rows = tokens + context.rows + 1;
  const Time seen_time = embedTime(run, time);

  DefaultInitVector<float> h(rows * channels);
  embed(run, state, h.data());
  std::copy(context.values.begin(), context.values.end(),
            h.begin() + static_cast<ptrdiff_t>(tokens * channels));
  {
    std::vector<float> hidden(channels);
    camera_in_.apply(run, 1, state.camera.data(), hidden.data());
    activate(Activation::kGeluTanh, hidden);
    camera_out_.apply(run, 1, hidden.data(), h.data() + (rows - 1) * channels);
  }
  std::vector<float> key_bias;
  if (context.copies != 1) {
    key_bias.resize(rows);
    const auto bias = static_cast<float>(std::log(static_cast<double>(context.copies)));
    for (size_t r = tokens; r < tokens + context.rows; ++r) key_bias[r] = bias;
  }

  // A block's time rises with its tokens by linear layers, and with their square by the attention.
  const auto blockTime = [&](size_t count) {
    const auto n = static_cast<double>(count);
    const auto width = static_cast<double>(sizes_.block.mlp_width + 2 * channels);
    return n * (width + n);
  };
  const double refiner_time = blockTime(tokens), block_time = blockTime(rows);
  const double all_time = refiner_time * static_cast<double>(noise_refiners_.size()) +
                          block_time * static_cast<double>(blocks_.size());
  double done = 0;
  FlowBlockMemory memory;
  memory.qkv.reserve(rows * 3 * channels);  // refiners, which come first, need less
  const auto apply = [&](const FlowBlock& block, size_t count, std::span<const float> bias,
                         double block_share) {
    block.apply(run, count, h.data(), seen_time.modulation, bias, memory,
                share.part(done / all_time, (done + block_share) / all_time), stage);
    done += block_share;
  };
  for (const FlowBlock& block : noise_refiners_) apply(block, tokens, {}, refiner_time);
  for (const FlowBlock& block : blocks_) apply(block, rows, key_bias, block_time);

  velocity.token_count = state.token_count;
  velocity.width = state.width;
  velocity.tokens.resize(state.tokens.size());
  readOut(run, seen_time, rows, h.data(), velocity);
  share.tell(run.progress, 1, stage);
}

uint64_t FlowNetwork::memoryBound(uint64_t token_count, uint64_t context_rows) const {
  const uint64_t channels = sizes_.block.channels;
  const uint64_t rows = token_count + context_rows + 1;
  const uint64_t tokens = sizeof(float) * rows * (channels + 1);
  return tokens + flowBlockMemoryBytes(sizes_.block, rows) + layerBytes(sizes_.block, rows);
}

}  // namespace stipple
