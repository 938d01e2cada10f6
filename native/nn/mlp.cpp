#include "nn/mlp.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "nn/kernels/matrix_kernel.h"
#include "nn/matmul.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;
constexpr size_t kMaxWidth = 65536;

/// Column sums of [batch, width], in double, rows in order. Columns in pieces of one cache line.
void sumRows(const float* values, size_t batch, size_t width, float* sums) {
  constexpr size_t kColumns = 16;
  parallelFor(width, kColumns, [&](size_t begin, size_t end) {
    double partial[kColumns] = {};
    for (size_t row = 0; row < batch; ++row) {
      const float* from = values + row * width;
      for (size_t i = begin; i < end; ++i) partial[i - begin] += static_cast<double>(from[i]);
    }
    for (size_t i = begin; i < end; ++i) sums[i] = static_cast<float>(partial[i - begin]);
  });
}

void transpose(const LinearLayer& layer, std::vector<float>& out) {
  out.resize(layer.weights.size());
  for (size_t i = 0; i < layer.inputs; ++i) {
    for (size_t o = 0; o < layer.outputs; ++o) {
      out[o * layer.inputs + i] = layer.weights[i * layer.outputs + o];
    }
  }
}

}  // namespace

Mlp::Mlp(std::span<const size_t> widths, uint64_t seed, float last_scale) {
  if (widths.size() < 2) {
    fail(ErrorCode::kInvalidArgument, "a network has " + std::to_string(widths.size()) +
                                          " widths; at least 2 are needed: input and output");
  }
  for (const size_t width : widths) {
    if (width >= 1 && width <= kMaxWidth) continue;
    fail(ErrorCode::kInvalidArgument,
         "a layer of a network is " + std::to_string(width) + " wide; 1 to 65536 is allowed");
  }
  uint64_t number = 0;
  for (size_t l = 0; l + 1 < widths.size(); ++l) {
    LinearLayer layer;
    layer.inputs = widths[l];
    layer.outputs = widths[l + 1];
    layer.weights.resize(layer.inputs * layer.outputs);
    layer.biases.assign(layer.outputs, 0.0f);
    const float bound = std::sqrt(6.0f / static_cast<float>(layer.inputs)) *
                        (l + 2 == widths.size() ? last_scale : 1.0f);
    for (float& weight : layer.weights) {
      const float u = unitFloat(keyedBits(seed, RandomUse::kNetworkStart, number++));
      weight = bound * (2.0f * u - 1.0f);
    }
    layers_.push_back(std::move(layer));
  }
}

Mlp::Mlp(std::vector<LinearLayer> layers) : layers_(std::move(layers)) {
  if (layers_.empty()) fail(ErrorCode::kFormat, "a network has 0 layers; at least 1 is needed");
  for (size_t l = 0; l < layers_.size(); ++l) {
    const LinearLayer& layer = layers_[l];
    const std::string name = "layer " + std::to_string(l) + " of the network";
    if (layer.inputs < 1 || layer.outputs < 1 || layer.inputs > kMaxWidth ||
        layer.outputs > kMaxWidth || layer.weights.size() != layer.inputs * layer.outputs ||
        layer.biases.size() != layer.outputs) {
      fail(ErrorCode::kFormat, name + " has " + std::to_string(layer.weights.size()) +
                                   " weights and " + std::to_string(layer.biases.size()) +
                                   " biases; " + std::to_string(layer.inputs) + " x " +
                                   std::to_string(layer.outputs) + " and " +
                                   std::to_string(layer.outputs) + " are needed");
    }
    if (l > 0 && layer.inputs != layers_[l - 1].outputs) {
      fail(ErrorCode::kFormat, name + " takes " + std::to_string(layer.inputs) +
                                   " numbers; the layer before gives " +
                                   std::to_string(layers_[l - 1].outputs));
    }
    requireFinite(layer.weights.data(), layer.weights.size(), layer.outputs, name.c_str());
    requireFinite(layer.biases.data(), layer.biases.size(), 1, name.c_str());
  }
}

std::vector<LinearLayer> Mlp::zeros() const {
  std::vector<LinearLayer> zeros = layers_;
  for (LinearLayer& layer : zeros) {
    std::fill(layer.weights.begin(), layer.weights.end(), 0.0f);
    std::fill(layer.biases.begin(), layer.biases.end(), 0.0f);
  }
  return zeros;
}

void Mlp::forward(std::span<const float> input, size_t batch, MlpTape& tape) const {
  const MatrixKernel kernel = chosenMatrixKernel();
  tape.batch = batch;
  tape.sums.resize(layers_.size());
  tape.activations.resize(layers_.size() - 1);
  const float* from = input.data();
  for (size_t l = 0; l < layers_.size(); ++l) {
    const LinearLayer& layer = layers_[l];
    std::vector<float>& sums = tape.sums[l];
    sums.resize(batch * layer.outputs);
    multiplyWith(kernel, {batch, layer.inputs, layer.outputs}, {from, layer.inputs},
                 {layer.weights.data(), layer.outputs}, {sums.data(), layer.outputs},
                 layer.biases.data());
    if (l + 1 == layers_.size()) return;
    std::vector<float>& activations = tape.activations[l];
    activations.resize(sums.size());
    parallelFor(sums.size(), kGrain, [&](size_t begin, size_t end) {
      kernel.silu(end - begin, &sums[begin], &activations[begin]);
    });
    from = activations.data();
  }
}

void Mlp::backward(std::span<const float> input, MlpTape& tape,
                   std::span<const float> output_gradient, std::vector<LinearLayer>& gradients,
                   std::span<float> input_gradient) const {
  const MatrixKernel kernel = chosenMatrixKernel();
  const size_t batch = tape.batch;
  std::vector<float>* above = &tape.gradients[0];
  std::vector<float>* below = &tape.gradients[1];
  above->assign(output_gradient.begin(), output_gradient.end());
  for (size_t l = layers_.size(); l-- > 0;) {
    const LinearLayer& layer = layers_[l];
    const float* from = l == 0 ? input.data() : tape.activations[l - 1].data();
    // Transposed by its strides: rows are the layer's inputs.
    multiplyWith(kernel, {layer.inputs, batch, layer.outputs}, {from, 1, layer.inputs},
                 {above->data(), layer.outputs}, {gradients[l].weights.data(), layer.outputs});
    sumRows(above->data(), batch, layer.outputs, gradients[l].biases.data());
    if (l == 0 && input_gradient.empty()) return;
    transpose(layer, tape.transposed);
    if (l > 0) below->resize(batch * layer.inputs);
    float* to = l == 0 ? input_gradient.data() : below->data();
    multiplyWith(kernel, {batch, layer.outputs, layer.inputs}, {above->data(), layer.outputs},
                 {tape.transposed.data(), layer.inputs}, {to, layer.inputs});
    if (l == 0) return;
    const std::vector<float>& sums = tape.sums[l - 1];
    parallelFor(sums.size(), kGrain, [&](size_t begin, size_t end) {
      kernel.siluBackward(end - begin, &sums[begin], &(*below)[begin]);
    });
    std::swap(above, below);
  }
}

}  // namespace stipple
