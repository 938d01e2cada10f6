#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

struct CloneOrSplitOptions {
  double split_shrink = 1.6;  ///< scale of a split splat over that of its children
};

/// What becomes of splats that multiply, as first published: an exact copy beside them, or two
/// children at random places of their distribution, smaller, instead of them. Owns kChildren.
/// Appended: copies, then the first child of every split splat, then the second.
std::unique_ptr<ControlPart> makeCloneOrSplit(const CloneOrSplitOptions& options = {});

/// Largest of a splat's logarithmic scales.
float largestLogScale(const RawSplats& splats, size_t row);

/// Logarithm of a share of the cameras' extent, to compare log-scales with; without an extent
/// nothing is large.
float logShareOfExtent(const FitMoment& moment, double share);

/// Moves appended row `row`, a copy of its parent, to a random place of its parent's distribution:
/// mean + R diag(s) n, n of the standard normal distribution, keyed by seed, iteration, the
/// parent's row and the number of the child.
void placeInDistribution(const FitMoment& moment, uint32_t parent, uint64_t child, size_t row,
                         RawSplats& children);

}  // namespace stipple
