#include "mesh/mesh_depth.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"

// Based on: Olano and Greer, Triangle Scan Conversion using 2D Homogeneous Coordinates, Graphics
// Hardware 1997. With corners v_i in the camera's frame, N_i = v_j x v_k and the ray (x, y, 1), the
// edge functions e_i = N_i . ray have the sign of det = v_0 . N_0 inside the triangle, and
// z = det / sum(e_i): nothing is divided by a corner's z, so triangles that reach behind the camera
// need no clipping, except for the box of pixels to look at. The function of a shared edge has the
// same digits and the other sign in the neighbour. Orthographic: v_i = (x, y, 1), and z is the mean
// of the corners' by e_i.

namespace stipple {

namespace {

constexpr size_t kVerticesAtOnce = 1 << 14;
constexpr size_t kTrianglesAtOnce = 1 << 11;
/// Below, a triangle is seen from the edge, or has no area.
constexpr double kNoArea = 1e-200;

/// Pixels [x0, x1) x [y0, y1).
struct Box {
  uint32_t x0, x1, y0, y1;
};

/// The part of a picture's side that lies over low..high, pixels.
void coveredRange(double low, double high, uint32_t side, uint32_t& begin, uint32_t& end) {
  const double last = static_cast<double>(side);
  // Centres are at +0.5; a pixel more at each end makes up for rounding.
  begin = static_cast<uint32_t>(std::clamp(std::floor(low - 0.5), 0.0, last));
  end = static_cast<uint32_t>(std::clamp(std::ceil(high + 0.5) + 1.0, 0.0, last));
}

class TriangleDepth {
 public:
  TriangleDepth(const Camera& camera, std::span<float> depth) : camera_(camera), depth_(depth) {}

  /// Corners in the camera's frame.
  void draw(const Vec3d (&corners)[3]) const {
    Box box;
    if (!boxOf(corners, box)) return;
    const bool perspective = camera_.model == CameraModel::kPerspective;
    Vec3d flat[3];
    for (int i = 0; i < 3; ++i) {
      flat[i] = perspective ? corners[i] : Vec3d(corners[i].x(), corners[i].y(), 1.0);
    }
    Vec3d edges[3] = {flat[1].cross(flat[2]), flat[2].cross(flat[0]), flat[0].cross(flat[1])};
    double determinant = flat[0].dot(edges[0]);
    if (!(std::abs(determinant) > kNoArea)) return;
    if (determinant < 0) {
      determinant = -determinant;
      for (Vec3d& edge : edges) edge = -edge;
    }
    for (uint32_t y = box.y0; y < box.y1; ++y) {
      const double ray_y = (y + 0.5 - camera_.cy) / camera_.fy;
      double row[3];
      for (int i = 0; i < 3; ++i) row[i] = edges[i].y() * ray_y + edges[i].z();
      for (uint32_t x = box.x0; x < box.x1; ++x) {
        const double ray_x = (x + 0.5 - camera_.cx) / camera_.fx;
        const double e0 = edges[0].x() * ray_x + row[0];
        const double e1 = edges[1].x() * ray_x + row[1];
        const double e2 = edges[2].x() * ray_x + row[2];
        if (e0 < 0 || e1 < 0 || e2 < 0) continue;
        const double sum = e0 + e1 + e2;
        if (!(sum > kNoArea)) continue;
        const double z =
            perspective ? determinant / sum
                        : (e0 * corners[0].z() + e1 * corners[1].z() + e2 * corners[2].z()) / sum;
        if (z >= camera_.near_plane && z <= camera_.far_plane) put(x, y, z);
      }
    }
  }

 private:
  void put(uint32_t x, uint32_t y, double z) const {
    const float value = static_cast<float>(std::min(z, static_cast<double>(kEmptyDepth)));
    std::atomic_ref<float> here(depth_[static_cast<size_t>(y) * camera_.width + x]);
    float seen = here.load(std::memory_order_relaxed);
    while (value < seen && !here.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
    }
  }

  /// The pixels that the part of the triangle behind the near plane may cover. False: none.
  bool boxOf(const Vec3d (&corners)[3], Box& box) const {
    const double near = camera_.near_plane;
    double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
    const auto include = [&](const Vec3d& point) {
      const double scale = camera_.model == CameraModel::kPerspective ? 1.0 / point.z() : 1.0;
      const double x = camera_.fx * point.x() * scale + camera_.cx;
      const double y = camera_.fy * point.y() * scale + camera_.cy;
      low[0] = std::min(low[0], x), high[0] = std::max(high[0], x);
      low[1] = std::min(low[1], y), high[1] = std::max(high[1], y);
    };
    for (int i = 0; i < 3; ++i) {
      const Vec3d& a = corners[i];
      const Vec3d& b = corners[(i + 1) % 3];
      if (a.z() >= near) include(a);
      if ((a.z() >= near) == (b.z() >= near)) continue;
      Vec3d crossing = a + (b - a) * ((near - a.z()) / (b.z() - a.z()));
      crossing.z() = near;
      include(crossing);
    }
    if (low[0] > high[0]) return false;
    coveredRange(low[0], high[0], camera_.width, box.x0, box.x1);
    coveredRange(low[1], high[1], camera_.height, box.y0, box.y1);
    return box.x0 < box.x1 && box.y0 < box.y1;
  }

  const Camera& camera_;
  std::span<float> depth_;
};

void drawInstance(const TriMesh& mesh, const Mat4d& object_to_camera,
                  const TriangleDepth& triangles, std::vector<Vec3d>& vertices,
                  Progress* progress) {
  const Mat3d linear = linearPart(object_to_camera);
  const Vec3d translation = translationPart(object_to_camera);
  vertices.resize(mesh.vertexCount());
  const auto place = [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Eigen::Map<const Vec3f> position(&mesh.positions[i * 3]);
      vertices[i] = linear * position.cast<double>() + translation;
    }
  };
  parallelFor(vertices.size(), kVerticesAtOnce, std::cref(place));
  const auto draw = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    for (size_t t = begin; t < end; ++t) {
      const uint32_t* corner = &mesh.triangles[t * 3];
      triangles.draw({vertices[corner[0]], vertices[corner[1]], vertices[corner[2]]});
    }
  };
  parallelFor(mesh.triangleCount(), kTrianglesAtOnce, std::cref(draw));
}

}  // namespace

void drawMeshDepth(std::span<const MeshInstance> instances, const Camera& camera,
                   std::span<float> depth, Progress* progress) {
  validate(camera);
  requireImagePlane(camera, "the depth of meshes");
  const size_t pixel_count = static_cast<size_t>(camera.width) * camera.height;
  if (depth.size() != pixel_count) {
    fail(ErrorCode::kInvalidArgument, "depth has room for " + std::to_string(depth.size()) +
                                          " pixels; the image has " + std::to_string(pixel_count));
  }
  for (size_t i = 0; i < instances.size(); ++i) {
    const std::string name = "instance " + std::to_string(i) + ": matrix";
    validateAffine(instances[i].object_to_world, name.c_str());
  }
  std::fill(depth.begin(), depth.end(), kEmptyDepth);
  const TriangleDepth triangles(camera, depth);
  std::vector<Vec3d> vertices;
  for (size_t i = 0; i < instances.size(); ++i) {
    advance(progress, static_cast<double>(i) / static_cast<double>(instances.size()),
            "Drawing the depth of meshes");
    drawInstance(*instances[i].mesh, camera.world_to_camera * instances[i].object_to_world,
                 triangles, vertices, progress);
  }
}

uint64_t meshDepthMemoryBound(std::span<const MeshInstance> instances) {
  uint64_t most = 0;
  for (const MeshInstance& instance : instances) {
    most = std::max<uint64_t>(most, instance.mesh->vertexCount());
  }
  // A vector that grows from one mesh to the next holds the old and the new for a moment.
  return 2 * most * sizeof(Vec3d);
}

}  // namespace stipple
