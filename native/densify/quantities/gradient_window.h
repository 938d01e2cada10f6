#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "data/tensor_table.h"
#include "densify/control_part.h"

namespace stipple {

/// Averages of how strongly views pull at each splat's place in the picture, over the views since
/// the last edit that saw it. Unit: derivatives by normalised device coordinates, that is those per
/// pixel times half the picture's sides, so that thresholds hold at any resolution.
/// Source: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting, SIGGRAPH 2023, section
/// 5.2.
class GradientWindow {
 public:
  /// In: statistic: kScreenGradients or kAbsoluteScreenGradients, whose lengths are averaged.
  /// least_opacity: where given, a view counts by how opaque the splat is drawn in it, and not at
  /// all up to this; views must have drawn splats then.
  explicit GradientWindow(Statistic statistic, std::optional<double> least_opacity = {})
      : statistic_(statistic), least_opacity_(least_opacity) {}

  /// Errors: kInternal for another number of splats than before.
  void add(const ViewStatistics& view);

  /// Errors: kInternal for another number of splats than before, as where an edit was not applied.
  void requireCount(size_t count) const;

  /// Forgets everything, for this many splats from now on.
  void reset(size_t count);

  /// After an edit: an event, and another number of splats, begin a new window.
  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before);

  size_t size() const { return sums_.size(); }
  /// Views that saw the splat.
  uint32_t viewCount(size_t splat) const { return counts_[splat]; }
  /// 0 where no view has seen the splat.
  float average(size_t splat) const {
    if (counts_[splat] == 0) return 0.0f;
    return sums_[splat] / (least_opacity_ ? weights_[splat] : static_cast<float>(counts_[splat]));
  }

  std::vector<float> averages() const;  ///< [N]

  /// "gradient_sums" and "visible_counts", of opacities also "opacity_sums". Errors of take:
  /// kFormat.
  void put(TensorTable& table) const;
  void take(const TensorTable& table);

 private:
  Statistic statistic_;
  std::optional<double> least_opacity_;
  std::vector<float> sums_;       ///< [N]
  std::vector<float> weights_;    ///< [N] of opacities, where views count by them
  std::vector<uint32_t> counts_;  ///< [N]
};

}  // namespace stipple
