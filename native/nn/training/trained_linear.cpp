#include "nn/training/trained_linear.h"

#include "nn/training/column_sums.h"
#include "nn/training/narrow_product.h"
#include "nn/training/packed_product.h"

namespace stipple {

TrainedLinear::TrainedLinear(ParameterLayout& layout, const std::string& name, size_t inputs,
                             size_t outputs, LinearBias bias, FactorPrecision precision)
    : inputs_(inputs),
      outputs_(outputs),
      weight_(layout.add(name + ".weight", {outputs, inputs})),
      has_bias_(bias == LinearBias::kNeeded),
      precision_(precision) {
  if (has_bias_) bias_ = layout.add(name + ".bias", {outputs});
}

void TrainedLinear::apply(std::span<const float> values, size_t rows, const float* in,
                          float* out) const {
  const float* weight = values.data() + weight_;
  const float* bias = has_bias_ ? values.data() + bias_ : nullptr;
  if (precision_ == FactorPrecision::kBfloat16) {
    return applyNarrow({rows, inputs_, outputs_}, in, weight, bias, out);
  }
  multiplyPacked({rows, inputs_, outputs_}, {in, inputs_}, {weight, 1, inputs_}, {out, outputs_},
                 bias);
}

void TrainedLinear::backward(std::span<const float> values, size_t rows, const float* in,
                             const float* out_gradient, std::span<float> gradients,
                             float* in_gradient) const {
  const float* weight = values.data() + weight_;
  float* weight_gradient = gradients.data() + weight_;
  if (has_bias_)
    addColumnSums(
        rows, outputs_,
        [&](size_t row, double* part) {
          for (size_t i = 0; i < outputs_; ++i) {
            part[i] += static_cast<double>(out_gradient[row * outputs_ + i]);
          }
        },
        gradients.data() + bias_);
  if (precision_ == FactorPrecision::kBfloat16) {
    return backwardNarrow({rows, inputs_, outputs_}, in, weight, out_gradient, weight_gradient,
                          in_gradient);
  }
  addPacked({outputs_, rows, inputs_}, {out_gradient, 1, outputs_}, {in, inputs_},
            {weight_gradient, inputs_});
  if (in_gradient == nullptr) return;
  multiplyPacked({rows, outputs_, inputs_}, {out_gradient, outputs_}, {weight, inputs_},
                 {in_gradient, inputs_});
}

}  // namespace stipple
