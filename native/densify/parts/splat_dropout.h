#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

class StrategySettings;

struct SplatDropoutOptions {
  double rate = 0.2;  ///< share of the splats that the last image leaves out
};

/// Each image that is learned from leaves some splats out, others in every iteration, and draws the
/// rest as much more opaque. Splats behind others are then seen and corrected too, and none counts
/// on what a few neighbours show to one view: with few views, views between them gain. The share
/// grows from 0 to `rate` over the fit. Owns kDropout.
std::unique_ptr<ControlPart> makeSplatDropout(const SplatDropoutOptions& options = {});
/// By its setting: rate.
std::unique_ptr<ControlPart> splatDropout(StrategySettings& settings);

}  // namespace stipple
