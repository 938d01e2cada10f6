#include "nn/training/trained_linear.h"

#include "base/parallel.h"
#include "nn/scratch.h"
#include "nn/training/column_sums.h"
#include "nn/training/packed_product.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

}  // namespace

TrainedLinear::TrainedLinear(ParameterLayout& layout, const std::string& name, size_t inputs,
                             size_t outputs, LinearBias bias)
    : inputs_(inputs),
      outputs_(outputs),
      weight_(layout.add(name + ".weight", {outputs, inputs})),
      has_bias_(bias == LinearBias::kNeeded) {
  if (has_bias_) bias_ = layout.add(name + ".bias", {outputs});
}

void TrainedLinear::apply(std::span<const float> values, size_t rows, const float* in,
                          float* out) const {
  multiplyPacked({rows, inputs_, outputs_}, {in, inputs_}, {values.data() + weight_, 1, inputs_},
                 {out, outputs_}, has_bias_ ? values.data() + bias_ : nullptr);
}

void TrainedLinear::backward(std::span<const float> values, size_t rows, const float* in,
                             const float* out_gradient, std::span<float> gradients,
                             float* in_gradient) const {
  Scratch made(inputs_ * outputs_);
  multiplyPacked({outputs_, rows, inputs_}, {out_gradient, 1, outputs_}, {in, inputs_},
                 {made.data(), inputs_});
  float* weight_gradient = gradients.data() + weight_;
  parallelFor(inputs_ * outputs_, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) weight_gradient[i] += made.data()[i];
  });
  if (has_bias_)
    addColumnSums(
        rows, outputs_,
        [&](size_t row, double* part) {
          for (size_t i = 0; i < outputs_; ++i) {
            part[i] += static_cast<double>(out_gradient[row * outputs_ + i]);
          }
        },
        gradients.data() + bias_);
  if (in_gradient == nullptr) return;
  multiplyPacked({rows, outputs_, inputs_}, {out_gradient, outputs_},
                 {values.data() + weight_, inputs_}, {in_gradient, inputs_});
}

}  // namespace stipple
