// Based on: Olano and Greer, Triangle Scan Conversion using 2D Homogeneous Coordinates, Graphics
// Hardware 1997. With corners v_i in the camera's frame, N_i = v_j x v_k and the ray (x, y, 1), the
// edge functions e_i = N_i . ray have the sign of det = v_0 . N_0 inside the triangle, and
// z = det / sum(e_i): nothing is divided by a corner's z, so triangles that reach behind the camera
// need no clipping, except for the box of pixels to look at. The function of a shared edge has the
// same digits and the other sign in the neighbour. Orthographic: v_i = (x, y, 1), and z is the mean
// of the corners' by e_i.
#include "mesh/triangle_raster.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "math/affine.h"

namespace stipple {

namespace {

constexpr size_t kVerticesAtOnce = 1 << 14;

/// The part of a picture's side that lies over low..high, pixels.
void coveredRange(double low, double high, uint32_t side, uint32_t& begin, uint32_t& end) {
  const double last = static_cast<double>(side);
  // Centres are at +0.5; a pixel more at each end makes up for rounding.
  begin = static_cast<uint32_t>(std::clamp(std::floor(low - 0.5), 0.0, last));
  end = static_cast<uint32_t>(std::clamp(std::ceil(high + 0.5) + 1.0, 0.0, last));
}

}  // namespace

bool TriangleRaster::flatten(const Vec3d (&corners)[3], FlatTriangle& out) const {
  const bool perspective = camera_.model == CameraModel::kPerspective;
  Vec3d flat[3];
  for (int i = 0; i < 3; ++i) {
    flat[i] = perspective ? corners[i] : Vec3d(corners[i].x(), corners[i].y(), 1.0);
    out.depths[i] = corners[i].z();
  }
  for (int i = 0; i < 3; ++i) out.edges[i] = flat[(i + 1) % 3].cross(flat[(i + 2) % 3]);
  out.determinant = flat[0].dot(out.edges[0]);
  if (!(std::abs(out.determinant) > kNoArea)) return false;
  if (out.determinant < 0) {
    out.determinant = -out.determinant;
    for (Vec3d& edge : out.edges) edge = -edge;
  }
  return true;
}

bool TriangleRaster::boxOf(const Vec3d (&corners)[3], Box& box) const {
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

void placeVertices(const TriMesh& mesh, const Mat4d& object_to_camera, std::vector<Vec3d>& out) {
  const Mat3d linear = linearPart(object_to_camera);
  const Vec3d translation = translationPart(object_to_camera);
  out.resize(mesh.vertexCount());
  parallelFor(out.size(), kVerticesAtOnce, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Eigen::Map<const Vec3f> position(&mesh.positions[i * 3]);
      out[i] = linear * position.cast<double>() + translation;
    }
  });
}

}  // namespace stipple
