#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/mesh_links.h"
#include "mesh/surface_search.h"

namespace stipple {

/// A place of a surface: a mix of its vertices.
struct SurfaceLanding {
  std::array<uint32_t, 3> corners{};
  std::array<double, 3> weights{};  ///< sum 1

  template <typename Value>
  Value of(std::span<const Value> values) const {
    return Value(weights[0] * values[corners[0]] + weights[1] * values[corners[1]] +
                 weights[2] * values[corners[2]]);
  }
};

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
  /// Out: where they are now. Threads and determinism: parallel; same result for any number of
  /// threads. Cost: O(n log F).
  std::vector<SurfaceLanding> land(std::span<Vec3d> vertices) const;

  /// Moves the vertices of lines along them, from where they are at first, by a share, 0..1, of
  /// their way to where the edges of each line are as long as each other, or as `goals` [n] at the
  /// vertices say, in proportion. Lines without ends keep their mean place. In and out: vertices
  /// [n]; others stay. Cost: O(length of the lines).
  void divideLines(std::span<Vec3d> vertices, std::span<const double> goals, double share) const;

  /// Whether triangles look to the other side than the surface where their middle lands on it. In:
  /// vertices [n]. Out: [F], 0 or 1. Threads and determinism and cost: those of land().
  std::vector<uint8_t> turned(std::span<const Vec3d> vertices) const;

  bool isFree(size_t vertex) const {  ///< it may go anywhere on the faces around it
    return part_of_[vertex] < region_count_;
  }
  bool isSharp(uint32_t a, uint32_t b) const;  ///< an edge of a line, or between two held vertices
  size_t heldCount() const;                    ///< vertices that stay
  size_t lineCount() const;                    ///< vertices that keep to lines

 private:
  /// Faces, or edges as faces without area, and how to find the nearest.
  struct Part {
    std::vector<uint32_t> faces;  ///< [F,3] of vertices
    std::unique_ptr<SurfaceSearch> search;
  };
  /// The vertices of a line in their order.
  struct Chain {
    std::vector<uint32_t> vertices;
    bool is_closed = false;  ///< from the last one on to the first
  };
  static constexpr uint32_t kHeld = ~uint32_t{0};

  void makeChains(std::span<const std::vector<uint32_t>> edges_at,
                  std::span<const uint32_t> line_of, size_t line_count);
  SurfaceLanding landing(const Part& part, const Vec3d& point,
                         std::vector<SurfacePlace>& places) const;

  const MeshLinks& links_;
  std::vector<Vec3d> positions_;
  std::vector<float> floats_;                         ///< the same, which searches read
  std::vector<Part> parts_;                           ///< regions of faces, then lines
  std::vector<uint32_t> part_of_;                     ///< [n] of each vertex, or kHeld
  std::vector<uint32_t> region_of_;                   ///< [F] of each triangle
  std::vector<std::pair<uint32_t, uint32_t>> sharp_;  ///< edges, the lower end first, ascending
  std::vector<Chain> chains_;
  size_t region_count_ = 0;
};

}  // namespace stipple
