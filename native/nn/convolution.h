#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "data/weight_table.h"
#include "nn/feature_map.h"
#include "nn/group_norm.h"
#include "nn/network_run.h"

namespace stipple {

/// How a convolution walks over a map; rows as columns.
struct ConvolutionGrid {
  size_t kernel = 3;      ///< side of the square that an output sees
  size_t stride = 1;      ///< from one output to the next
  size_t pad_before = 1;  ///< zeros above and on the left
  size_t pad_after = 1;   ///< zeros below and on the right

  /// How many outputs `size` pixels have; 0 where there are too few.
  size_t outputs(size_t size) const {
    const size_t padded = size + pad_before + pad_after;
    return padded < kernel ? 0 : (padded - kernel) / stride + 1;
  }
};
constexpr ConvolutionGrid kPixelGrid = {1, 1, 0, 0};  ///< of a 1x1 convolution

/// What becomes of what is in `out`.
enum class ConvolutionResult { kReplaces, kAdds };

/// A convolution of a file: weight [outputs, inputs, kernel, kernel] as PyTorch stores it, and bias
/// [outputs]. The weight stays in the file; it is widened and packed while it is used.
class Convolution {
 public:
  Convolution() = default;
  /// Reads `name`.weight and `name`.bias. In: inputs, outputs: as the network needs them, kAnySize
  /// where the file decides. Errors: kFormat (WeightTable::require).
  Convolution(const WeightTable& weights, const std::string& name, uint64_t inputs,
              uint64_t outputs, const ConvolutionGrid& grid);

  size_t inputs() const { return inputs_; }
  size_t outputs() const { return outputs_; }
  size_t stride() const { return grid_.stride; }
  /// How many pixels come out along a side of so many, 0 where there are too few.
  size_t outputSide(size_t side) const { return grid_.outputs(side); }
  /// Multiplications and additions for a map of that size.
  double flops(size_t height, size_t width) const;
  /// The map that comes out of one of that size, not initialised. Errors: kInvalidArgument where
  /// it would be empty.
  FeatureMap resultFor(const FeatureMap& in) const;
  /// In: in, of inputs() channels; norm: null, or what is applied to `in` while it is read,
  /// followed by SiLU (zeros of the padding stay zeros). Out: out, as of resultFor(), apart from
  /// `in`. Errors: kInvalidArgument; kFormat for NaN or infinity among the weights; kCancelled.
  /// Threads and determinism: parallel over tiles of outputs; same bits for any number of threads.
  /// Memory: weights packed, 16 MiB at a time or 256 outputs of them; for each thread 256 outputs
  /// of the weight while they are packed, then 96 rows of kernel² inputs and a tile of the map of
  /// (8 stride + kernel) x (24 stride + kernel) pixels.
  void apply(const NetworkRun& run, const FeatureMap& in, const ChannelNorm* norm, FeatureMap& out,
             ConvolutionResult result = ConvolutionResult::kReplaces) const;
  /// The same into a new map.
  FeatureMap apply(const NetworkRun& run, const FeatureMap& in,
                   const ChannelNorm* norm = nullptr) const;

 private:
  void pack(const NetworkRun& run, size_t first_output, size_t count, float* packed) const;

  WeightTable weights_;  // keeps the file
  std::string name_;
  const WeightTensor* weight_ = nullptr;
  std::vector<float> bias_;
  ConvolutionGrid grid_;
  size_t inputs_ = 0;
  size_t outputs_ = 0;
};

}  // namespace stipple
