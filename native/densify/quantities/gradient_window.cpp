#include "densify/quantities/gradient_window.h"

#include <cmath>
#include <functional>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/state_arrays.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

}  // namespace

void GradientWindow::add(const ViewStatistics& view) {
  const size_t count = view.visible.size();
  if (sums_.empty()) reset(count);
  requireCount(count);
  const std::span<const float> gradients = view.of(statistic_);
  const float half_width = 0.5f * static_cast<float>(view.width);
  const float half_height = 0.5f * static_cast<float>(view.height);
  const std::span<const float> opacities = view.splats.opacities;
  const float least = static_cast<float>(least_opacity_.value_or(0));
  const auto add_range = [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (!view.visible[i]) continue;
      const float x = gradients[i * 2] * half_width;
      const float y = gradients[i * 2 + 1] * half_height;
      if (least_opacity_) {
        if (!(opacities[i] > least)) continue;
        sums_[i] += opacities[i] * std::hypot(x, y);
        weights_[i] += opacities[i];
      } else {
        sums_[i] += std::hypot(x, y);
      }
      ++counts_[i];
    }
  };
  // By reference: a std::function of a large capture allocates.
  parallelFor(count, kGrain, std::cref(add_range));
}

void GradientWindow::requireCount(size_t count) const {
  if (sums_.size() == count) return;
  fail(ErrorCode::kInternal, "the strategy's statistics are of " + std::to_string(sums_.size()) +
                                 " splats, not of " + std::to_string(count));
}

void GradientWindow::edited(const ControlMoment& moment, const SplatEdit& edit,
                            size_t count_before) {
  const size_t count = edit.countAfter(count_before);
  if (moment.is_event || count != count_before) reset(count);
}

void GradientWindow::reset(size_t count) {
  sums_.assign(count, 0.0f);
  if (least_opacity_) weights_.assign(count, 0.0f);
  counts_.assign(count, 0);
}

std::vector<float> GradientWindow::averages() const {
  std::vector<float> values(size());
  for (size_t i = 0; i < values.size(); ++i) values[i] = average(i);
  return values;
}

void GradientWindow::put(TensorTable& table) const {
  table["gradient_sums"] = {{sums_.size()}, sums_};
  table["visible_counts"] = {{counts_.size()}, counts_};
  if (least_opacity_) table["opacity_sums"] = {{weights_.size()}, weights_};
}

void GradientWindow::take(const TensorTable& table) {
  std::vector<float> sums = stateSums<float>(table, "gradient_sums");
  std::vector<uint32_t> counts = stateArray<uint32_t>(table, "visible_counts");
  requireAsMany(sums.size(), "gradient_sums", counts.size(), "visible_counts");
  if (least_opacity_) {
    std::vector<float> weights = stateSums<float>(table, "opacity_sums");
    requireAsMany(sums.size(), "gradient_sums", weights.size(), "opacity_sums");
    weights_ = std::move(weights);
  }
  sums_ = std::move(sums);
  counts_ = std::move(counts);
}

}  // namespace stipple
