#include "mesh/winding_number.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"

// Based on: Barill, Dickson, Schmidt, Levin, Jacobson, Fast Winding Numbers for Soups and Clouds,
// SIGGRAPH 2018 (expansion to second order); van Oosterom and Strackee, The Solid Angle of a Plane
// Triangle, IEEE Trans. Biomed. Eng. 1983. Differs: a binary tree split at the median centroid.

namespace stipple {

namespace {

constexpr uint32_t kLeafSize = 8;
constexpr size_t kGrain = 4096;
/// A node is taken as a whole from this many radii away; its error is below 1/27 of its share.
constexpr double kFar = 3.0;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFourPi = 4.0 * std::numbers::pi;

Vec3d vectorAt(const float* values) {
  return {static_cast<double>(values[0]), static_cast<double>(values[1]),
          static_cast<double>(values[2])};
}

/// Solid angle of a triangle [3,3] seen from a point, positive from behind; 0 from its own plane's
/// corners and edges.
double solidAngle(const float* corners, const Vec3d& point) {
  const Vec3d a = vectorAt(corners) - point;
  const Vec3d b = vectorAt(corners + 3) - point;
  const Vec3d c = vectorAt(corners + 6) - point;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double above = a.dot(b.cross(c));
  const double below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  return above == 0 ? 0.0 : 2.0 * std::atan2(above, below);
}

}  // namespace

WindingNumber::WindingNumber(const TriMesh& mesh) {
  validate(mesh);
  const size_t count = mesh.triangleCount();
  std::vector<Vec3d> centroids(count);
  low_ = Vec3d::Constant(kInfinity);
  high_ = -low_;
  for (size_t t = 0; t < count; ++t) {
    Vec3d sum = Vec3d::Zero();
    for (size_t corner = 0; corner < 3; ++corner) {
      const Vec3d at = vectorAt(&mesh.positions[size_t{mesh.triangles[t * 3 + corner]} * 3]);
      low_ = low_.cwiseMin(at);
      high_ = high_.cwiseMax(at);
      sum += at;
    }
    centroids[t] = sum / 3.0;
  }
  std::vector<uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  nodes_.reserve(count / 2);
  build(0, static_cast<uint32_t>(count), order, centroids, mesh);
  corners_.resize(count * 9);
  for (size_t i = 0; i < count; ++i) {
    for (size_t corner = 0; corner < 3; ++corner) {
      const size_t vertex = mesh.triangles[size_t{order[i]} * 3 + corner];
      std::copy_n(&mesh.positions[vertex * 3], 3, &corners_[i * 9 + corner * 3]);
    }
  }
}

uint32_t WindingNumber::build(uint32_t begin, uint32_t end, std::vector<uint32_t>& order,
                              const std::vector<Vec3d>& centroids, const TriMesh& mesh) {
  const uint32_t index = static_cast<uint32_t>(nodes_.size());
  nodes_.emplace_back();
  Node node = {};
  node.begin = begin;
  node.end = end;
  const auto corner = [&](uint32_t t, size_t k) {
    return vectorAt(&mesh.positions[size_t{mesh.triangles[size_t{t} * 3 + k]} * 3]);
  };
  const auto areaVector = [&](uint32_t t) -> Vec3d {
    return 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
  };
  double total = 0;
  Vec3d weighted = Vec3d::Zero();
  Vec3d plain = Vec3d::Zero();
  Vec3d low = Vec3d::Constant(kInfinity);
  Vec3d high = -low;
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t t = order[i];
    const Vec3d area = areaVector(t);
    node.area += area;
    total += area.norm();
    weighted += area.norm() * centroids[t];
    plain += centroids[t];
    low = low.cwiseMin(centroids[t]);
    high = high.cwiseMax(centroids[t]);
  }
  node.centre = total > 0 ? Vec3d(weighted / total) : Vec3d(plain / (end - begin));
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t t = order[i];
    node.moment += areaVector(t) * (centroids[t] - node.centre).transpose();
    for (size_t k = 0; k < 3; ++k) {
      node.radius = std::max(node.radius, (corner(t, k) - node.centre).norm());
    }
  }
  if (end - begin > kLeafSize) {
    Eigen::Index axis = 0;
    (high - low).maxCoeff(&axis);
    const uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end,
                     [&](uint32_t a, uint32_t b) {
                       return centroids[a][axis] != centroids[b][axis]
                                  ? centroids[a][axis] < centroids[b][axis]
                                  : a < b;
                     });
    build(begin, middle, order, centroids, mesh);
    node.second = build(middle, end, order, centroids, mesh);
  }
  nodes_[index] = node;
  return index;
}

double WindingNumber::at(const Vec3d& point) const {
  // The tree halves its triangles, so its depth is at most 32 for any count that has an index.
  std::array<uint32_t, 64> stack;
  size_t size = 0;
  stack[size++] = 0;
  double sum = 0;
  while (size > 0) {
    const uint32_t index = stack[--size];
    const Node& node = nodes_[index];
    const Vec3d r = node.centre - point;
    const double squared = r.squaredNorm();
    const double reach = kFar * node.radius;
    if (squared > reach * reach) {
      // f(x) = r / |r|^3 and its derivative, under the node's area vectors.
      const double inverse = 1.0 / std::sqrt(squared);
      const double cube = inverse * inverse * inverse;
      sum += node.area.dot(r) * cube;
      sum += node.moment.trace() * cube - 3.0 * r.dot(node.moment * r) * cube * inverse * inverse;
    } else if (node.second != 0) {
      stack[size++] = node.second;
      stack[size++] = index + 1;
    } else {
      for (uint32_t i = node.begin; i < node.end; ++i) {
        sum += solidAngle(&corners_[size_t{i} * 9], point);
      }
    }
  }
  return sum / kFourPi;
}

double WindingNumber::exactAt(const Vec3d& point) const {
  double sum = 0;
  for (size_t i = 0; i < corners_.size(); i += 9) sum += solidAngle(&corners_[i], point);
  return sum / kFourPi;
}

bool WindingNumber::inBounds(const Vec3d& point) const {
  return (point.array() >= low_.array()).all() && (point.array() <= high_.array()).all();
}

std::vector<uint8_t> insideMesh(const TriMesh& mesh, std::span<const float> points,
                                const Mat4d& points_to_mesh, Progress* progress) {
  validateAffine(points_to_mesh, "points_to_mesh");
  advance(progress, 0.0, "Reading the mesh");
  const WindingNumber winding(mesh);
  const Mat3d linear = linearPart(points_to_mesh);
  const Vec3d move = translationPart(points_to_mesh);
  const size_t count = points.size() / 3;
  std::vector<uint8_t> inside(count);
  std::atomic<size_t> done{0};
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3d at = linear * vectorAt(&points[i * 3]) + move;
      inside[i] = winding.inBounds(at) && std::abs(winding.at(at)) >= 0.5 ? 1 : 0;
    }
    const size_t all = done.fetch_add(end - begin, std::memory_order_relaxed) + (end - begin);
    advance(progress, static_cast<double>(all) / static_cast<double>(count), "Testing splats");
  });
  return inside;
}

}  // namespace stipple
