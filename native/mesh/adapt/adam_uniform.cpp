// Based on: Nicolet, Jacobson, Jakob, Large Steps in Inverse Rendering of Geometry, SIGGRAPH Asia
// 2021, section 4.
#include "mesh/adapt/adam_uniform.h"

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr double kFirstDecay = 0.9;
constexpr double kSecondDecay = 0.999;
constexpr double kSmallest = 1e-8;

}  // namespace

AdamUniform::AdamUniform(size_t count, double step_size)
    : step_size_(step_size), first_(count, Vec3d::Zero()), second_(count, Vec3d::Zero()) {}

void AdamUniform::step(std::span<Vec3d> values, std::span<const Vec3d> gradient, double share) {
  first_share_ *= kFirstDecay;
  second_share_ *= kSecondDecay;
  double largest = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    first_[i] = kFirstDecay * first_[i] + (1 - kFirstDecay) * gradient[i];
    second_[i] = kSecondDecay * second_[i] + (1 - kSecondDecay) * gradient[i].cwiseAbs2();
    largest = std::max(largest, second_[i].maxCoeff());
  }
  const double factor = share * step_size_ / (1 - first_share_) /
                        (kSmallest + std::sqrt(largest / (1 - second_share_)));
  for (size_t i = 0; i < values.size(); ++i) values[i] -= factor * first_[i];
}

}  // namespace stipple
