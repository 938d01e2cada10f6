#pragma once

#include <Eigen/Core>

namespace stipple {

using Vec2d = Eigen::Vector2d;
using Vec3d = Eigen::Vector3d;
using Vec4d = Eigen::Vector4d;
using Vec2f = Eigen::Vector2f;
using Vec3f = Eigen::Vector3f;
using Mat3d = Eigen::Matrix3d;
using Mat3f = Eigen::Matrix3f;
/// 4×4, row-major like every matrix that crosses the C header: rows are contiguous.
using Mat4d = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

}  // namespace stipple
