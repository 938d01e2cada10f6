#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"

namespace stipple {

/// The place of a triangle that is nearest to a point.
struct SurfacePlace {
  uint32_t triangle = 0;
  double squared = 0;               ///< distance, squared
  std::array<double, 3> weights{};  ///< of the triangle's corners, each 0..1, sum 1
};

/// The place of a triangle that is nearest to a point, exact but for rounding; of a triangle thinner
/// than 1e-5 of its length, on its edges. `triangle` of the result is 0.
SurfacePlace nearestOnTriangle(const Vec3d& point, const std::array<Vec3d, 3>& corners);

/// Finds the triangles of a mesh that are nearest to a point: a tree of boxes.
/// Memory: about 60 bytes per triangle. The mesh must outlive it.
class SurfaceSearch {
 public:
  /// In: positions [V,3] finite; triangles [T,3], T > 0, of indices below V.
  SurfaceSearch(std::span<const float> positions, std::span<const uint32_t> triangles);

  /// The `count` nearest triangles, nearest first; of equal ones the lower index. Fewer where the
  /// mesh has fewer.
  void nearest(const Vec3d& point, size_t count, std::vector<SurfacePlace>& places) const;

 private:
  struct Node {
    std::array<float, 3> low, high;
    uint32_t begin, end;  ///< triangles, in order_
    uint32_t second;      ///< index of the second child; the first one follows; 0: a leaf
  };

  std::array<Vec3d, 3> cornersOf(uint32_t triangle) const;
  uint32_t build(uint32_t begin, uint32_t end, const std::vector<std::array<float, 3>>& centroids);

  std::span<const float> positions_;
  std::span<const uint32_t> triangles_;
  std::vector<uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace stipple
