// What a deformed mesh makes of the splats that are bound to it.
#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/cloud_bytes.h"
#include "motion/shape_kernel.h"
#include "motion/surface_binding.h"
#include "motion/triangle_motion.h"
#include "motion/turn_kernel.h"

namespace stipple {

namespace {

/// A multiple of every vector, so that no row's bits depend on where a range begins.
constexpr size_t kGrain = 1024;

/// Motions of the triangles that splats are bound to; of others nothing is known.
std::vector<TriangleMotion> motionsOf(const SurfaceBinding& binding,
                                      std::span<const float> deformed) {
  std::vector<TriangleMotion> motions(binding.triangles.size() / 3);
  std::vector<uint8_t> used(motions.size());
  for (const uint32_t triangle : binding.bound) used[triangle] = 1;
  parallelFor(motions.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      if (used[t]) motions[t] = triangleMotion(binding.rest, deformed, &binding.triangles[3 * t]);
    }
  });
  return motions;
}

Mat3d matrixOf(const std::array<float, 9>& entries) {
  Mat3d matrix;
  for (size_t k = 0; k < 9; ++k) {
    matrix(static_cast<Eigen::Index>(k / 3), static_cast<Eigen::Index>(k % 3)) =
        static_cast<double>(entries[k]);
  }
  return matrix;
}

/// One row's place, and the deformation of its shape.
struct Carried {
  std::array<float, 3> place{};
  std::array<float, 9> shape{};
};

Carried carriedRow(const std::vector<TriangleMotion>& motions, const SurfaceBinding& binding,
                   size_t row, const float* at) {
  Carried carried;
  for (size_t i = 0; i < binding.influences; ++i) {
    const size_t index = row * binding.influences + i;
    const TriangleMotion& motion = motions[binding.bound[index]];
    const float weight = binding.weights[index];
    std::array<float, 3> offset;
    for (size_t axis = 0; axis < 3; ++axis) offset[axis] = at[axis] - motion.rest[axis];
    for (size_t axis = 0; axis < 3; ++axis) {
      const float* line = &motion.linear[3 * axis];
      carried.place[axis] += weight * (motion.place[axis] + line[0] * offset[0] +
                                       line[1] * offset[1] + line[2] * offset[2]);
    }
    for (size_t k = 0; k < 9; ++k) carried.shape[k] += weight * motion.shape[k];
  }
  if (binding.influences == 1) return carried;
  // A sum of deformations that turn differently shrinks; far apart it may even flatten.
  const Mat3d bounded = boundedStretch(matrixOf(carried.shape));
  for (size_t k = 0; k < 9; ++k) {
    carried.shape[k] = static_cast<float>(
        bounded(static_cast<Eigen::Index>(k / 3), static_cast<Eigen::Index>(k % 3)));
  }
  return carried;
}

}  // namespace

SplatCloud carriedSplats(const SplatCloud& cloud, const SurfaceBinding& binding,
                         std::span<const float> deformed) {
  if (deformed.size() != binding.rest.size()) {
    fail(ErrorCode::kInvalidArgument,
         "the deformed mesh has " + std::to_string(deformed.size() / 3) +
             " vertices; splats are bound to one of " + std::to_string(binding.rest.size() / 3));
  }
  if (binding.size() != cloud.size()) {
    fail(ErrorCode::kInvalidArgument, "the binding is of " + std::to_string(binding.size()) +
                                          " splats; there are " + std::to_string(cloud.size()));
  }
  for (const float value : deformed) {
    if (!std::isfinite(value)) {
      fail(ErrorCode::kInvalidArgument, "the deformed mesh has a place that is not finite");
    }
  }
  const std::vector<TriangleMotion> motions = motionsOf(binding, deformed);
  const ShapeKernel kernel = chosenShapeKernel();
  const TurnKernel turns = chosenTurnKernel();
  SplatCloud carried;
  carried.sh_degree = cloud.sh_degree;
  carried.colour_space = cloud.colour_space;
  carried.antialias = cloud.antialias;
  carried.frame = cloud.frame;
  carried.resize(cloud.size());
  const size_t sh_stride = cloud.shStride();
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    std::vector<float> shapes(9 * kGrain);
    for (size_t row = begin; row < end; ++row) {
      const Carried one = carriedRow(motions, binding, row, &cloud.positions[3 * row]);
      std::copy(one.place.begin(), one.place.end(), &carried.positions[3 * row]);
      for (size_t k = 0; k < 9; ++k) shapes[k * kGrain + row - begin] = one.shape[k];
    }
    kernel.deform({shapes.data(), kGrain, &cloud.rotations[4 * begin], &cloud.scales[3 * begin],
                   &carried.rotations[4 * begin], &carried.scales[3 * begin]},
                  end - begin);
    std::copy(&cloud.opacities[begin], &cloud.opacities[begin] + (end - begin),
              &carried.opacities[begin]);
    std::copy(&cloud.sh[begin * sh_stride],
              &cloud.sh[begin * sh_stride] + (end - begin) * sh_stride,
              &carried.sh[begin * sh_stride]);
    if (cloud.sh_degree > 0) {
      turns.turn({shapes.data(), kGrain, &carried.sh[begin * sh_stride], cloud.sh_degree},
                 end - begin);
    }
  });
  return carried;
}

uint64_t carriedMemoryBound(const SplatCloud& cloud, const SurfaceBinding& binding) {
  return cloudBytes(cloud.size(), cloud.sh_degree) +
         binding.triangles.size() / 3 * (sizeof(TriangleMotion) + 1);
}

}  // namespace stipple
