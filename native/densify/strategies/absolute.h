#pragma once

#include "densify/strategies/adaptive.h"

namespace stipple {

/// Those of adaptive control, but for what the constructor sets. Defaults: as published.
struct AbsoluteOptions : AdaptiveOptions {
  /// Large splats: from 0.001 of the cameras' extent on; they split at an absolute gradient of 4e-4
  /// (8e-4: fewer splats). Opacities are held to 0.8 every 500 iterations of 30,000.
  AbsoluteOptions();
};

/// Density control by absolute gradients: "absolute". As adaptive, but a large splat splits where
/// the sizes of what its pixels ask for add up, not where their sum points anywhere: pixels that
/// pull at it from all sides no longer cancel, so that blurred splats over fine texture are found.
ControlAssembly absoluteControl(const AbsoluteOptions& options = {});

}  // namespace stipple
