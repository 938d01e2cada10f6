#pragma once

#include <cstdint>
#include <memory>

#include "densify/strategy.h"

namespace stipple {

/// Iterations are those of a fit of 30,000 (scaleSchedule). Defaults: as published.
struct AdaptiveOptions {
  uint64_t first = 500;     ///< splats are added and removed after this iteration
  uint64_t last = 15000;    ///< and before this one
  uint64_t interval = 100;  ///< iterations from one edit to the next
  /// Steps from one edit to the next at least, however short the fit: new splats must have taken
  /// their places, and views been seen, before the pulls say where more are needed; else the count
  /// doubles with every edit.
  uint64_t least_interval = 100;
  /// Mean length of the screen gradient, per half picture, from which on a splat is too few for
  /// what it covers. Raising it makes fewer splats.
  double gradient_threshold = 2e-4;
  double small_share = 0.01;     ///< of the extent: larger splats are split, others copied
  double split_shrink = 1.6;     ///< scale of a split splat over that of its children
  double least_opacity = 0.005;  ///< fainter splats are removed
  double largest_share = 0.1;    ///< of the extent: larger splats are removed, once opacities have
                                 ///< been reset
  uint64_t reset_interval = 3000;
  double reset_opacity = 0.01;  ///< what no opacity exceeds after a reset
  /// Resets of a short fit that come sooner after each other than this are left out: an opacity
  /// takes (logit 0.9 - logit 0.01) / 0.05 = 136 steps back, and a fit that is half way back learns
  /// from pictures of fog.
  uint64_t least_reset_steps = 300;
};

/// Adaptive density control: "adaptive". Splats that the views pull at are copied where they are
/// small and split where they are large, faint and huge ones go, and opacities are lowered now and
/// then so that those which nothing needs stay faint. Where an edit would exceed max_splats, the
/// splats that are pulled at most are the ones that multiply.
std::unique_ptr<Strategy> makeAdaptive(const AdaptiveOptions& options = {});

}  // namespace stipple
