#pragma once

#include <cstdint>
#include <memory>

#include "densify/control_part.h"

namespace stipple {

/// Iterations, and numbers of them, are of a fit of 30,000.
struct MultiStepUpdateOptions {
  uint64_t every_until = 15000;  ///< a step in every iteration until then
  uint64_t few_until = 22500;    ///< and from there on one in `few`
  uint64_t few = 5;
  uint64_t many = 20;  ///< after that, one in so many
};

/// Once density control has ended, steps are taken for several views at once: their derivatives add
/// up, Adam follows the common direction, and the time of most steps is saved. In a fit of another
/// length as many steps are left out in proportion. Owns kSteps.
std::unique_ptr<ControlPart> makeMultiStepUpdate(const MultiStepUpdateOptions& options = {});

}  // namespace stipple
