#include "mesh/adapt/harmonic_light.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "math/cross_product.h"
#include "mesh/adapt/moving_samples.h"

namespace stipple {

namespace {

/// Of the mean of the diagonal.
constexpr double kLightRidge = 1e-4;

/// Sum of the area vectors of the triangles around a vertex.
Vec3d areasAround(const MeshLinks& links, std::span<const Vec3d> positions, size_t vertex) {
  Vec3d sum = Vec3d::Zero();
  for (const uint32_t corner : links.corners(vertex)) {
    sum += areaVector(links.triangles(), positions, corner / 3);
  }
  return sum;
}

}  // namespace

HarmonicLight::Terms HarmonicLight::terms(const Vec3d& normal) {
  const double x = normal.x(), y = normal.y(), z = normal.z();
  Terms made;
  made << 1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y;
  return made;
}

Vec3d HarmonicLight::gradient(const Vec3d& normal, const Vec3d& by_colour) const {
  const double x = normal.x(), y = normal.y(), z = normal.z();
  const Terms by = colours * by_colour;
  return {by[3] + by[4] * y + by[7] * z + 2 * by[8] * x,
          by[1] + by[4] * x + by[5] * z - 2 * by[8] * y,
          by[2] + by[5] * y + 6 * by[6] * z + by[7] * x};
}

void LightFit::add(const HarmonicLight::Terms& terms, const Vec3d& colour) {
  matrix_ += terms * terms.transpose();
  right_ += terms * colour.transpose();
}

void LightFit::add(const LightFit& other) {
  matrix_ += other.matrix_;
  right_ += other.right_;
}

HarmonicLight LightFit::light() const {
  auto matrix = matrix_;
  matrix.diagonal().array() += kLightRidge * matrix.trace() / HarmonicLight::kTerms;
  HarmonicLight light;
  light.colours = matrix.ldlt().solve(right_);
  return light;
}

std::vector<Vec3d> vertexNormals(const MeshLinks& links, std::span<const Vec3d> positions) {
  std::vector<Vec3d> normals(positions.size());
  for (size_t v = 0; v < normals.size(); ++v) {
    const Vec3d sum = areasAround(links, positions, v);
    const double length = sum.norm();
    normals[v] = length > 0 ? Vec3d(sum / length) : Vec3d::Zero();
  }
  return normals;
}

void addNormalsGradient(const MeshLinks& links, std::span<const Vec3d> positions,
                        std::span<const Vec3d> by_normal, double floor,
                        std::span<Vec3d> by_position) {
  std::vector<Vec3d> by_areas(positions.size());
  for (size_t v = 0; v < by_areas.size(); ++v) {
    const Vec3d sum = areasAround(links, positions, v);
    const double length = sum.norm();
    if (!(length > 0)) {
      by_areas[v] = Vec3d::Zero();
      continue;
    }
    const Vec3d normal = sum / length;
    by_areas[v] = (by_normal[v] - normal * normal.dot(by_normal[v])) / std::max(length, floor);
  }
  const std::span<const uint32_t> triangles = links.triangles();
  for (size_t t = 0; t < triangles.size(); t += 3) {
    const uint32_t* v = &triangles[t];
    // The area vector is in the sums of all three corners.
    const Vec3d by = by_areas[v[0]] + by_areas[v[1]] + by_areas[v[2]];
    const Vec3d first = positions[v[1]] - positions[v[0]],
                second = positions[v[2]] - positions[v[0]];
    const Vec3d by_first = crossProduct(second, by), by_second = crossProduct(by, first);
    by_position[v[1]] += by_first;
    by_position[v[2]] += by_second;
    by_position[v[0]] -= by_first + by_second;
  }
}

}  // namespace stipple
