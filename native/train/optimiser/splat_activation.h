#pragma once

#include "data/clouds/splat_cloud.h"
#include "densify/raw_splats.h"
#include "densify/strategy.h"

// Between raw numbers and stored values, both ways.

namespace stipple {

/// The arrays of derivatives, which are shaped as the cloud.
CloudGradient spansOf(SplatCloud& gradients);

/// Writes stored scales and opacities; positions, rotations and harmonics are the same numbers raw
/// and stored and are left alone.
void activateShapes(const RawSplats& raw, SplatCloud& cloud);

/// Writes every array of the cloud but its harmonics, through `how` too.
void activateWith(const RawSplats& raw, const Parameterisation& how, SplatCloud& cloud);

/// Derivatives by stored scales and opacities become those by raw ones, in place.
void throughActivations(const SplatCloud& cloud, SplatCloud& gradients);

/// The same into an array of raw splats of their own, all but the harmonics, through `how` too. In:
/// by_cloud, by stored values.
void throughActivations(const RawSplats& raw, const SplatCloud& cloud, const Parameterisation& how,
                        SplatCloud& by_cloud, RawSplats& by_raw);

}  // namespace stipple
