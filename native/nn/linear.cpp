#include "nn/linear.h"

#include <algorithm>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/kernels/panel_kernel.h"
#include "nn/matrix_backend.h"
#include "nn/scratch.h"

namespace stipple {

namespace {

/// Outputs of a panel: as many as use a piece of the input again while it lies in a cache.
constexpr size_t kPanelOutputs = 256;
/// Rows of a task: a multiple of what kernels take at once (12), and few enough to share out.
constexpr size_t kTaskRows = 192;
/// Packed weights at a time: 16 MiB, whatever the layer, or one panel of it.
constexpr size_t kMostPacked = size_t{1} << 22;

/// Numbers of the input that are rounded to bfloat16 at a time: 32 MiB of them.
constexpr size_t kMostNarrow = size_t{1} << 24;
constexpr size_t kNarrowRows = 16;

/// Outputs of a task of few rows, a multiple of what kernels take at once (12), and inputs of a
/// piece: 96 KiB of widened weights stay in the second cache. Shorter pieces of a row of weights
/// come from memory by up to a third slower.
constexpr size_t kFewOutputs = 24;
constexpr size_t kFewInputs = 1024;
/// Inputs whose strips a task packs.
constexpr size_t kStripInputs = 128;

/// Strips of the rows' numbers, whose columns are the rows.
void packInputs(size_t strip, size_t inputs, size_t rows, const float* in, size_t in_stride,
                float* strips) {
  const size_t pieces = rangeCount(inputs, kStripInputs);
  parallelFor(rangeCount(rows, strip) * pieces, 1, [&](size_t begin, size_t end) {
    for (size_t task = begin; task < end; ++task) {
      const size_t row = task / pieces * strip;
      const size_t input = task % pieces * kStripInputs;
      packColumns(strip, std::min(kStripInputs, inputs - input), std::min(strip, rows - row),
                  in + row * in_stride + input, in_stride, strips + row * inputs + input * strip);
    }
  });
}

size_t roundedUp(size_t count, size_t unit) {
  return (count + unit - 1) / unit * unit;
}

}  // namespace

Linear::Linear(const WeightTable& weights, const std::string& name, uint64_t inputs,
               uint64_t outputs, LinearBias bias)
    : weights_(weights),
      name_(name + ".weight"),
      is_checked_(std::make_shared<std::atomic<bool>>(false)) {
  weight_ = &weights.require(name_, {outputs, inputs});
  outputs_ = static_cast<size_t>(weight_->shape[0]);
  inputs_ = static_cast<size_t>(weight_->shape[1]);
  if (bias == LinearBias::kNeeded) bias_ = weights.floats(name + ".bias", {outputs_});
}

void Linear::apply(const NetworkRun& run, size_t rows, const float* in, size_t in_stride,
                   float* out, size_t out_stride) const {
  if (precisionOf(run) == FactorPrecision::kFloat32) {
    if (rows <= kFewRows) return applyFew(run, rows, in, in_stride, out, out_stride);
    return applyRows(run, rows, in, in_stride, nullptr, out, out_stride);
  }
  // Each number of `in` is rounded once, not for each panel again.
  const size_t most_rows = std::max(kTaskRows, kMostNarrow / std::max<size_t>(inputs_, 1));
  const LayerKernel& kernel = chosenLayerKernel();
  for (size_t first = 0; first < rows; first += most_rows) {
    const size_t count = std::min(most_rows, rows - first);
    const float* from = in + first * in_stride;
    Scratch room((count * inputs_ + 1) / 2);
    auto* narrow = reinterpret_cast<uint16_t*>(room.data());
    parallelFor(count, kNarrowRows, [&](size_t begin, size_t end) {
      for (size_t row = begin; row < end; ++row) {
        kernel.narrow(inputs_, from + row * in_stride, narrow + row * inputs_);
      }
    });
    applyRows(run, count, from, in_stride, narrow, out + first * out_stride, out_stride);
  }
}

// The product of panels turned around: weights are the rows and the rows are the columns, so that
// weights are used in the order in which they lie. Each sum has the same terms in the same order as
// there: the bias, and then the inputs one after the other.
void Linear::applyFew(const NetworkRun& run, size_t rows, const float* in, size_t in_stride,
                      float* out, size_t out_stride) const {
  if (rows == 0) return;
  const PanelKernel& kernel = chosenPanelKernel();
  const auto widen = chosenLayerKernel().widen;
  const size_t strip = kernel.strip;
  const size_t columns = roundedUp(rows, strip);
  const uint64_t bytes = bytesOfNumber(weight_->type);
  const bool is_checked = is_checked_->load(std::memory_order_relaxed);
  Scratch strips(columns * inputs_);
  packInputs(strip, inputs_, rows, in, in_stride, strips.data());
  parallelFor(rangeCount(outputs_, kFewOutputs), 1, [&](size_t begin, size_t) {
    if (run.progress != nullptr) run.progress->throwIfCancelled();
    const size_t first = begin * kFewOutputs;
    const size_t outputs = std::min(kFewOutputs, outputs_ - first);
    if (!is_checked) {
      weights_.requireFinite(name_, *weight_, first * inputs_, outputs * inputs_);
    }
    Scratch room(kFewOutputs * (kFewInputs + columns));
    float* wide = room.data();
    float* sums = wide + kFewOutputs * kFewInputs;
    for (size_t o = 0; o < outputs; ++o) {
      std::fill_n(sums + o * columns, columns, bias_.empty() ? 0.0f : bias_[first + o]);
    }
    for (size_t input = 0; input < inputs_; input += kFewInputs) {
      const size_t count = std::min(kFewInputs, inputs_ - input);
      for (size_t o = 0; o < outputs; ++o) {
        const uint64_t number = (first + o) * inputs_ + input;
        widen(weight_->type, count, weight_->bytes + number * bytes, wide + o * kFewInputs);
      }
      for (size_t column = 0; column < columns; column += strip) {
        PanelProduct product;
        // Whole vectors, which a strip has two of.
        product.shape = {outputs, count, 2 * (rows - column) <= strip ? strip / 2 : strip};
        product.a = wide;
        product.a_stride = kFewInputs;
        product.b = strips.data() + column * inputs_ + input * strip;
        product.start = PanelStart::kSums;
        product.c = sums + column;
        product.c_stride = columns;
        kernel.multiply(product);
      }
    }
    for (size_t row = 0; row < rows; ++row) {
      float* to = out + row * out_stride + first;
      for (size_t o = 0; o < outputs; ++o) to[o] = sums[o * columns + row];
    }
  });
  is_checked_->store(true, std::memory_order_relaxed);
}

void Linear::applyRows(const NetworkRun& run, size_t rows, const float* in, size_t in_stride,
                       const uint16_t* narrow_in, float* out, size_t out_stride) const {
  const MatrixBackend& backend = backendOf(run);
  const FactorPrecision precision = precisionOf(run);
  // Each panel begins at a cache line.
  const size_t panel_size =
      roundedUp(backend.packedSize(inputs_, std::min(kPanelOutputs, outputs_), precision), 16);
  const size_t panels = rangeCount(outputs_, kPanelOutputs);
  const size_t most_panels = std::clamp<size_t>(kMostPacked / std::max<size_t>(panel_size, 1), 1,
                                                std::max<size_t>(panels, 1));
  const size_t row_tasks = rangeCount(rows, kTaskRows);
  const bool is_checked = is_checked_->load(std::memory_order_relaxed);
  Scratch packed(panel_size * most_panels);
  const auto outputsOf = [&](size_t panel) {
    return std::min(kPanelOutputs, outputs_ - panel * kPanelOutputs);
  };
  const auto throwIfCancelled = [&] {
    if (run.progress != nullptr) run.progress->throwIfCancelled();
  };
  for (size_t first = 0; first < panels; first += most_panels) {
    const size_t count = std::min(most_panels, panels - first);
    parallelFor(count, 1, [&](size_t begin, size_t) {
      throwIfCancelled();
      const size_t panel = first + begin;
      const size_t first_output = panel * kPanelOutputs;
      if (!is_checked) {
        weights_.requireFinite(name_, *weight_, first_output * inputs_, outputsOf(panel) * inputs_);
      }
      backend.pack(*weight_, inputs_, first_output, outputsOf(panel), precision,
                   packed.data() + begin * panel_size);
    });
    parallelFor(count * row_tasks, 1, [&](size_t begin, size_t) {
      throwIfCancelled();
      const size_t panel = begin / row_tasks;
      const size_t row = begin % row_tasks * kTaskRows;
      const size_t first_output = (first + panel) * kPanelOutputs;
      LinearPanel product;
      product.rows = std::min(kTaskRows, rows - row);
      product.inputs = inputs_;
      product.outputs = outputsOf(first + panel);
      product.in = in + row * in_stride;
      product.in_stride = in_stride;
      if (narrow_in != nullptr) product.narrow_in = narrow_in + row * inputs_;
      product.bias = bias_.empty() ? nullptr : bias_.data() + first_output;
      product.out = out + row * out_stride + first_output;
      product.out_stride = out_stride;
      backend.multiply(product, packed.data() + panel * panel_size, precision);
    });
  }
  is_checked_->store(true, std::memory_order_relaxed);
}

}  // namespace stipple
