#pragma once

#include <span>
#include <vector>

#include "math/vec.h"

namespace stipple {

/// An affine frame that moves through given steps, which are evenly spaced over the time 0..1.
/// Between two of them the rotation nearest to each turns at an even rate (slerp, the short way),
/// what is left (scale, shear, mirror) and the translation go straight. At a step the matrix is the
/// given one, bit for bit, and so between two that are equal.
/// Based on: Shoemake, Animating Rotation with Quaternion Curves, SIGGRAPH 1985; Shoemake and Duff,
/// Matrix Animation and Polar Decomposition, Graphics Interface 1992.
class MovingFrame {
 public:
  /// In: steps [1 or more], each accepted by validateAffine.
  explicit MovingFrame(std::span<const Mat4d> steps);

  /// In: time 0..1.
  Mat4d at(double time) const;

 private:
  struct Step {
    Mat4d matrix;
    Vec4d rotation;  ///< unit quaternion
    Mat3d rest;      ///< matrix = rotation * rest, but for the translation
  };
  std::vector<Step> steps_;
};

/// Inverse of a rotation and a translation.
Mat4d rigidInverse(const Mat4d& matrix);

}  // namespace stipple
