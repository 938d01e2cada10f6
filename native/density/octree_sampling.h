#pragma once

#include "density/anchor_sampling.h"
#include "density/sampling_tables.h"

namespace stipple {

/// Samples an octree through its tables; the same bits as sampleLevelByLevel. The options are
/// valid.
void sampleOctree(const OctreeTables& octree, const AnchorSamplingOptions& options,
                  Progress* progress, AnchorSet& anchors);

}  // namespace stipple
