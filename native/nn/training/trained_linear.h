#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "nn/linear.h"
#include "nn/training/parameter_layout.h"

namespace stipple {

/// A linear layer that is trained: out = in weightᵀ + bias, weight [outputs, inputs] as PyTorch
/// stores it. It knows where its numbers are in arrays of a ParameterLayout.
class TrainedLinear {
 public:
  TrainedLinear() = default;
  /// Adds `name`.weight and, where it is needed, `name`.bias. In: precision, of the factors of its
  /// products; in blocks that of the layout.
  TrainedLinear(ParameterLayout& layout, const std::string& name, size_t inputs, size_t outputs,
                LinearBias bias = LinearBias::kNeeded,
                FactorPrecision precision = FactorPrecision::kFloat32);

  size_t inputs() const { return inputs_; }
  size_t outputs() const { return outputs_; }
  /// In: values of the layout; in [rows, inputs]. Out: out [rows, outputs], apart from `in`.
  /// Threads and determinism: parallel; same bits for any number of threads.
  void apply(std::span<const float> values, size_t rows, const float* in, float* out) const;
  /// In: in as given to apply(); out_gradient [rows, outputs]. Out: gradients of the layout, which
  /// this adds to; in_gradient [rows, inputs], written over, or null where nobody wants it.
  void backward(std::span<const float> values, size_t rows, const float* in,
                const float* out_gradient, std::span<float> gradients, float* in_gradient) const;

 private:
  size_t inputs_ = 0, outputs_ = 0;
  size_t weight_ = 0, bias_ = 0;  ///< where they begin
  bool has_bias_ = false;
  FactorPrecision precision_ = FactorPrecision::kFloat32;
};

}  // namespace stipple
