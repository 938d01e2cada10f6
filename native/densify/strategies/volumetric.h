#pragma once

#include "densify/strategies/adaptive.h"

namespace stipple {

class StrategySettings;

/// Defaults: as published, and guards where the publication has none.
struct VolumeSplitOptions {
  double volume = 0.03;  ///< of the ellipsoid of one deviation, in cubed published units: larger
                         ///< splats are split
  /// Power of the condition number of the covariance that scales are divided by: 0.5 divides the
  /// covariance itself, as the published equation does; 1 divides scales, as its text says.
  double exponent = 0.5;
  /// Least and greatest factor by which children are smaller. Without the first, round splats would
  /// double at every event; without the second, needles would become dust.
  double least_shrink = 1.6;
  double largest_shrink = 10;
  uint64_t most_splats = 3400000;  ///< from which on none is split, beside the hard cap
};

/// After everything else that multiplies, splats of a large volume are replaced by two at random
/// places of their distribution, smaller by their elongation; the largest first where there is no
/// room for all. Without an extent of the cameras nothing is large. Owns kSecondSplit.
std::unique_ptr<ControlPart> makeVolumeSplit(const VolumeSplitOptions& options = {});

struct VolumetricOptions {
  AdaptiveOptions adaptive;
  VolumeSplitOptions split;
};

/// Adaptive density control that also splits by volume: "volumetric".
ControlAssembly volumetricControl(const VolumetricOptions& options = {});
/// With what the user sets: threshold, and what volumeSplit() takes.
ControlAssembly volumetricControl(StrategySettings& settings);

/// The part with what the user sets: volume, exponent, least_shrink, largest_shrink, cap.
std::unique_ptr<ControlPart> volumeSplit(StrategySettings& settings);

}  // namespace stipple
