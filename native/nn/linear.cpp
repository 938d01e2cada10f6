#include "nn/linear.h"

#include <algorithm>

#include "base/error.h"
#include "base/parallel.h"
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
  const MatrixBackend& backend = run.backend != nullptr ? *run.backend : defaultMatrixBackend();
  const Precision precision = backend.has(run.precision) ? run.precision : Precision::kFloat32;
  const size_t panel_size =
      backend.packedSize(inputs_, std::min(kPanelOutputs, outputs_), precision);
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
      product.bias = bias_.empty() ? nullptr : bias_.data() + first_output;
      product.out = out + row * out_stride + first_output;
      product.out_stride = out_stride;
      backend.multiply(product, packed.data() + panel * panel_size, precision);
    });
  }
  is_checked_->store(true, std::memory_order_relaxed);
}

}  // namespace stipple
