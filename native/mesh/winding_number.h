#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/meshes/tri_mesh.h"
#include "math/vec.h"

namespace stipple {

/// How often a mesh winds around a point: 1 inside a closed mesh whose faces look outwards, 0
/// outside; in between, smoothly, near holes. Needs neither watertight nor manifold meshes.
/// Memory: about 60 bytes per triangle.
class WindingNumber {
 public:
  /// In: a mesh that validate() accepts.
  explicit WindingNumber(const TriMesh& mesh);

  /// Within 0.04 of the sum over all triangles, where faces curve all around the point; less
  /// elsewhere. Cost: O(log triangles) away from the surface.
  double at(const Vec3d& point) const;
  /// The sum over all triangles, for comparison. Cost: O(triangles).
  double exactAt(const Vec3d& point) const;
  /// Whether the point lies in the box of the mesh, out of which nothing is inside.
  bool inBounds(const Vec3d& point) const;

 private:
  struct Node {
    Vec3d centre;    ///< area-weighted
    double radius;   ///< no vertex is further from the centre
    Vec3d area;      ///< sum of area vectors
    Mat3d moment;    ///< sum of area vector * (centroid - centre)^T
    uint32_t begin;  ///< triangles, in order_
    uint32_t end;
    uint32_t second;  ///< index of the second child; the first one follows; 0: a leaf
  };

  uint32_t build(uint32_t begin, uint32_t end, std::vector<uint32_t>& order,
                 const std::vector<Vec3d>& centroids, const TriMesh& mesh);

  std::vector<Node> nodes_;
  std::vector<float> corners_;  ///< [T,3,3], triangles in the order of the leaves
  Vec3d low_;
  Vec3d high_;
};

/// Which points lie inside a mesh: 1 where the winding number is at least one half, whichever way
/// the faces look, and the point is within the mesh's bounds. [N]
/// In: points [N,3]; points_to_mesh: affine and invertible.
/// Errors: kInvalidArgument for a mesh that validate() refuses, kCancelled.
/// Threads: all; same result for any number of threads.
std::vector<uint8_t> insideMesh(const TriMesh& mesh, std::span<const float> points,
                                const Mat4d& points_to_mesh, Progress* progress);

}  // namespace stipple
