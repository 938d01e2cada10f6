#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/bytes/safetensors.h"

namespace stipple {

/// The octree of an asset: the arrays of OctreeDensity, in the order of its levels.
struct OctreeTensors {
  std::array<double, 3> root_origin = {0, 0, 0};
  double root_side = 1.0;
  std::vector<std::vector<uint64_t>> cells;           ///< per level
  std::vector<std::vector<float>> log_probabilities;  ///< per level [cells, 8]
};

/// Metadata "root_cube" and "levels", tensors "octree.cells.L" and "octree.log_p.L". The arrays
/// must live until the file is written.
void addOctree(SafeTensorsWriter& file, const OctreeTensors& octree);
/// Errors: kFormat.
OctreeTensors readOctree(const SafeTensorsReader& file);
/// Sizes that agree and numbers that are logarithms. In: name: of the asset; code: of the error.
void validateOctree(const OctreeTensors& octree, const std::string& name, ErrorCode code);

}  // namespace stipple
