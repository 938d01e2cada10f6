#include "io/views/camera_pose.h"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace stipple {

bool takeNearestRotation(Mat3d& rotation, double& error) {
  // Cameras under a scaled parent carry its scale, which means nothing for a camera.
  for (int axis = 0; axis < 3; ++axis) rotation.col(axis).normalize();
  error = (rotation.transpose() * rotation - Mat3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error < kRotationTolerance) || !(rotation.determinant() > 0)) return false;
  const Eigen::JacobiSVD<Mat3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  rotation = svd.matrixU() * svd.matrixV().transpose();
  return true;
}

void placeCamera(const Mat3d& axes, const Vec3d& centre, Camera& camera) {
  camera.world_to_camera = Mat4d::Identity();
  camera.world_to_camera.topLeftCorner<3, 3>() = axes.transpose();
  camera.world_to_camera.topRightCorner<3, 1>() = -(axes.transpose() * centre);
}

}  // namespace stipple
