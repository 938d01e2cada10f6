#include "fit/registration/registration_target.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "math/quaternion.h"
#include "math/vec.h"
#include "mesh/surface_sampling.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;
/// Below one step of eight bits a splat is not seen.
constexpr float kUnseen = 1.0f / 255;

/// Every so many of a list, `most` at most.
std::vector<size_t> evenly(size_t count, size_t most) {
  std::vector<size_t> chosen(std::min(count, most));
  for (size_t i = 0; i < chosen.size(); ++i) {
    chosen[i] = static_cast<size_t>((static_cast<double>(i) + 0.5) * static_cast<double>(count) /
                                    static_cast<double>(chosen.size()));
  }
  return chosen;
}

/// The shortest axis, as long as the splat is flat: 1 - shortest / second.
Vec3f flatAxis(const SplatCloud& cloud, size_t i) {
  const float* scales = &cloud.scales[i * 3];
  int shortest = 0;
  for (int axis = 1; axis < 3; ++axis) {
    if (scales[axis] < scales[shortest]) shortest = axis;
  }
  const float second = std::min(scales[(shortest + 1) % 3], scales[(shortest + 2) % 3]);
  if (!(second > 0)) return Vec3f::Zero();
  const Vec3f axis = rotationFromQuaternion<float>(&cloud.rotations[i * 4]).col(shortest);
  return axis * (1 - scales[shortest] / second);
}

}  // namespace

RegistrationTarget targetOfMesh(const TriMesh& mesh, size_t count, uint64_t seed) {
  SurfaceSamplingOptions options;
  options.count = count;
  options.detail_weight = 0;
  options.seed = seed;
  PointSet samples = sampleSurface(mesh, options);
  RegistrationTarget target;
  target.points = std::move(samples.positions);
  target.normals = std::move(samples.normals);
  target.positions = mesh.positions;
  target.triangles = mesh.triangles;
  return target;
}

RegistrationTarget targetOfSplats(const SplatCloud& cloud, size_t count) {
  validate(cloud, "target");
  std::vector<size_t> seen;
  for (size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.opacities[i] >= kUnseen) seen.push_back(i);
  }
  if (seen.empty()) {
    fail(ErrorCode::kInvalidArgument, "the target has " + std::to_string(cloud.size()) +
                                          " splats, none of which is seen; at least one is needed");
  }
  const std::vector<size_t> chosen = evenly(seen.size(), count);
  RegistrationTarget target;
  target.is_oriented = false;
  target.points.resize(chosen.size() * 3);
  target.normals.resize(chosen.size() * 3);
  target.weights.resize(chosen.size());
  parallelFor(chosen.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const size_t i = seen[chosen[row]];
      const Vec3f normal = flatAxis(cloud, i);
      for (size_t axis = 0; axis < 3; ++axis) {
        target.points[row * 3 + axis] = cloud.positions[i * 3 + axis];
        target.normals[row * 3 + axis] = normal[static_cast<Eigen::Index>(axis)];
      }
      target.weights[row] = cloud.opacities[i];
    }
  });
  return target;
}

RegistrationTarget targetOfPoints(std::span<const float> points, std::span<const float> normals,
                                  size_t count) {
  if (points.size() < 3) {
    fail(ErrorCode::kInvalidArgument, "the target has 0 points; at least one is needed");
  }
  if (!normals.empty() && normals.size() != points.size()) {
    fail(ErrorCode::kInvalidArgument, "the target has " + std::to_string(normals.size() / 3) +
                                          " normals; its " + std::to_string(points.size() / 3) +
                                          " points need one each, or none has any");
  }
  requireFinite(points.data(), points.size(), 3, "target: point");
  requireFinite(normals.data(), normals.size(), 3, "target: normal of point");
  RegistrationTarget target;
  for (const size_t i : evenly(points.size() / 3, count)) {
    const auto row = static_cast<std::ptrdiff_t>(i * 3);
    target.points.insert(target.points.end(), points.begin() + row, points.begin() + row + 3);
    if (normals.empty()) continue;
    const Vec3d normal(static_cast<double>(normals[i * 3]), static_cast<double>(normals[i * 3 + 1]),
                       static_cast<double>(normals[i * 3 + 2]));
    const double length = normal.stableNorm();
    for (int axis = 0; axis < 3; ++axis) {
      target.normals.push_back(length > 0 ? static_cast<float>(normal[axis] / length) : 0.0f);
    }
  }
  return target;
}

RegistrationTarget targetOf(const TargetSource& source, size_t count, uint64_t seed) {
  if (source.mesh) return targetOfMesh(*source.mesh, count, seed);
  if (source.cloud) return targetOfSplats(*source.cloud, count);
  return targetOfPoints(source.points, source.normals, count);
}

}  // namespace stipple
