#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "data/latent.h"
#include "generate/flow_network.h"
#include "generate/image_condition.h"
#include "train/networks/trained_flow_block.h"

namespace stipple {

/// generate/flow_network.h as it is trained: the velocity of a noisy latent, from an image.
class TrainedFlow {
 public:
  /// What forward() leaves for backward().
  struct Tape {
    std::vector<float> encoding, time_hidden, time_activated, time, time_silu, modulation;
    std::vector<std::vector<float>> noise, context, all;  ///< tokens before each block, and after
    std::array<std::vector<float>, 2> camera;  ///< [channels]: inside, before and after activation
    std::vector<float> scale, shift;           ///< [channels] of the last norms
    std::vector<float> normal;                 ///< [tokens + 1, channels]: the camera last
  };
  /// Derivatives by what a call was given; tokens [count, token width].
  struct InputGradients {
    std::vector<float> tokens, structure, colour;
    std::array<float, kCameraWidth> camera{};
  };

  /// Adds its tensors, by their published names.
  TrainedFlow(ParameterLayout& layout, const FlowSizes& sizes);

  /// In: state: a noisy latent at `time`, 0..1; condition. Out: the velocity, and tape.
  Latent forward(std::span<const float> values, const Latent& state, double time,
                 const ImageCondition& condition, Tape& tape) const;
  /// In: what forward() had and left; by: derivatives by the velocity. Out: gradients, which this
  /// adds to. Returns those by the state and the condition.
  InputGradients backward(std::span<const float> values, const Latent& state,
                          const ImageCondition& condition, const Tape& tape, const Latent& by,
                          std::span<float> gradients) const;

 private:
  void embedTime(std::span<const float> values, double time, Tape& tape) const;
  /// In: by_time [channels], by what embedTime() makes; by_modulation [6 channels].
  void backwardOfTime(std::span<const float> values, const Tape& tape, std::vector<float> by_time,
                      const std::vector<float>& by_modulation, std::span<float> gradients) const;
  LayerNorm headNorm(const Tape& tape) const;

  FlowSizes sizes_;
  size_t shift_table_ = 0;
  TrainedLinear time_in_, time_out_, modulation_;
  TrainedLinear input_, structure_, colour_, camera_in_, camera_out_;
  std::vector<TrainedFlowBlock> noise_refiners_, context_refiners_, blocks_;
  TrainedLinear token_head_, camera_head_;
};

/// An example of what the network learns: the state on the way from an object (time 0) to noise
/// (time 1), and its velocity there.
struct FlowExample {
  Latent state, velocity;
};

/// state = (1 - t) object + (s + (1 - s) t) noise, velocity = (1 - s) noise - object, s = 1e-5. In:
/// object and noise: of the same sizes; time 0..1.
FlowExample flowExample(const Latent& object, const Latent& noise, double time);

/// The sum of squared errors over `count` numbers in all, tokens and camera alike. Out: by: the
/// derivative by the seen velocity, written over.
double flowLoss(const Latent& seen, const Latent& expected, double count, Latent& by);

}  // namespace stipple
