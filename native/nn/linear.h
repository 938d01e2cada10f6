#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "data/weight_table.h"
#include "nn/network_run.h"

namespace stipple {

enum class LinearBias { kNeeded, kNone };

/// A linear layer of a file: out = in weightᵀ + bias, weight [outputs, inputs] as PyTorch stores
/// it. The weight stays in the file. For many rows it is widened and packed a panel at a time while
/// it is used; for few, in float32, our own kernels multiply by it as it goes by.
class Linear {
 public:
  /// So many rows are few.
  static constexpr size_t kFewRows = 256;

  Linear() = default;
  /// Reads `name`.weight and `name`.bias. In: inputs, outputs: as the network needs them, kAnySize
  /// where the file decides. Errors: kFormat (WeightTable::require).
  Linear(const WeightTable& weights, const std::string& name, uint64_t inputs, uint64_t outputs,
         LinearBias bias = LinearBias::kNeeded);

  size_t inputs() const { return inputs_; }
  size_t outputs() const { return outputs_; }
  /// In: in [rows, inputs], `in_stride` floats from row to row. Out: out [rows, outputs], likewise;
  /// apart from `in`. The first use looks at all weights. Errors: kFormat for NaN or infinity among
  /// them; kCancelled.
  /// Threads and determinism: parallel; same bits for any number of threads. By `highway` a row has
  /// the same bits whatever rows are beside it; other backends sum in an order of their own, but
  /// not few rows in float32.
  void apply(const NetworkRun& run, size_t rows, const float* in, size_t in_stride, float* out,
             size_t out_stride) const;
  /// Rows without gaps.
  void apply(const NetworkRun& run, size_t rows, const float* in, float* out) const {
    apply(run, rows, in, inputs_, out, outputs_);
  }

 private:
  void applyFew(const NetworkRun& run, size_t rows, const float* in, size_t in_stride, float* out,
                size_t out_stride) const;
  void applyRows(const NetworkRun& run, size_t rows, const float* in, size_t in_stride,
                 const uint16_t* narrow_in, float* out, size_t out_stride) const;

  WeightTable weights_;  // keeps the file
  std::string name_;
  const WeightTensor* weight_ = nullptr;
  std::shared_ptr<std::atomic<bool>> is_checked_;  // whether weights are known to be finite
  std::vector<float> bias_;
  size_t inputs_ = 0;
  size_t outputs_ = 0;
};

}  // namespace stipple
