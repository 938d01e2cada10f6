#pragma once

#include <memory>
#include <vector>

#include "model/splat_model.h"

namespace stipple {

/// Splats of an analytic density that all move with one velocity [3], metres per second, while time
/// is in the range.
std::shared_ptr<const SplatModel> makeDriftingSplats(std::vector<float> velocity,
                                                     const TimeRange& range);

}  // namespace stipple
