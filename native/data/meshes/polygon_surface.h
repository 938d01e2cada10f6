#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace stipple {

constexpr uint32_t kNoCorner = UINT32_MAX;

/// Triangles and quads, as a surface comes out of a volume.
struct PolygonSurface {
  std::vector<float> points;                   ///< [V,3] metres
  std::vector<std::array<uint32_t, 4>> faces;  ///< all the same way round; the last corner
                                               ///< of a triangle is kNoCorner
};

}  // namespace stipple
