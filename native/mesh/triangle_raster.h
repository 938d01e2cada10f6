#pragma once

#include <cstdint>
#include <vector>

#include "data/meshes/tri_mesh.h"
#include "math/camera.h"
#include "math/vec.h"

namespace stipple {

/// A triangle as rays through pixels meet it.
struct FlatTriangle {
  Vec3d edges[3];                ///< functions of the ray (x, y, 1), at least 0 inside
  double determinant = 0;        ///< over the sum of the functions: z, of perspective cameras
  double depths[3] = {0, 0, 0};  ///< of the corners
};

/// Draws triangles by the rays through the centres of pixels. Triangles that share an edge leave no
/// gap along it.
class TriangleRaster {
 public:
  explicit TriangleRaster(const Camera& camera) : camera_(camera) {}

  /// Corners in the camera's frame. False for a triangle that is seen from the edge, or without
  /// area.
  bool flatten(const Vec3d (&corners)[3], FlatTriangle& out) const;

  /// What the ray of a pixel meets: planar z and the weights of the corners. False where it misses,
  /// or meets what is not between the planes.
  bool meet(const FlatTriangle& triangle, uint32_t x, uint32_t y, double& z, Vec3d& weights) const {
    const double ray_x = (x + 0.5 - camera_.cx) / camera_.fx;
    const double ray_y = (y + 0.5 - camera_.cy) / camera_.fy;
    double e[3];
    for (int i = 0; i < 3; ++i) {
      const Vec3d& edge = triangle.edges[i];
      e[i] = edge.x() * ray_x + (edge.y() * ray_y + edge.z());
      if (e[i] < 0) return false;
    }
    const double sum = e[0] + e[1] + e[2];
    if (!(sum > kNoArea)) return false;
    z = camera_.model == CameraModel::kPerspective
            ? triangle.determinant / sum
            : (e[0] * triangle.depths[0] + e[1] * triangle.depths[1] + e[2] * triangle.depths[2]) /
                  sum;
    weights = Vec3d(e[0] / sum, e[1] / sum, e[2] / sum);
    return z >= camera_.near_plane && z <= camera_.far_plane;
  }

  /// Pixels [x0, x1) x [y0, y1).
  struct Box {
    uint32_t x0 = 0, x1 = 0, y0 = 0, y1 = 0;
  };

  /// Calls put(x, y, z, weights) for every pixel whose ray meets the triangle.
  template <typename Put>
  void draw(const Vec3d (&corners)[3], const Put& put) const {
    Box box;
    FlatTriangle flat;
    if (!boxOf(corners, box) || !flatten(corners, flat)) return;
    draw(flat, box, put);
  }

  /// The same of what flatten() and boxOf() made.
  template <typename Put>
  void draw(const FlatTriangle& flat, const Box& box, const Put& put) const {
    double z = 0;
    Vec3d weights;
    for (uint32_t y = box.y0; y < box.y1; ++y) {
      for (uint32_t x = box.x0; x < box.x1; ++x) {
        if (meet(flat, x, y, z, weights)) put(x, y, z, weights);
      }
    }
  }

  /// The pixels that the part of the triangle behind the near plane may cover. False: none.
  bool boxOf(const Vec3d (&corners)[3], Box& box) const;

 private:
  /// Below, a triangle is seen from the edge, or has no area.
  static constexpr double kNoArea = 1e-200;

  const Camera& camera_;
};

/// The vertices of a mesh in a camera's frame.
void placeVertices(const TriMesh& mesh, const Mat4d& object_to_camera, std::vector<Vec3d>& out);

}  // namespace stipple
