#include "shot/instances.h"

namespace stipple {

uint64_t splatCount(const Instances& instances) {
  uint64_t count = 0;
  for (const SplatInstance& instance : instances.list) count += instance.cloud->size();
  return count;
}

bool compositesInDisplaySpace(const Instances& instances, BlendSpace blend_space) {
  return blend_space == BlendSpace::kAsTrained &&
         (instances.list.empty() ||
          instances.list.front().cloud->colour_space == ColourSpace::kDisplay);
}

}  // namespace stipple
