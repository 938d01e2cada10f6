// Based on: Yan et al., Generative 3D Gaussians with Learned Density Control, arXiv 2605.16355, and
// its released code, for the blocks; Peebles, Xie, Scalable Diffusion Models with Transformers,
// ICCV 2023, for the modulation. Differs: tokens go through a block in pieces, so that no array is
// larger than the queries, keys and values of all tokens.
#include "generate/flow_block.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/activations.h"
#include "nn/attention.h"
#include "nn/norms.h"

namespace stipple {

namespace {

constexpr size_t kAngleGrain = 1 << 12;  // of cosines and sines in a task

size_t widestOf(const FlowBlockSizes& sizes) {
  return std::max(
      {sizes.mlp_width, sizes.channels, 2 * sizes.rotary_width + kFlowAxes * sizes.heads});
}

void reserveRows(const FlowBlockSizes& sizes, size_t rows, FlowBlockMemory& memory) {
  const size_t piece = std::min(rows, kFlowRowsAtATime);
  const auto grow = [](auto& values, size_t count) {
    if (values.size() < count) values.resize(count);
  };
  grow(memory.qkv, rows * 3 * sizes.channels);
  grow(memory.normed, piece * sizes.channels);
  grow(memory.wide, piece * widestOf(sizes));
}

/// The first axis has the frequencies of freqs_0, and so on; together they are the pairs of a head.
void readFrequencies(const WeightTable& weights, const std::string& name, size_t pairs,
                     std::vector<float>& frequencies, std::vector<uint8_t>& axes) {
  for (size_t axis = 0; axis < kFlowAxes; ++axis) {
    const std::vector<float> some =
        weights.floats(name + ".freqs_" + std::to_string(axis), {kAnySize});
    for (const float frequency : some) {
      frequencies.push_back(frequency);
      axes.push_back(static_cast<uint8_t>(axis));
    }
  }
  if (frequencies.size() == pairs) return;
  fail(ErrorCode::kFormat, weights.source() + ": " + name + ".freqs_0, freqs_1 and freqs_2 have " +
                               std::to_string(frequencies.size()) +
                               " numbers together; a head of " + std::to_string(2 * pairs) +
                               " channels has " + std::to_string(pairs) + " pairs");
}

}  // namespace

uint64_t flowBlockMemoryBytes(const FlowBlockSizes& sizes, uint64_t rows) {
  const uint64_t piece = std::min<uint64_t>(rows, kFlowRowsAtATime);
  return sizeof(float) *
         (rows * 3 * sizes.channels + piece * (2 * sizes.channels + widestOf(sizes)));
}

ContentRotary::ContentRotary(const WeightTable& weights, const std::string& name,
                             const FlowBlockSizes& sizes)
    : sizes_(sizes),
      norm_weight_(weights.floats(name + ".norm.weight", {sizes.channels})),
      norm_bias_(weights.floats(name + ".norm.bias", {sizes.channels})),
      gate_(weights, name + ".gate_map", sizes.channels, sizes.rotary_width, LinearBias::kNone),
      content_(weights, name + ".content_map", sizes.channels, sizes.rotary_width,
               LinearBias::kNone),
      final_(weights, name + ".final_map", sizes.rotary_width, kFlowAxes * sizes.heads,
             LinearBias::kNone) {
  readFrequencies(weights, name, sizes.head_width / 2, frequencies_, axes_);
}

void ContentRotary::angles(const NetworkRun& run, size_t rows, const float* h,
                           FlowBlockMemory& scratch, RotaryTable& table) const {
  const size_t width = sizes_.rotary_width;
  float* normed = scratch.normed.data();
  float* gate = scratch.wide.data();
  float* content = gate + rows * width;
  float* places = content + rows * width;  // [rows, heads, 3]
  LayerNorm norm;
  norm.width = sizes_.channels;
  norm.epsilon = kFlowRotaryEpsilon;
  norm.weight = norm_weight_;
  norm.bias = norm_bias_;
  layerNorm(norm, rows, h, normed);
  gate_.apply(run, rows, normed, gate);
  content_.apply(run, rows, normed, content);
  siluGate(rows * width, gate, content, content);
  final_.apply(run, rows, content, places);

  const size_t pairs = sizes_.head_width / 2;
  table.pairs = sizes_.heads * pairs;
  table.cosines.resize(rows * table.pairs);
  table.sines.resize(rows * table.pairs);
  parallelFor(rows, 1 + kAngleGrain / table.pairs, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      for (size_t head = 0; head < sizes_.heads; ++head) {
        const float* place = places + (r * sizes_.heads + head) * kFlowAxes;
        float* cosines = table.cosines.data() + r * table.pairs + head * pairs;
        float* sines = table.sines.data() + r * table.pairs + head * pairs;
        for (size_t i = 0; i < pairs; ++i) {
          const float angle = std::numbers::pi_v<float> * place[axes_[i]] * frequencies_[i];
          cosines[i] = std::cos(angle);
          sines[i] = std::sin(angle);
        }
      }
    }
  });
}

/// What a block does to norms and sums, at a time or always.
struct FlowBlock::Modulated {
  LayerNorm attention_norm, mlp_norm;
  std::span<const float> attention_gate, mlp_gate;  // empty for 1
  std::vector<float> numbers;                       // [6 channels] that the spans lie in
};

FlowBlock::FlowBlock(const WeightTable& weights, const std::string& block,
                     const std::string& rotary, const FlowBlockSizes& sizes,
                     FlowModulation modulation)
    : sizes_(sizes),
      rotary_(weights, rotary, sizes),
      qkv_(weights, block + ".attn.qkv", sizes.channels, 3 * sizes.channels),
      out_(weights, block + ".attn.out", sizes.channels, sizes.channels),
      mlp_in_(weights, block + ".mlp.mlp.0", sizes.channels, sizes.mlp_width),
      mlp_out_(weights, block + ".mlp.mlp.2", sizes.mlp_width, sizes.channels),
      q_gamma_(weights.floats(block + ".attn.q_norm.gamma", {sizes.heads, sizes.head_width})),
      k_gamma_(weights.floats(block + ".attn.k_norm.gamma", {sizes.heads, sizes.head_width})) {
  if (modulation == FlowModulation::kTime) {
    shift_table_ = weights.floats(block + ".shift_table", {1, 6 * sizes.channels});
    return;
  }
  norm1_weight_ = weights.floats(block + ".norm1.weight", {sizes.channels});
  norm1_bias_ = weights.floats(block + ".norm1.bias", {sizes.channels});
  norm2_weight_ = weights.floats(block + ".norm2.weight", {sizes.channels});
  norm2_bias_ = weights.floats(block + ".norm2.bias", {sizes.channels});
}

/// Queries, keys and values of some tokens. Out: qkv [rows, 3 channels].
void FlowBlock::makeQueries(const NetworkRun& run, size_t rows, const float* h,
                            const Modulated& time, FlowBlockMemory& memory, float* qkv) const {
  const size_t stride = 3 * sizes_.channels;
  rotary_.angles(run, rows, h, memory, memory.rotary);
  layerNorm(time.attention_norm, rows, h, memory.normed.data());
  qkv_.apply(run, rows, memory.normed.data(), qkv);
  float* keys = qkv + sizes_.channels;
  rotateAdjacent(memory.rotary, rows, sizes_.heads, sizes_.head_width, qkv, stride);
  rotateAdjacent(memory.rotary, rows, sizes_.heads, sizes_.head_width, keys, stride);
  rmsNormHeads(rows, sizes_.heads, sizes_.head_width, q_gamma_, qkv, stride);
  rmsNormHeads(rows, sizes_.heads, sizes_.head_width, k_gamma_, keys, stride);
}

/// The attention and the MLP of tokens [first, first + rows), added to them.
void FlowBlock::attendAndThink(const NetworkRun& run, size_t first, size_t rows, size_t all_rows,
                               float* h, const Modulated& time, std::span<const float> key_bias,
                               FlowBlockMemory& memory) const {
  const size_t channels = sizes_.channels;
  const size_t stride = 3 * channels;
  const float* qkv = memory.qkv.data();
  float* tokens = h + first * channels;
  float* normed = memory.normed.data();
  float* wide = memory.wide.data();
  attention(run, {sizes_.heads, sizes_.head_width, rows, all_rows}, {qkv + first * stride, stride},
            {qkv + channels, stride}, {qkv + 2 * channels, stride}, wide, channels, key_bias);
  out_.apply(run, rows, wide, normed);
  addScaled(rows, channels, time.attention_gate, normed, tokens);
  layerNorm(time.mlp_norm, rows, tokens, normed);
  mlp_in_.apply(run, rows, normed, wide);
  activate(Activation::kGeluTanh, {wide, rows * sizes_.mlp_width});
  mlp_out_.apply(run, rows, wide, normed);
  addScaled(rows, channels, time.mlp_gate, normed, tokens);
}

void FlowBlock::apply(const NetworkRun& run, size_t rows, float* h, std::span<const float> time,
                      std::span<const float> key_bias, FlowBlockMemory& memory, ProgressShare share,
                      const char* stage) const {
  const size_t channels = sizes_.channels;
  Modulated modulated;
  for (LayerNorm* norm : {&modulated.attention_norm, &modulated.mlp_norm}) {
    norm->width = channels;
    norm->epsilon = kFlowBlockEpsilon;
  }
  modulated.attention_norm.weight = norm1_weight_;
  modulated.attention_norm.bias = norm1_bias_;
  modulated.mlp_norm.weight = norm2_weight_;
  modulated.mlp_norm.bias = norm2_bias_;
  if (!shift_table_.empty()) {
    modulated.numbers = shift_table_;
    for (size_t i = 0; i < modulated.numbers.size(); ++i) modulated.numbers[i] += time[i];
    const std::span<const float> all = modulated.numbers;
    const auto part = [&](size_t k) { return all.subspan(k * channels, channels); };
    modulated.attention_norm.shift = part(0);
    modulated.attention_norm.scale = part(1);
    modulated.attention_gate = part(2);
    modulated.mlp_norm.shift = part(3);
    modulated.mlp_norm.scale = part(4);
    modulated.mlp_gate = part(5);
  }
  reserveRows(sizes_, rows, memory);
  // Multiplications for a token in either loop, which is how long each takes.
  const auto c = static_cast<double>(channels);
  const double before = 3 * c * c + c * static_cast<double>(2 * sizes_.rotary_width);
  const double after =
      c * c + 2 * c * static_cast<double>(sizes_.mlp_width) + 2 * c * static_cast<double>(rows);
  const double all = static_cast<double>(rows) * (before + after);
  const auto tell = [&](size_t made, size_t finished) {
    share.tell(run.progress,
               (static_cast<double>(made) * before + static_cast<double>(finished) * after) / all,
               stage);
  };
  for (size_t first = 0; first < rows; first += kFlowRowsAtATime) {
    tell(first, 0);
    makeQueries(run, std::min(kFlowRowsAtATime, rows - first), h + first * channels, modulated,
                memory, memory.qkv.data() + first * 3 * channels);
  }
  for (size_t first = 0; first < rows; first += kFlowRowsAtATime) {
    tell(rows, first);
    attendAndThink(run, first, std::min(kFlowRowsAtATime, rows - first), rows, h, modulated,
                   key_bias, memory);
  }
}

}  // namespace stipple
