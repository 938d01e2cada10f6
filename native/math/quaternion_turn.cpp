#include "math/quaternion_turn.h"

#include <Eigen/Geometry>

namespace stipple {

namespace {

using Quaternion = Eigen::Quaternionf;

Quaternion quaternionOf(const float* wxyz) {
  return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
}

void store(const Quaternion& q, float* wxyz) {
  wxyz[0] = q.w();
  wxyz[1] = q.x();
  wxyz[2] = q.y();
  wxyz[3] = q.z();
}

/// u with q = u p / |u|; its length is at least 1.
Quaternion factorOf(const float* turn) {
  return {1.0f, turn[0], turn[1], turn[2]};
}

}  // namespace

void turnQuaternion(const float* turn, float* wxyz) {
  store((factorOf(turn) * quaternionOf(wxyz)).normalized(), wxyz);
}

void turnQuaternionBackward(const float* turn, const float* wxyz, float* by_rotation,
                            float* by_turn) {
  const Quaternion u = factorOf(turn);
  const Quaternion q = quaternionOf(wxyz);
  const Quaternion by_q = quaternionOf(by_rotation);
  const float length = u.norm();
  const Quaternion p((u.conjugate() * q).coeffs() / length);
  // Across q, as its length stays 1.
  const Quaternion by_product((by_q.coeffs() - by_q.dot(q) * q.coeffs()) / length);
  const Quaternion by_u = by_product * p.conjugate();
  by_turn[0] = by_u.x();
  by_turn[1] = by_u.y();
  by_turn[2] = by_u.z();
  store(u.conjugate() * by_product, by_rotation);
}

}  // namespace stipple
