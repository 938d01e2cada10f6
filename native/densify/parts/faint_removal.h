#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

struct FaintRemovalOptions {
  double least_opacity = 0.005;  ///< fainter splats go
  /// Of the cameras' extent, or of the distance from their centre where that is more: larger splats
  /// go, once opacities have been reset; 0: none do. Nor do those of a cloud that takes no steps.
  double largest_share = 0.1;
  uint64_t size_after = 3000;  ///< iterations of 30,000 from which on size is judged
  /// Iterations of 30,000 from which on nothing goes any more; 0: until the last event.
  uint64_t until = 0;
  /// Once, in this iteration of 30,000, splats fainter than early_opacity go; 0: never.
  uint64_t early_at = 0;
  double early_opacity = 0.02;
};

/// Faint and huge splats go at every event, children that were just made too. Owns kRemoval.
/// Size is the largest scale in the world; sizes in the picture are not looked at, as the published
/// program forgets them before it looks. It judges a sky by the cameras' extent, too, so that none
/// may be large, and each camera gets a fog of its own in its place.
std::unique_ptr<ControlPart> makeFaintRemoval(const FaintRemovalOptions& options = {});

}  // namespace stipple
