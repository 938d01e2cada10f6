#pragma once

#include "densify/strategy.h"

namespace stipple {

/// Extent of the cameras, in the units of their reconstruction, of the scenes that densification is
/// published for: 4 to 6.
constexpr double kPublishedExtent = 5;

/// Metres that one unit of length of a publication is here. Lengths that are published as plain
/// numbers are multiplied by it, so that a fit does not depend on the unit of its scene. Without an
/// extent: 1.
inline double publishedUnit(const FitMoment& moment) {
  return moment.extent > 0 ? moment.extent / kPublishedExtent : 1.0;
}

}  // namespace stipple
