// Based on: Yan et al., Generative 3D Gaussians with Learned Density Control, arXiv 2605.16355, and
// its released code, for the blocks and the rule of their places.
#include "train/networks/trained_flow_block.h"

#include <cmath>
#include <numbers>

#include "nn/activations.h"
#include "nn/attention.h"
#include "nn/training/attention_backward.h"
#include "nn/training/norms_backward.h"
#include "nn/training/rotary_backward.h"

namespace stipple {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

NetworkShape shapeOf(const FlowBlockSizes& sizes) {
  return {sizes.heads, sizes.head_width, 0, 0, sizes.mlp_width / sizes.channels};
}

}  // namespace

TrainedRotary::TrainedRotary(ParameterLayout& layout, const std::string& name,
                             const FlowBlockSizes& sizes)
    : sizes_(sizes) {
  const size_t pairs = sizes.head_width / 2, third = pairs / kFlowAxes;
  for (size_t axis = 0; axis < kFlowAxes; ++axis) {
    first_[axis] = axis * third;
    const size_t count = axis + 1 < kFlowAxes ? third : pairs - first_[axis];
    frequencies_[axis] = layout.add(name + ".freqs_" + std::to_string(axis), {count});
  }
  norm_weight_ = layout.add(name + ".norm.weight", {sizes.channels});
  norm_bias_ = layout.add(name + ".norm.bias", {sizes.channels});
  // In float32 whatever blocks have: places become angles of up to 16 pi for each unit.
  gate_ = TrainedLinear(layout, name + ".gate_map", sizes.channels, sizes.rotary_width,
                        LinearBias::kNone);
  content_ = TrainedLinear(layout, name + ".content_map", sizes.channels, sizes.rotary_width,
                           LinearBias::kNone);
  final_ = TrainedLinear(layout, name + ".final_map", sizes.rotary_width, kFlowAxes * sizes.heads,
                         LinearBias::kNone);
}

LayerNorm TrainedRotary::normOf(std::span<const float> values) const {
  return {sizes_.channels,
          kFlowRotaryEpsilon,
          values.subspan(norm_weight_, sizes_.channels),
          values.subspan(norm_bias_, sizes_.channels),
          {},
          {}};
}

void TrainedRotary::apply(std::span<const float> values, size_t rows, const float* h,
                          Tape& tape) const {
  const size_t inside = rows * sizes_.rotary_width, pairs = sizes_.head_width / 2;
  tape.normal.resize(rows * sizes_.channels);
  tape.gate.resize(inside);
  tape.content.resize(inside);
  tape.product.resize(inside);
  tape.places.resize(rows * sizes_.heads * kFlowAxes);
  layerNorm(normOf(values), rows, h, tape.normal.data());
  gate_.apply(values, rows, tape.normal.data(), tape.gate.data());
  content_.apply(values, rows, tape.normal.data(), tape.content.data());
  siluGate(inside, tape.gate.data(), tape.content.data(), tape.product.data());
  final_.apply(values, rows, tape.product.data(), tape.places.data());
  RotaryTable& table = tape.table;
  table.pairs = sizes_.heads * pairs;
  table.cosines.resize(rows * table.pairs);
  table.sines.resize(rows * table.pairs);
  for (size_t at = 0; at < rows * sizes_.heads; ++at) {
    for (size_t i = 0; i < pairs; ++i) {
      const float angle = kPi * tape.places[at * kFlowAxes + axisOf(i)] * values[frequencyAt(i)];
      table.cosines[at * pairs + i] = std::cos(angle);
      table.sines[at * pairs + i] = std::sin(angle);
    }
  }
}

void TrainedRotary::backward(std::span<const float> values, size_t rows, const float* h,
                             const Tape& tape, std::span<const float> by_angles,
                             std::span<float> gradients, float* by_h) const {
  const size_t inside = rows * sizes_.rotary_width, pairs = sizes_.head_width / 2;
  std::vector<float> by_places(tape.places.size(), 0.0f);
  std::vector<double> by_frequency(pairs, 0.0);
  std::vector<float> slopes(pairs);
  for (size_t i = 0; i < pairs; ++i) slopes[i] = std::tanh(values[frequencyAt(i)]);
  for (size_t at = 0; at < rows * sizes_.heads; ++at) {
    for (size_t i = 0; i < pairs; ++i) {
      const float by = kPi * by_angles[at * pairs + i];
      const size_t place = at * kFlowAxes + axisOf(i);
      by_places[place] += by * slopes[i];
      by_frequency[i] += static_cast<double>(by) * static_cast<double>(tape.places[place]);
    }
  }
  for (size_t i = 0; i < pairs; ++i) {
    gradients[frequencyAt(i)] += static_cast<float>(by_frequency[i]);
  }
  std::vector<float> by_product(inside), by_gate(inside), by_content(inside);
  final_.backward(values, rows, tape.product.data(), by_places.data(), gradients,
                  by_product.data());
  siluGate(inside, tape.gate.data(), by_product.data(), by_content.data());
  for (size_t i = 0; i < inside; ++i) by_gate[i] = by_product[i] * tape.content[i];
  activateBackward(Activation::kSilu, tape.gate, by_gate);
  std::vector<float> by_normal(rows * sizes_.channels), more(by_normal.size());
  gate_.backward(values, rows, tape.normal.data(), by_gate.data(), gradients, by_normal.data());
  content_.backward(values, rows, tape.normal.data(), by_content.data(), gradients, more.data());
  addScaled(rows, sizes_.channels, {}, more.data(), by_normal.data());
  layerNormBackward(normOf(values), rows, h, by_normal.data(),
                    {&gradients[norm_weight_], &gradients[norm_bias_], nullptr, nullptr}, by_h);
}

/// What a block does to norms and sums, at a time or always.
struct TrainedFlowBlock::Modulated {
  std::array<LayerNorm, 2> norms;               // of attention and MLP
  std::array<std::span<const float>, 2> gates;  // empty for 1
  std::vector<float> numbers;                   // [6 channels] that the spans lie in
};

/// What is inside a block, of one run.
struct TrainedFlowBlock::Inside {
  TrainedRotary::Tape rotary;
  std::vector<float> before_attention;  // [rows, channels]
  std::vector<float> rotated, normal;   // [rows, 3 channels]: before and after norms of heads
  std::vector<float> attended, made;    // [rows, channels]
  std::vector<float> middle;            // [rows, channels]: tokens between attention and MLP
  std::vector<float> before_mlp, passed;
  TrainedMlp::Tape mlp;
};

TrainedFlowBlock::TrainedFlowBlock(ParameterLayout& layout, const std::string& block,
                                   const std::string& rotary, const FlowBlockSizes& sizes,
                                   FlowModulation modulation)
    : sizes_(sizes),
      modulation_(modulation),
      rotary_(layout, rotary, sizes),
      to_all_(layout, block + ".attn.qkv", sizes.channels, 3 * sizes.channels, LinearBias::kNeeded,
              layout.precision()),
      query_gamma_(layout.add(block + ".attn.q_norm.gamma", {sizes.heads, sizes.head_width})),
      key_gamma_(layout.add(block + ".attn.k_norm.gamma", {sizes.heads, sizes.head_width})),
      out_(layout, block + ".attn.out", sizes.channels, sizes.channels, LinearBias::kNeeded,
           layout.precision()),
      mlp_(trainedTokenMlp(layout, block + ".mlp.mlp.", shapeOf(sizes))) {
  if (modulation == FlowModulation::kTime) {
    shift_table_ = layout.add(block + ".shift_table", {1, 6 * sizes.channels});
    return;
  }
  for (size_t i = 0; i < 2; ++i) {
    const std::string norm = block + ".norm" + std::to_string(i + 1);
    weight_[i] = layout.add(norm + ".weight", {sizes.channels});
    bias_[i] = layout.add(norm + ".bias", {sizes.channels});
  }
}

TrainedFlowBlock::Modulated TrainedFlowBlock::modulatedBy(std::span<const float> values,
                                                          std::span<const float> time) const {
  const size_t channels = sizes_.channels;
  Modulated made;
  if (modulation_ == FlowModulation::kTime) {
    const std::span<const float> table = values.subspan(shift_table_, 6 * channels);
    made.numbers.assign(table.begin(), table.end());
    for (size_t i = 0; i < made.numbers.size(); ++i) made.numbers[i] += time[i];
  }
  const std::span<const float> all = made.numbers;
  for (size_t i = 0; i < 2; ++i) {
    LayerNorm& norm = made.norms[i];
    norm.width = channels;
    norm.epsilon = kFlowBlockEpsilon;
    if (all.empty()) {
      norm.weight = values.subspan(weight_[i], channels);
      norm.bias = values.subspan(bias_[i], channels);
      continue;
    }
    norm.shift = all.subspan(3 * i * channels, channels);
    norm.scale = all.subspan((3 * i + 1) * channels, channels);
    made.gates[i] = all.subspan((3 * i + 2) * channels, channels);
  }
  return made;
}

std::vector<float> TrainedFlowBlock::run(std::span<const float> values, const Modulated& modulated,
                                         const std::vector<float>& h, Inside& inside) const {
  const size_t channels = sizes_.channels, rows = h.size() / channels, stride = 3 * channels;
  rotary_.apply(values, rows, h.data(), inside.rotary);
  inside.before_attention.resize(h.size());
  layerNorm(modulated.norms[0], rows, h.data(), inside.before_attention.data());
  inside.rotated.resize(rows * stride);
  to_all_.apply(values, rows, inside.before_attention.data(), inside.rotated.data());
  for (const size_t part : {size_t{0}, channels}) {
    rotateAdjacent(inside.rotary.table, rows, sizes_.heads, sizes_.head_width,
                   inside.rotated.data() + part, stride);
  }
  inside.normal = inside.rotated;
  float* normal = inside.normal.data();
  rmsNormHeads(rows, sizes_.heads, sizes_.head_width, values.subspan(query_gamma_, channels),
               normal, stride);
  rmsNormHeads(rows, sizes_.heads, sizes_.head_width, values.subspan(key_gamma_, channels),
               normal + channels, stride);
  inside.attended.resize(h.size());
  attention({}, {sizes_.heads, sizes_.head_width, rows, rows}, {normal, stride},
            {normal + channels, stride}, {normal + 2 * channels, stride}, inside.attended.data(),
            channels);
  inside.made.resize(h.size());
  out_.apply(values, rows, inside.attended.data(), inside.made.data());
  inside.middle = h;
  addScaled(rows, channels, modulated.gates[0], inside.made.data(), inside.middle.data());
  inside.before_mlp.resize(h.size());
  layerNorm(modulated.norms[1], rows, inside.middle.data(), inside.before_mlp.data());
  inside.passed.resize(h.size());
  mlp_.apply(values, rows, inside.before_mlp.data(), inside.mlp, inside.passed.data());
  std::vector<float> result = inside.middle;
  addScaled(rows, channels, modulated.gates[1], inside.passed.data(), result.data());
  return result;
}

std::vector<float> TrainedFlowBlock::apply(std::span<const float> values,
                                           std::span<const float> time,
                                           const std::vector<float>& h) const {
  Inside inside;
  return run(values, modulatedBy(values, time), h, inside);
}

void TrainedFlowBlock::backwardOfAttention(std::span<const float> values,
                                           const std::vector<float>& h, const Inside& inside,
                                           const std::vector<float>& by_made,
                                           std::vector<float>& by_normal, std::vector<float>& by_h,
                                           std::span<float> gradients) const {
  const size_t channels = sizes_.channels, rows = h.size() / channels, stride = 3 * channels;
  std::vector<float> by_attended(h.size()), by_all(rows * stride);
  out_.backward(values, rows, inside.attended.data(), by_made.data(), gradients,
                by_attended.data());
  const float* normal = inside.normal.data();
  attentionBackward({sizes_.heads, sizes_.head_width, rows, rows}, {normal, stride},
                    {normal + channels, stride}, {normal + 2 * channels, stride},
                    {inside.attended.data(), channels}, {by_attended.data(), channels},
                    {by_all.data(), stride}, {by_all.data() + channels, stride},
                    {by_all.data() + 2 * channels, stride});
  std::vector<float> by_angles(rows * inside.rotary.table.pairs, 0.0f);
  for (const size_t part : {size_t{0}, channels}) {
    const size_t gamma = part == 0 ? query_gamma_ : key_gamma_;
    const float* rotated = inside.rotated.data() + part;
    float* by = by_all.data() + part;
    rmsNormHeadsBackward(rows, sizes_.heads, sizes_.head_width, values.subspan(gamma, channels),
                         rotated, stride, by, stride, gradients.data() + gamma);
    rotateAdjacentBackward(inside.rotary.table, rows, sizes_.heads, sizes_.head_width, rotated,
                           stride, by, stride, by_angles);
  }
  to_all_.backward(values, rows, inside.before_attention.data(), by_all.data(), gradients,
                   by_normal.data());
  rotary_.backward(values, rows, h.data(), inside.rotary, by_angles, gradients, by_h.data());
}

void TrainedFlowBlock::backward(std::span<const float> values, std::span<const float> time,
                                const std::vector<float>& h, std::vector<float>& by_h,
                                std::span<float> gradients, float* by_time) const {
  const size_t channels = sizes_.channels, rows = h.size() / channels;
  const Modulated modulated = modulatedBy(values, time);
  Inside inside;
  run(values, modulated, h, inside);
  std::vector<float> by_modulation(6 * channels, 0.0f), by_branch(h.size()), by_normal(h.size());
  const bool is_timed = modulation_ == FlowModulation::kTime;
  const auto throughGate = [&](size_t i, const std::vector<float>& branch) {
    if (!is_timed) {
      by_branch = by_h;
      return;
    }
    addScaledBackward(rows, channels, modulated.gates[i], branch.data(), by_h.data(),
                      by_branch.data(), &by_modulation[(3 * i + 2) * channels]);
  };
  const auto throughNorm = [&](size_t i, const std::vector<float>& from) {
    LayerNormGradients of_norm;
    if (is_timed) {
      of_norm.shift = &by_modulation[3 * i * channels];
      of_norm.scale = &by_modulation[(3 * i + 1) * channels];
    } else {
      of_norm.weight = &gradients[weight_[i]];
      of_norm.bias = &gradients[bias_[i]];
    }
    layerNormBackward(modulated.norms[i], rows, from.data(), by_normal.data(), of_norm,
                      by_h.data());
  };
  throughGate(1, inside.passed);
  mlp_.backward(values, rows, inside.before_mlp.data(), inside.mlp, by_branch.data(), gradients,
                by_normal.data());
  throughNorm(1, inside.middle);
  throughGate(0, inside.made);
  backwardOfAttention(values, h, inside, by_branch, by_normal, by_h, gradients);
  throughNorm(0, h);
  if (!is_timed) return;
  for (size_t i = 0; i < by_modulation.size(); ++i) {
    gradients[shift_table_ + i] += by_modulation[i];
    by_time[i] += by_modulation[i];
  }
}

}  // namespace stipple
