#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "decode/surface/surface_index.h"

namespace stipple {

/// Samples at open borders and creases of the surface, in Morton order, in the unit cube.
struct SurfaceBorders {
  std::vector<uint64_t> codes;   ///< [B] ascending, at SurfaceIndex::kCodeLevel
  std::vector<float> positions;  ///< [B,3]
  std::vector<float> normals;    ///< [B,3]
  std::vector<float> outwards;   ///< [B,3] unit, in the tangent plane, away from the surface
  std::vector<uint8_t> open;     ///< [B] 1: nothing goes on there; 0: a crease, another face does

  size_t size() const { return codes.size(); }
};

/// Finds the samples around which the flat neighbourhood leaves a wedge of about 120 degrees empty
/// and which have others like them nearby.
/// Cost: O(S); same result for any number of threads.
SurfaceBorders findBorders(const SurfaceIndex& index);

}  // namespace stipple
