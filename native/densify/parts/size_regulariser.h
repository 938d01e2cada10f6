#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

struct SizeRegulariserOptions {
  double opacity_weight = 0.01;  ///< of the mean opacity, in the loss
  double scale_weight = 0.01;    ///< of the mean scale, per published unit of length
};

/// Splats pay for being opaque and for being large, so that those which the pictures do not need
/// fade away. Owns kRegularisation.
std::unique_ptr<ControlPart> makeSizeRegulariser(const SizeRegulariserOptions& options = {});

}  // namespace stipple
