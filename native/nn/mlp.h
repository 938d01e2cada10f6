#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// One linear layer: out = in weights + biases.
struct LinearLayer {
  size_t inputs = 0;
  size_t outputs = 0;
  std::vector<float> weights;  ///< [inputs, outputs]
  std::vector<float> biases;   ///< [outputs]
};

/// What a forward pass leaves for the backward pass. Memory is used again by the next.
struct MlpTape {
  size_t batch = 0;
  /// Per layer [batch, outputs] before the activation; the last is the network's output.
  std::vector<std::vector<float>> sums;
  /// Per layer but the last [batch, outputs] after the activation.
  std::vector<std::vector<float>> activations;
  std::vector<float> gradients[2];  ///< of the sums, layer by layer in turn
  std::vector<float> transposed;    ///< weights of a layer

  std::span<float> output() { return sums.back(); }
};

/// A network of linear layers with SiLU, z / (1 + exp(-z)), between them.
class Mlp {
 public:
  Mlp() = default;
  /// In: widths: of the input, the hidden layers and the output, each 1 to 65536. Weights are
  /// uniform within +-sqrt(6 / inputs), keyed by the seed, those of the last layer times
  /// last_scale; biases are 0.
  Mlp(std::span<const size_t> widths, uint64_t seed, float last_scale = 1.0f);
  /// From stored layers. Errors: kFormat where sizes do not fit together.
  explicit Mlp(std::vector<LinearLayer> layers);

  size_t inputWidth() const { return layers_.front().inputs; }
  size_t outputWidth() const { return layers_.back().outputs; }
  std::vector<LinearLayer>& layers() { return layers_; }
  const std::vector<LinearLayer>& layers() const { return layers_; }
  /// As many numbers, all 0: for gradients and moments.
  std::vector<LinearLayer> zeros() const;

  /// In: input [batch, input width]. Out: tape.output().
  /// Threads and determinism: as multiply() (nn/matmul.h). Cost: O(batch * weights).
  void forward(std::span<const float> input, size_t batch, MlpTape& tape) const;

  /// In: what forward() got and left; output_gradient [batch, output width]. Out: gradients:
  /// derivatives by weights and biases, written over; input_gradient [batch, input width] or empty.
  void backward(std::span<const float> input, MlpTape& tape, std::span<const float> output_gradient,
                std::vector<LinearLayer>& gradients, std::span<float> input_gradient) const;

 private:
  std::vector<LinearLayer> layers_;
};

}  // namespace stipple
