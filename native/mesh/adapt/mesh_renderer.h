#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "math/camera.h"
#include "math/vec.h"
#include "mesh/triangle_raster.h"

namespace stipple {

/// Where an outline passes between the centres of two pixels side by side, of which it makes one a
/// mixture of both.
struct OutlineCrossing {
  uint32_t inside = 0;   ///< the pixel on the side of the triangle
  uint32_t outside = 0;  ///< the other one
  uint32_t triangle = 0;
  uint32_t corner = 0;  ///< of the triangle, opposite to the edge that is the outline
  double along = 0;     ///< 0..1 of the way from the centre inside to the one outside
};

/// A mesh as a camera sees it, and what its derivatives need. The mesh must not change meanwhile.
/// Outside of the box nothing is drawn.
struct MeshView {
  uint32_t width = 0, height = 0;
  TriangleRaster::Box box;     ///< of the mesh, and a pixel more on each side
  std::vector<double> pixels;  ///< [H,W,4] linear colour times coverage, and coverage

  std::vector<double> plain;        ///< the same without smooth outlines
  std::vector<double> depths;       ///< [H,W] planar z, infinity for none
  std::vector<uint32_t> triangles;  ///< [H,W] that each centre meets, kNoTriangle for none
  std::vector<OutlineCrossing> outlines;
  std::vector<FlatTriangle> flat;     ///< [F]
  std::vector<uint8_t> faces_camera;  ///< [F] 1: corners are clockwise in the image
  static constexpr uint32_t kNoTriangle = ~uint32_t{0};

  /// Calls each(begin, end) with the indices of the pixels of every row of the box.
  template <typename Each>
  void forEachRow(const Each& each) const {
    for (uint32_t y = box.y0; y < box.y1; ++y) each(y * width + box.x0, y * width + box.x1);
  }
};

/// Draws a mesh with a colour at each vertex so that the image has derivatives by both, the places
/// of its outlines included.
///
/// What the centre of a pixel meets gives it its colour; its outlines are then made smooth: between
/// two pixels where a sheet ends in front of another one or of nothing, the edge's place between
/// the centres mixes one of them from both. That makes the image continuous in the vertices (but
/// for where sheets pass through each other), and by the place come the derivatives.
/// Source: Laine et al., Modular Primitives for High-Performance Differentiable Rendering, SIGGRAPH
/// Asia 2020. Differs: an edge is looked for across the triangles between both centres, so that
/// triangles may be smaller than pixels; all in double precision.
class MeshRenderer {
 public:
  /// In: triangles [F,3] of three different vertices. They are copied.
  explicit MeshRenderer(std::span<const uint32_t> triangles);

  /// In: a camera with an image plane, accepted by validate(); positions and colours [n], metres
  /// and linear. Before and behind: what is not between the camera's planes is not there. Cost:
  /// about 20 ns a pixel that triangles' boxes cover.
  MeshView draw(const Camera& camera, std::span<const Vec3d> positions,
                std::span<const Vec3d> colours) const;
  /// The same into memory that may have held another view.
  void draw(const Camera& camera, std::span<const Vec3d> positions, std::span<const Vec3d> colours,
            MeshView& view) const;

  /// Adds the derivatives of a loss. In: the view that draw() made of the same numbers; by_pixel
  /// [H,W,4], the derivative of the loss by view.pixels, of which the box is read; outline_weight:
  /// what the part by the places of outlines is multiplied by, 1 for the derivative itself. Out:
  /// by_position and by_colour [n], added to; by_pixel has become the derivative by view.plain.
  void addGradient(const MeshView& view, const Camera& camera, std::span<const Vec3d> colours,
                   std::span<double> by_pixel, double outline_weight, std::span<Vec3d> by_position,
                   std::span<Vec3d> by_colour) const;

  std::span<const uint32_t> triangles() const { return triangles_; }
  /// Of the triangle that the centre of a pixel meets, the weights of its corners there, sum 1.
  static Vec3d weightsAt(const MeshView& view, const Camera& camera, uint32_t pixel);

 private:
  void drawPlain(const Camera& camera, std::span<const Vec3d> vertices,
                 std::span<const Vec3d> colours, MeshView& view) const;
  void findOutlines(const Camera& camera, MeshView& view) const;
  /// The outline between two centres of a sheet that holds the first of them.
  bool outlineFrom(const MeshView& view, const Vec3d& from, const Vec3d& to, uint32_t triangle,
                   OutlineCrossing& found) const;

  std::vector<uint32_t> triangles_;
  std::vector<uint32_t> across_;  ///< [F,3] the triangle across the edge opposite to each corner
};

}  // namespace stipple
