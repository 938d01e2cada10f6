#pragma once

#include <memory>
#include <optional>

#include "densify/control_part.h"

namespace stipple {

/// Gradients are those of GradientWindow: per half picture, averaged over the views since the last
/// event that saw the splat.
struct ScreenPullOptions {
  Statistic copy_statistic = Statistic::kScreenGradients;
  double copy_threshold = 2e-4;  ///< from which on a small splat is copied
  Statistic split_statistic = Statistic::kScreenGradients;
  double split_threshold = 2e-4;  ///< from which on a large one is split
  double small_share = 0.01;      ///< of the cameras' extent: the largest scale of a small splat
  uint64_t late_after = 0;  ///< iteration of 30,000 after which both thresholds are ...; 0: never
  double late_share = 1;    ///< ... this share of themselves
  /// A view counts by how opaque it shows the splat, and not at all up to this opacity; absent: all
  /// views count alike.
  std::optional<double> least_opacity = {};
};

/// Splats multiply that views pull at. Owns kMultiplication, and goes by thresholds of single
/// splats. Statistics: kScreenGradients or kAbsoluteScreenGradients, and drawn splats where views
/// count by opacity. It is called "screen_pull", or "visibility_weighted_score" where they do.
std::unique_ptr<ControlPart> makeScreenPull(const ScreenPullOptions& options = {});

}  // namespace stipple
