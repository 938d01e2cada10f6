#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "density/anchor_sampling.h"
#include "density/sampling_tables.h"

namespace stipple {

/// What sampling reads of an octree.
struct OctreeTables {
  std::span<const std::vector<uint64_t>> cells;  ///< [leaf level], Morton codes
  const SamplingTables& tables;
};

/// Samples an octree through its tables; the same bits as sampleLevelByLevel. The options are
/// valid.
void sampleOctree(const OctreeTables& octree, const AnchorSamplingOptions& options,
                  Progress* progress, AnchorSet& anchors);

}  // namespace stipple
