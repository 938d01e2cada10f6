#include "model/stored_octree.h"

#include <utility>

namespace stipple {

OctreeTensors storedOctree(const OctreeDensity& density) {
  OctreeTensors octree;
  octree.root_origin = density.root().origin;
  octree.root_side = density.root().side;
  for (int level = 0; level < density.leafLevel(); ++level) {
    const auto cells = density.cells(level);
    const auto log_probabilities = density.logProbabilities(level);
    octree.cells.emplace_back(cells.begin(), cells.end());
    octree.log_probabilities.emplace_back(log_probabilities.begin(), log_probabilities.end());
  }
  return octree;
}

std::shared_ptr<const OctreeDensity> octreeFromStored(OctreeTensors& stored) {
  return std::make_shared<const OctreeDensity>(
      OctreeDensity::fromLevels({stored.root_origin, stored.root_side}, std::move(stored.cells),
                                std::move(stored.log_probabilities)));
}

}  // namespace stipple
