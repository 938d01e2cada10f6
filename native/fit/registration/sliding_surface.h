#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/mesh_links.h"
#include "mesh/surface_search.h"

namespace stipple {

/// The surface of a mesh as its own vertices may slide along it. A vertex keeps to the faces around
/// it, as far as they go without a sharp edge; one on a sharp or open edge, or on one of more than
/// two faces, keeps to the line that such edges make; where lines end, meet or turn sharply it
/// stays. So no edge of a box is cut, whatever moves.
class SlidingSurface {
 public:
  /// In: positions [n] of the surface, which keeps them; sharp_angle, radians: normals of two
  /// faces, or directions of two edges of a line, that differ by more make what lies between them
  /// sharp. links must outlive this.
  SlidingSurface(const MeshLinks& links, std::span<const Vec3d> positions, double sharp_angle);

  /// Brings every vertex to the nearest place of those that it may reach. In and out: vertices [n].
  /// Threads and determinism: parallel; same result for any number of threads. Cost: O(n log F).
  void land(std::span<Vec3d> vertices) const;

  /// The same, and vertices of triangles that are turned over by it come back, half of the way and
  /// half again, until none is, or they are where they were.
  void landUnfolded(std::span<Vec3d> vertices) const;

  size_t heldCount() const;  ///< vertices that stay
  size_t lineCount() const;  ///< vertices that keep to lines

 private:
  /// Faces, or edges as faces without area, and how to find the nearest.
  struct Part {
    std::vector<uint32_t> faces;  ///< [F,3] of vertices
    std::unique_ptr<SurfaceSearch> search;
  };
  static constexpr uint32_t kHeld = ~uint32_t{0};

  const MeshLinks& links_;
  std::vector<Vec3d> positions_;
  std::vector<float> floats_;      ///< the same, which searches read
  std::vector<Part> parts_;        ///< regions of faces, then lines
  std::vector<uint32_t> part_of_;  ///< [n] of each vertex, or kHeld
  size_t region_count_ = 0;
};

}  // namespace stipple
