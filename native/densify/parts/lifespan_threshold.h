#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

/// Up to this opacity a splat counts as not seen in a view.
constexpr double kVisibleOpacity = 0.05;

/// The share of the threshold of a splat with mean temporal scale s, held to 0..1, is
/// least + (1 - least) s^power.
struct LifespanThresholdOptions {
  double least = 0.75;  ///< of a splat that is there for a moment alone
  double power = 0.8;
};

/// A splat that lives for a short time multiplies at a weaker pull. Its lifespan is the mean of the
/// temporal scales that fade it in the views which show it, since the last event; one that no view
/// has shown, and all where nothing moves, have the whole threshold. Owns kThreshold. Statistics:
/// drawn splats and lifespans.
std::unique_ptr<ControlPart> makeLifespanThreshold(const LifespanThresholdOptions& options = {});

}  // namespace stipple
