#pragma once

#include <memory>

#include "density/octree_density.h"
#include "io/assets/octree_tensors.h"

namespace stipple {

/// The arrays of a density, for an asset.
OctreeTensors storedOctree(const OctreeDensity& density);

/// The density of an asset's arrays, which are used up. Errors: those of OctreeDensity::fromLevels.
std::shared_ptr<const OctreeDensity> octreeFromStored(OctreeTensors& stored);

}  // namespace stipple
