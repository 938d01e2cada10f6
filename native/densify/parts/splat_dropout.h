#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

class StrategySettings;

struct SplatDropoutOptions {
  double rate = 0.4;  ///< share of the splats that the last image leaves out, at most
  /// Fewer are left out where more views are learned from: no more than this over their number.
  double views = 5;
};

/// Each image that is learned from leaves some splats out, others in every iteration, and draws the
/// rest as much more opaque. Splats behind others are then seen and corrected too, and none counts
/// on what a few neighbours show to one view: with few views, views between them gain. The share
/// grows from 0 over the fit. Owns kDropout.
std::unique_ptr<ControlPart> makeSplatDropout(const SplatDropoutOptions& options = {});
/// By its settings: rate, views.
std::unique_ptr<ControlPart> splatDropout(StrategySettings& settings);

}  // namespace stipple
