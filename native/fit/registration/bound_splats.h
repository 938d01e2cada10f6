#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "math/vec.h"
#include "mesh/adapt/mesh_links.h"
#include "splat/render/render.h"

namespace stipple {

/// Flat splats that lie on the triangles of a mesh and follow them as they move: as many on each
/// triangle, spread by its barycentric places, as wide as closes the gaps between them. What the
/// renderer of splats says of theirs becomes derivatives of the mesh.
/// Drawn by boundSplatsDrawing().
class BoundSplats {
 public:
  /// In: positions [n] of the mesh before it moves, metres, by which each triangle has its longest
  /// edge and splats their thickness; pixel, metres that one shows of the mesh, by which splats are
  /// no smaller than images can tell. links must outlive this.
  BoundSplats(const MeshLinks& links, std::span<const Vec3d> positions, double pixel);

  size_t count() const { return links_.triangleCount() * places_.size(); }
  /// How many there are at most on so many triangles.
  static size_t countBound(size_t triangle_count);

  /// In: positions and colours [n], metres and linear. Out: cloud, all of it: count() splats of
  /// degree 0. Triangles without area have splats without size.
  void place(std::span<const Vec3d> positions, std::span<const Vec3d> colours,
             SplatCloud& cloud) const;

  /// Adds derivatives of a loss. In: the numbers that place() was given, and the derivatives by
  /// what it wrote, as a cloud of them, opacities excepted, which are constant; factor, by which
  /// all are multiplied. A triangle that is nearly without height turns no faster than one a tenth
  /// of the mean edge high. Out: by_position and by_colour [n], added to.
  void addGradient(std::span<const Vec3d> positions, const SplatCloud& by_splats, double factor,
                   std::span<Vec3d> by_position, std::span<Vec3d> by_colour) const;

 private:
  struct Frame;
  bool frameOf(std::span<const Vec3d> positions, size_t triangle, Frame& frame) const;

  const MeshLinks& links_;
  std::vector<Vec3d> places_;   ///< weights of the corners, from the first on
  std::vector<uint8_t> first_;  ///< [F] the corner at which the longest edge begins
  double parts_ = 1;            ///< that each edge is divided into
  double mean_edge_ = 0;        ///< metres
};

/// How they are drawn: with the low pass that keeps the coverage of small splats, without depth.
RenderOptions boundSplatsDrawing();

}  // namespace stipple
