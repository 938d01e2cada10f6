#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "generate/flow_block.h"
#include "nn/norms.h"
#include "train/networks/trained_layers.h"

namespace stipple {

/// generate/flow_block.h's ContentRotary as it is trained: a place for each head of a token, and
/// angles of it.
class TrainedRotary {
 public:
  struct Tape {
    std::vector<float> normal;         ///< [rows, channels]
    std::vector<float> gate, content;  ///< [rows, rotary width], before their product
    std::vector<float> product;        ///< [rows, rotary width]
    std::vector<float> places;         ///< [rows, heads, 3]
    RotaryTable table;
  };

  /// Adds `name`.freqs_0 to freqs_2, norm, gate_map, content_map and final_map.
  TrainedRotary(ParameterLayout& layout, const std::string& name, const FlowBlockSizes& sizes);

  /// In: h [rows, channels]. Out: tape, its table of angles among it.
  void apply(std::span<const float> values, size_t rows, const float* h, Tape& tape) const;
  /// In: h and tape of apply(); by_angles, as its table. Out: gradients and by_h [rows, channels],
  /// which this adds to. The derivative of an angle by the place is pi tanh(f) of its frequency f
  /// in place of pi f, as released; that by the frequency is as it is.
  void backward(std::span<const float> values, size_t rows, const float* h, const Tape& tape,
                std::span<const float> by_angles, std::span<float> gradients, float* by_h) const;

 private:
  LayerNorm normOf(std::span<const float> values) const;
  /// Where the frequency of pair i of a head lies, and of which coordinate it is.
  size_t frequencyAt(size_t i) const { return frequencies_[axisOf(i)] + i - first_[axisOf(i)]; }
  size_t axisOf(size_t i) const { return i < first_[1] ? 0 : i < first_[2] ? 1 : 2; }

  FlowBlockSizes sizes_;
  std::array<size_t, kFlowAxes> frequencies_{}, first_{};  ///< where they begin; first pairs
  size_t norm_weight_ = 0, norm_bias_ = 0;
  TrainedLinear gate_, content_, final_;
};

/// generate/flow_block.h's FlowBlock as it is trained.
class TrainedFlowBlock {
 public:
  /// In: block, rotary: names ("blocks.0", "repo_layers.0").
  TrainedFlowBlock(ParameterLayout& layout, const std::string& block, const std::string& rotary,
                   const FlowBlockSizes& sizes, FlowModulation modulation);

  /// In: h [rows, channels]; time [6 channels], empty for kNone. Returns [rows, channels].
  std::vector<float> apply(std::span<const float> values, std::span<const float> time,
                           const std::vector<float>& h) const;
  /// The block is run again. In: time and h as apply() had them; by_h: the derivative by what it
  /// made. Out: by_h: by `h`; gradients and by_time [6 channels] (null for kNone), which this adds
  /// to.
  void backward(std::span<const float> values, std::span<const float> time,
                const std::vector<float>& h, std::vector<float>& by_h, std::span<float> gradients,
                float* by_time) const;

 private:
  struct Modulated;
  struct Inside;

  Modulated modulatedBy(std::span<const float> values, std::span<const float> time) const;
  std::vector<float> run(std::span<const float> values, const Modulated& modulated,
                         const std::vector<float>& h, Inside& inside) const;
  /// In: by_made: the derivative by what attention gives. Out: by_normal, by its normalised
  /// tokens; by_h, which this adds to through the places of tokens.
  void backwardOfAttention(std::span<const float> values, const std::vector<float>& h,
                           const Inside& inside, const std::vector<float>& by_made,
                           std::vector<float>& by_normal, std::vector<float>& by_h,
                           std::span<float> gradients) const;

  FlowBlockSizes sizes_;
  FlowModulation modulation_;
  TrainedRotary rotary_;
  size_t shift_table_ = 0;                   ///< of kTime
  std::array<size_t, 2> weight_{}, bias_{};  ///< of the norms of kNone
  TrainedLinear to_all_;
  size_t query_gamma_ = 0, key_gamma_ = 0;
  TrainedLinear out_;
  TrainedMlp mlp_;
};

}  // namespace stipple
