// Source: the layers of the networks that arXiv 2605.16355 and its released code use, counted.
#include "generate/flow_cost.h"

#include <algorithm>

namespace stipple {

namespace {

constexpr uint64_t kHalfBytes = 2;
constexpr uint64_t kSplatsPerAnchor = 32;
constexpr int kOctreeLevels = 8;

double real(uint64_t count) {
  return static_cast<double>(count);
}

/// Linear layers with so many weights, over so many rows.
StageCost linearCost(uint64_t weights, uint64_t rows, uint64_t weight_size = kHalfBytes) {
  return {2 * real(weights) * real(rows), 0, weights * weight_size};
}

/// Scores and weighted sums of all heads together.
StageCost attentionCost(uint64_t queries, uint64_t keys, uint64_t channels) {
  const double flops = 4 * real(queries) * real(keys) * real(channels);
  return {flops, flops, 0};
}

StageCost operator+(const StageCost& a, const StageCost& b) {
  return {a.flops + b.flops, a.attention_flops + b.attention_flops,
          a.weight_bytes + b.weight_bytes};
}

StageCost operator*(uint64_t count, const StageCost& cost) {
  return {real(count) * cost.flops, real(count) * cost.attention_flops, count * cost.weight_bytes};
}

/// The same work again with the same weights.
StageCost repeated(uint64_t count, const StageCost& cost) {
  return {real(count) * cost.flops, real(count) * cost.attention_flops, cost.weight_bytes};
}

StageCost flowBlockCost(const FlowBlockSizes& sizes, uint64_t rows) {
  const uint64_t c = sizes.channels;
  const uint64_t weights = 4 * c * c + 2 * c * sizes.mlp_width + 2 * c * sizes.rotary_width +
                           sizes.rotary_width * 3 * sizes.heads;
  return linearCost(weights, rows) + attentionCost(rows, rows, c);
}

/// A convolution of float32 weights.
StageCost convolutionCost(uint64_t kernel, uint64_t in, uint64_t out, uint64_t pixels) {
  constexpr uint64_t kFloatBytes = 4;
  return linearCost(kernel * kernel * in * out, pixels, kFloatBytes);
}

StageCost residualCost(uint64_t in, uint64_t out, uint64_t pixels) {
  StageCost cost = convolutionCost(3, in, out, pixels) + convolutionCost(3, out, out, pixels);
  if (in != out) cost = cost + convolutionCost(1, in, out, pixels);
  return cost;
}

/// Channels of the published octree and splat decoders, and of a token of a latent.
constexpr uint64_t kDecoderChannels = 1024, kTokenWidth = 16;

/// Queries of `rows` tokens, keys and values of all tokens of the latent.
StageCost crossAttentionCost(uint64_t rows, uint64_t token_count) {
  const uint64_t c = kDecoderChannels;
  return linearCost(2 * c * c, rows) + linearCost(2 * kTokenWidth * c, token_count) +
         attentionCost(rows, token_count, c);
}

}  // namespace

FlowSizes publishedFlowSizes() {
  FlowSizes sizes;
  sizes.block = {
      .channels = 1024, .heads = 16, .head_width = 64, .mlp_width = 4096, .rotary_width = 128};
  sizes.block_count = 24;
  sizes.noise_refiner_count = 2;
  sizes.context_refiner_count = 2;
  sizes.token_width = 16;
  sizes.structure_width = 1280;
  sizes.colour_width = 128;
  sizes.time_width = 256;
  return sizes;
}

StageCost flowCallCost(const FlowSizes& sizes, uint64_t token_count, uint64_t context_rows) {
  const uint64_t c = sizes.block.channels;
  const StageCost tokens = linearCost(2 * c * sizes.token_width, token_count);
  const StageCost time = linearCost(c * sizes.time_width + 7 * c * c, 1);
  const StageCost camera = linearCost(c * c + 2 * c * kCameraWidth, 1);
  return tokens + time + camera +
         sizes.noise_refiner_count * flowBlockCost(sizes.block, token_count) +
         sizes.block_count * flowBlockCost(sizes.block, token_count + context_rows + 1);
}

StageCost flowContextCost(const FlowSizes& sizes, uint64_t context_rows) {
  const uint64_t widths = sizes.structure_width + sizes.colour_width;
  return linearCost(sizes.block.channels * widths, context_rows) +
         sizes.context_refiner_count * flowBlockCost(sizes.block, context_rows);
}

StageCost flowSamplingCost(const FlowSizes& sizes, uint64_t token_count, uint64_t context_rows,
                           const FlowSettings& settings) {
  StageCost cost = flowContextCost(sizes, context_rows) +
                   repeated(settings.steps, flowCallCost(sizes, token_count, context_rows));
  if (settings.guidance > 1) {
    StageCost without = repeated(settings.steps, flowCallCost(sizes, token_count, 1));
    without.weight_bytes = 0;  // the same weights
    cost = cost + without;
  }
  return cost;
}

uint64_t conditionRows(uint32_t canvas_size) {
  const uint64_t side = canvas_size / 16;
  return 5 + side * side;
}

StageCost structureEncoderCost(uint32_t canvas_size) {
  constexpr uint64_t kChannels = 1280, kLayers = 32, kMlp = 5120, kPatchNumbers = 3 * 16 * 16;
  const uint64_t rows = conditionRows(canvas_size);
  const StageCost layer = linearCost(4 * kChannels * kChannels + 3 * kChannels * kMlp, rows) +
                          attentionCost(rows, rows, kChannels);
  return linearCost(kPatchNumbers * kChannels, rows - 5) + kLayers * layer;
}

StageCost colourEncoderCost(uint32_t canvas_size) {
  constexpr uint64_t kChannels[] = {128, 256, 512, 512};
  constexpr uint64_t kLevels = 4, kMoments = 64;
  uint64_t side = canvas_size;
  uint64_t in = kChannels[0];
  StageCost cost = convolutionCost(3, 3, in, side * side);
  for (uint64_t level = 0; level < kLevels; ++level) {
    const uint64_t out = kChannels[level];
    cost = cost + residualCost(in, out, side * side) + residualCost(out, out, side * side);
    in = out;
    if (level + 1 == kLevels) break;
    side /= 2;
    cost = cost + convolutionCost(3, out, out, side * side);
  }
  const uint64_t pixels = side * side;
  cost = cost + 2 * residualCost(in, in, pixels) + 4 * convolutionCost(1, in, in, pixels) +
         attentionCost(pixels, pixels, in);
  return cost + convolutionCost(3, in, kMoments, pixels) +
         convolutionCost(1, kMoments, kMoments, pixels);
}

StageCost octreeLevelCost(uint64_t cells, uint64_t token_count) {
  constexpr uint64_t kBlocks = 4, kChildren = 8, c = kDecoderChannels;
  const StageCost block = crossAttentionCost(cells, token_count) + linearCost(8 * c * c, cells);
  constexpr uint64_t kLevelWaves = 256;
  const StageCost level = linearCost(kLevelWaves * c + c * c + 6 * c * c, 1);
  return level + linearCost(c * c + 3 * c + kChildren * c, cells) + kBlocks * block;
}

StageCost octreeCost(uint64_t anchor_count, uint64_t token_count) {
  StageCost cost;
  uint64_t cells = 1;
  for (int level = 0; level < kOctreeLevels; ++level) {
    const StageCost all = octreeLevelCost(std::min(cells, anchor_count), token_count);
    cost.flops += all.flops;
    cost.attention_flops += all.attention_flops;
    cost.weight_bytes = all.weight_bytes;  // the same in every level
    cells *= 8;
  }
  return cost;
}

StageCost splatDecoderCost(uint64_t anchor_count, uint64_t token_count) {
  constexpr uint64_t kBlocks = 16, kOutputs = 480, c = kDecoderChannels;
  const StageCost block =
      linearCost(4 * c * c, anchor_count) + attentionCost(anchor_count, anchor_count, c) +
      crossAttentionCost(anchor_count, token_count) + linearCost(8 * c * c, anchor_count);
  return linearCost(c * c + 3 * c + kOutputs * c, anchor_count) + kBlocks * block;
}

std::vector<NamedCost> generationCosts(const GenerationPlan& plan) {
  const uint64_t anchors = plan.splat_count / kSplatsPerAnchor;
  return {{"Structure of the image", structureEncoderCost(plan.canvas_size)},
          {"Colour of the image", colourEncoderCost(plan.canvas_size)},
          {"Latent", flowSamplingCost(publishedFlowSizes(), plan.token_count,
                                      conditionRows(plan.canvas_size), plan.flow)},
          {"Density", octreeCost(anchors, plan.token_count)},
          {"Splats", splatDecoderCost(anchors, plan.token_count)}};
}

}  // namespace stipple
