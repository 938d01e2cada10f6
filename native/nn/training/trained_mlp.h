#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "nn/activations.h"
#include "nn/training/trained_linear.h"

namespace stipple {

/// Two linear layers with an activation between them, each row by itself.
class TrainedMlp {
 public:
  /// What apply() leaves for backward(), [rows, hidden] each.
  struct Tape {
    std::vector<float> sums, activated;
  };
  struct Widths {
    size_t inputs = 0, hidden = 0, outputs = 0;
  };

  TrainedMlp() = default;
  /// Adds the tensors of both layers, by their names. In: precision, as TrainedLinear has it.
  TrainedMlp(ParameterLayout& layout, const std::string& first, const std::string& second,
             const Widths& widths, Activation activation,
             FactorPrecision precision = FactorPrecision::kFloat32);

  size_t outputs() const { return second_.outputs(); }
  /// In: in [rows, inputs]. Out: out [rows, outputs], apart from `in`.
  void apply(std::span<const float> values, size_t rows, const float* in, Tape& tape,
             float* out) const;
  /// In: in and tape of apply(). Out: gradients, which this adds to; in_gradient [rows, inputs],
  /// written over.
  void backward(std::span<const float> values, size_t rows, const float* in, const Tape& tape,
                const float* out_gradient, std::span<float> gradients, float* in_gradient) const;

 private:
  TrainedLinear first_, second_;
  Activation activation_ = Activation::kGeluTanh;
};

}  // namespace stipple
