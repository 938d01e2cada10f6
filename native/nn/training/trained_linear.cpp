#include "nn/training/trained_linear.h"

#include <algorithm>

#include "base/parallel.h"
#include "nn/matmul.h"
#include "nn/scratch.h"
#include "nn/training/column_sums.h"

namespace stipple {

namespace {

/// Sides of a square that a task turns over: both fit in the nearest cache.
constexpr size_t kSquare = 32;
constexpr size_t kGrain = 1 << 14;

/// out [columns, rows] = in [rows, columns], turned over.
void transpose(size_t rows, size_t columns, const float* in, float* out) {
  parallelFor(rows, kSquare, [&](size_t begin, size_t end) {
    for (size_t first = 0; first < columns; first += kSquare) {
      const size_t last = std::min(first + kSquare, columns);
      for (size_t row = begin; row < end; ++row) {
        for (size_t column = first; column < last; ++column) {
          out[column * rows + row] = in[row * columns + column];
        }
      }
    }
  });
}

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
  Scratch turned(inputs_ * outputs_);
  transpose(outputs_, inputs_, values.data() + weight_, turned.data());
  multiply({rows, inputs_, outputs_}, {in, inputs_}, {turned.data(), outputs_}, {out, outputs_},
           has_bias_ ? values.data() + bias_ : nullptr);
}

void TrainedLinear::backward(std::span<const float> values, size_t rows, const float* in,
                             const float* out_gradient, std::span<float> gradients,
                             float* in_gradient) const {
  Scratch made(inputs_ * outputs_);
  multiply({outputs_, rows, inputs_}, {out_gradient, 1, outputs_}, {in, inputs_},
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
  multiply({rows, outputs_, inputs_}, {out_gradient, outputs_}, {values.data() + weight_, inputs_},
           {in_gradient, inputs_});
}

}  // namespace stipple
