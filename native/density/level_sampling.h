#pragma once

#include "density/anchor_sampling.h"

namespace stipple {

/// Samples any model level by level: it is asked only about cells that hold anchors,
/// questionCells() at a time. In: source: nullptr for numbers keyed by options.seed (parallel),
/// else where every number comes from (one thread, order of the specification). The options are
/// valid.
void sampleLevelByLevel(const DensityModel& model, const AnchorSamplingOptions& options,
                        UniformSource* source, Progress* progress, AnchorSet& anchors);

}  // namespace stipple
