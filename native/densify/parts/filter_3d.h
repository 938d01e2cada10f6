#pragma once

#include <memory>
#include <span>
#include <vector>

#include "densify/control_part.h"
#include "math/camera.h"

namespace stipple {

class StrategySettings;

struct Filter3dOptions {
  /// Variance of the filter in units of the squared distance between two pixels' rays at the splat.
  /// Raising it smooths more.
  double variance = 0.2;
  uint64_t interval = 100;  ///< iterations of 30,000 between looks once events are over
  uint64_t last = 29900;    ///< of 30,000: no look from this one on
};

/// Splats are widened so that none is finer than what the views that see it can resolve, and
/// fainter by as much as they are larger, so that zooming in shows no needles. The splats of the
/// result are the widened ones. Sizes are taken from the cameras at the start, after every event,
/// and now and then later. Owns kFilter.
std::unique_ptr<ControlPart> makeFilter3d(const Filter3dOptions& options = {});
/// By its setting: variance.
std::unique_ptr<ControlPart> filter3d(StrategySettings& settings);

/// [N] standard deviation of the filter, metres: of the views that see a splat's centre in front of
/// their near plane and in the picture, or up to 15 % of a side beyond it, the one that resolves it
/// best. Those that no view sees get the largest of all; 0 where no view sees any. In: positions
/// [N,3]. Cost: O(N views).
std::vector<float> filterSizes(std::span<const float> positions,
                               std::span<const Camera* const> cameras, double variance);

}  // namespace stipple
