#include "nn/training/trained_mlp.h"

namespace stipple {

TrainedMlp::TrainedMlp(ParameterLayout& layout, const std::string& first, const std::string& second,
                       const Widths& widths, Activation activation, FactorPrecision precision)
    : first_(layout, first, widths.inputs, widths.hidden, LinearBias::kNeeded, precision),
      second_(layout, second, widths.hidden, widths.outputs, LinearBias::kNeeded, precision),
      activation_(activation) {}

void TrainedMlp::apply(std::span<const float> values, size_t rows, const float* in, Tape& tape,
                       float* out) const {
  tape.sums.resize(rows * first_.outputs());
  first_.apply(values, rows, in, tape.sums.data());
  tape.activated = tape.sums;
  activate(activation_, tape.activated);
  second_.apply(values, rows, tape.activated.data(), out);
}

void TrainedMlp::backward(std::span<const float> values, size_t rows, const float* in,
                          const Tape& tape, const float* out_gradient, std::span<float> gradients,
                          float* in_gradient) const {
  std::vector<float> by_sums(rows * first_.outputs());
  second_.backward(values, rows, tape.activated.data(), out_gradient, gradients, by_sums.data());
  activateBackward(activation_, tape.sums, by_sums);
  first_.backward(values, rows, in, by_sums.data(), gradients, in_gradient);
}

}  // namespace stipple
