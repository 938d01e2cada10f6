#include "model/hierarchy_from_cloud.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "model/hierarchy_splats.h"
#include "train/loop/visibility.h"

namespace stipple {

std::shared_ptr<const SplatModel> hierarchyFromCloud(const BackendFactory& backends,
                                                     const std::shared_ptr<const SplatCloud>& cloud,
                                                     const HierarchyOptions& options,
                                                     Progress* progress) {
  std::vector<float> visibility;
  if (options.view_count > 0) {
    const std::vector<Camera> views = viewsForVisibility(backends, *cloud, options.rig);
    visibility = splatVisibility(backends, *cloud, views, progress);
  }
  auto tree = std::make_shared<const MergeTree>(
      buildMergeTree(*cloud, visibility, options.tree, progress));
  return makeHierarchySplats(std::make_shared<const HierarchyDecoder>(cloud, std::move(tree)));
}

uint64_t hierarchyMemoryBound(const BackendFactory& backends, const SplatCloud& cloud,
                              const HierarchyOptions& options) {
  // The images are over when the tree begins; what they found stays.
  const uint64_t images =
      options.view_count > 0 ? visibilityMemoryBound(backends, cloud, options.rig.size) : 0;
  const uint64_t visibility = options.view_count > 0 ? cloud.size() * sizeof(float) : 0;
  return std::max(images, mergeTreeMemoryBound(cloud.size(), cloud.sh_degree) + visibility);
}

}  // namespace stipple
