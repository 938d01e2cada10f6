#pragma once

#include <cstdint>
#include <memory>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "decode/tree/merge_tree.h"
#include "model/splat_model.h"
#include "train/backend/backend_factory.h"
#include "train/loop/view_rig.h"

namespace stipple {

/// How a cloud becomes a hierarchy.
struct HierarchyOptions {
  /// The views that say how much of each splat is seen.
  ViewRigOptions rig;
  uint32_t view_count = 0;  ///< 0: all splats count as seen
  MergeTreeOptions tree;
};

/// The hierarchy of a cloud of at least one splat: what views see of its splats, then the tree of
/// their merges. Errors: kCancelled.
/// Threads and determinism: parallel; same result for any number of threads.
std::shared_ptr<const SplatModel> hierarchyFromCloud(const BackendFactory& backends,
                                                     const std::shared_ptr<const SplatCloud>& cloud,
                                                     const HierarchyOptions& options,
                                                     Progress* progress);

/// Bytes that hierarchyFromCloud() holds at most, without the cloud.
uint64_t hierarchyMemoryBound(const BackendFactory& backends, const SplatCloud& cloud,
                              const HierarchyOptions& options);

}  // namespace stipple
