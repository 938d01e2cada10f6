#include <algorithm>

#include "math/principal_axes.h"
#include "math/quaternion.h"
#include "motion/shape_kernel.h"

namespace stipple {

namespace {

void deformScalar(const ShapeColumns& splats, size_t count) {
  for (size_t row = 0; row < count; ++row) {
    Mat3d deformation;
    for (size_t i = 0; i < 9; ++i) {
      deformation(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3)) =
          static_cast<double>(splats.deformations[i * splats.stride + row]);
    }
    const float* scales = splats.scales + 3 * row;
    const float largest = std::max({scales[0], scales[1], scales[2]});
    Mat3d shape = deformation * rotationFromQuaternion<double>(splats.rotations + 4 * row);
    Vec3d kept;
    for (int axis = 0; axis < 3; ++axis) {
      // A flat splat has the axes of one that is hardly flat.
      const float scale = scales[axis];
      const float floor = largest > 0 ? largest * kFlatness : 1.0f;
      shape.col(axis) *= static_cast<double>(std::max(scale, floor));
      kept[axis] = scale < floor ? static_cast<double>(scale) / static_cast<double>(floor) : 1.0;
    }
    const PrincipalAxes axes = principalAxes(shape);
    const Vec4d rotation = quaternionFromRotation(axes.axes);
    for (int i = 0; i < 4; ++i) {
      splats.out_rotations[4 * row + static_cast<size_t>(i)] = static_cast<float>(rotation[i]);
    }
    for (int axis = 0; axis < 3; ++axis) {
      splats.out_scales[3 * row + static_cast<size_t>(axis)] =
          static_cast<float>(axes.lengths[axis] * kept[axis]);
    }
  }
}

}  // namespace

ShapeKernel scalarShapeKernel() {
  return {"scalar", deformScalar};
}

}  // namespace stipple
