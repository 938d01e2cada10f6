#include "mesh/mesh_depth.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {
namespace {

TriMesh randomMesh(size_t triangle_count, double spread, uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  TriMesh mesh;
  for (size_t t = 0; t < triangle_count; ++t) {
    const Vec3d centre(uniform(-spread, spread), uniform(-spread, spread),
                       uniform(-spread, spread));
    for (uint32_t corner = 0; corner < 3; ++corner) {
      for (int axis = 0; axis < 3; ++axis) {
        mesh.positions.push_back(static_cast<float>(centre[axis] + uniform(-0.5, 0.5) * spread));
      }
      mesh.triangles.push_back(static_cast<uint32_t>(t * 3 + corner));
    }
  }
  return mesh;
}

/// Looks along z from 3 metres before the origin.
Camera camera(CameraModel model, uint32_t width, uint32_t height) {
  Camera made;
  made.model = model;
  made.width = width;
  made.height = height;
  made.fx = model == CameraModel::kPerspective ? 40 : 12;
  made.fy = 1.25 * made.fx;
  made.cx = width * 0.4;
  made.cy = height * 0.6;
  made.world_to_camera(2, 3) = 3;
  made.near_plane = 0.5;
  return made;
}

/// Moeller and Trumbore, Fast, Minimum Storage Ray-Triangle Intersection, 1997: another way to the
/// same numbers. Returns planar z, or kEmptyDepth; `margin`: how far inside the ray passes, as a
/// share of the triangle.
double nearestOnRay(const TriMesh& mesh, const Mat4d& to_camera, const Camera& view, uint32_t x,
                    uint32_t y, double& margin) {
  const double rx = (x + 0.5 - view.cx) / view.fx, ry = (y + 0.5 - view.cy) / view.fy;
  const bool perspective = view.model == CameraModel::kPerspective;
  const Vec3d origin = perspective ? Vec3d(0, 0, 0) : Vec3d(rx, ry, 0);
  const Vec3d ray = perspective ? Vec3d(rx, ry, 1) : Vec3d(0, 0, 1);
  double nearest = static_cast<double>(kEmptyDepth);
  margin = 1;
  for (size_t t = 0; t < mesh.triangleCount(); ++t) {
    Vec3d v[3];
    for (size_t c = 0; c < 3; ++c) {
      const float* p = &mesh.positions[mesh.triangles[t * 3 + c] * 3];
      const Vec4d world(static_cast<double>(p[0]), static_cast<double>(p[1]),
                        static_cast<double>(p[2]), 1.0);
      v[c] = (to_camera * world).head<3>();
    }
    const Vec3d a = v[1] - v[0], b = v[2] - v[0];
    const Vec3d p = ray.cross(b);
    const double determinant = a.dot(p);
    const Vec3d s = origin - v[0];
    const double u = s.dot(p) / determinant;
    const Vec3d q = s.cross(a);
    const double w = ray.dot(q) / determinant;
    const double inside = std::min({u, w, 1 - u - w});
    const double z = (origin + ray * (b.dot(q) / determinant)).z();
    if (z < view.near_plane || z > view.far_plane) {
      margin = std::min(margin, std::abs(z - view.near_plane));
      continue;
    }
    margin = std::min(margin, std::abs(inside));
    if (inside >= 0) nearest = std::min(nearest, z);
  }
  return nearest;
}

std::vector<float> depthOf(std::span<const MeshInstance> instances, const Camera& view) {
  std::vector<float> depth(static_cast<size_t>(view.width) * view.height);
  drawMeshDepth(instances, view, depth);
  return depth;
}

TEST(MeshDepth, IsWhereTheRaysMeetTheTriangles) {
  // A camera in the middle of the triangles too: many reach behind it and across the near plane.
  for (const double distance : {3.0, 0.0}) {
    for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
      Camera view = camera(model, 37, 29);
      view.world_to_camera(2, 3) = distance;
      const TriMesh mesh = randomMesh(40, 1.0, 5);
      MeshInstance instance{&mesh};
      instance.object_to_world.topLeftCorner<3, 3>() =
          Eigen::AngleAxisd(0.6, Vec3d(1, 2, 3).normalized()).toRotationMatrix() *
          Vec3d(1.5, -0.7, 1.0).asDiagonal();
      const std::vector<float> depth = depthOf({&instance, 1}, view);
      const Mat4d to_camera = view.world_to_camera * instance.object_to_world;
      size_t covered = 0, judged = 0;
      for (uint32_t y = 0; y < view.height; ++y) {
        for (uint32_t x = 0; x < view.width; ++x) {
          double margin;
          const double expected = nearestOnRay(mesh, to_camera, view, x, y, margin);
          // Within 1e-9 of an edge the two ways may round to different sides.
          if (margin < 1e-9) continue;
          ++judged;
          const float seen = depth[static_cast<size_t>(y) * view.width + x];
          if (expected == static_cast<double>(kEmptyDepth)) {
            EXPECT_EQ(seen, kEmptyDepth) << x << " " << y;
            continue;
          }
          ++covered;
          // Stored as a float: 6e-8 relative.
          EXPECT_NEAR(static_cast<double>(seen), expected, 1e-7 * expected) << x << " " << y;
        }
      }
      EXPECT_GT(covered, 80u);
      EXPECT_GT(judged, 1000u);
    }
  }
}

TEST(MeshDepth, NeighboursLeaveNoGap) {
  // A fan of thin triangles that together fill the picture, corners at odd places.
  TriMesh mesh;
  mesh.positions = {0.0123f, 0.0234f, 0.1f};
  constexpr uint32_t kSpokes = 257;
  for (uint32_t i = 0; i < kSpokes; ++i) {
    const double angle = 2 * M_PI * i / kSpokes;
    mesh.positions.push_back(static_cast<float>(9 * std::cos(angle)));
    mesh.positions.push_back(static_cast<float>(9 * std::sin(angle)));
    mesh.positions.push_back(static_cast<float>(0.5 * std::sin(5 * angle)));
    mesh.triangles.insert(mesh.triangles.end(), {0, 1 + i, 1 + (i + 1) % kSpokes});
  }
  const MeshInstance instance{&mesh};
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    for (const float z : depthOf({&instance, 1}, camera(model, 131, 97))) EXPECT_LT(z, 5.0f);
  }
}

TEST(MeshDepth, IsTheNearestOfAllInstancesForAnyNumberOfThreads) {
  const TriMesh mesh = randomMesh(5000, 0.2, 9);
  std::vector<MeshInstance> instances;
  for (int i = 0; i < 4; ++i) {
    MeshInstance instance{&mesh};
    instance.object_to_world(0, 3) = 0.3 * i - 0.5;
    instance.object_to_world(2, 3) = 0.5 * i;
    instances.push_back(instance);
  }
  const Camera view = camera(CameraModel::kPerspective, 64, 48);
  std::vector<float> one, two;
  withThreads(1, [&] { one = depthOf(instances, view); });
  withThreads(2, [&] { two = depthOf(instances, view); });
  EXPECT_EQ(one, two);
  std::vector<float> nearest(one.size(), kEmptyDepth);
  for (const MeshInstance& instance : instances) {
    const std::vector<float> own = depthOf({&instance, 1}, view);
    for (size_t i = 0; i < own.size(); ++i) nearest[i] = std::min(nearest[i], own[i]);
  }
  EXPECT_EQ(one, nearest);
}

TEST(MeshDepth, ShowsNothingOfNothing) {
  TriMesh flat;  // no area, and one seen from its edge
  flat.positions = {0, 0, 0, 1, 1, 1, 2, 2, 2, 0, 0, 5};
  flat.triangles = {0, 1, 2, 0, 0, 1, 0, 3, 0};
  const TriMesh empty;
  const MeshInstance instances[] = {{&flat}, {&empty}};
  const Camera view = camera(CameraModel::kPerspective, 8, 8);
  for (const float z : depthOf(instances, view)) EXPECT_EQ(z, kEmptyDepth);
  for (const float z : depthOf({}, view)) EXPECT_EQ(z, kEmptyDepth);
}

TEST(MeshDepth, RefusesBadInput) {
  const TriMesh mesh = randomMesh(1, 1, 1);
  const Camera view = camera(CameraModel::kPerspective, 8, 8);
  std::vector<float> depth(63);
  MeshInstance instance{&mesh};
  EXPECT_THROW(drawMeshDepth({&instance, 1}, view, depth), Error);
  depth.resize(64);
  instance.object_to_world.setZero();
  EXPECT_THROW(drawMeshDepth({&instance, 1}, view, depth), Error);
  Progress progress;
  progress.cancel();
  instance.object_to_world.setIdentity();
  EXPECT_THROW(drawMeshDepth({&instance, 1}, view, depth, &progress), Error);
}

}  // namespace
}  // namespace stipple
