#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

/// A strategy's own rates of Adam. Owns no role: it goes with everything.
std::unique_ptr<ControlPart> makeLearningRates(const LearningRates& rates);

}  // namespace stipple
