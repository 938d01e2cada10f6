#include "decode/field/contraction.h"

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

/// Of the inner half: the farthest that a place can be.
constexpr double kFarthest = 64;
/// Its place in the root, in halves of the inner cube: r in the world is at 2 - 1/r.
constexpr double kOutermost = 2 - 1 / kFarthest;

}  // namespace

Contraction::Contraction(const RootCube& root)
    : middle_(Vec3d(root.origin[0], root.origin[1], root.origin[2]) +
              Vec3d::Constant(0.5 * root.side)),
      half_(0.25 * root.side) {}

double Contraction::factor(const Vec3d& place) const {
  const double reach = (place - middle_).cwiseAbs().maxCoeff() / half_;
  if (reach <= 1) return 1;
  const double held = std::min(reach, kOutermost);
  return 1 / (held * (2 - held));
}

Vec3d Contraction::fromWorld(const Vec3d& world) const {
  const double distance = (world - middle_).cwiseAbs().maxCoeff() / half_;
  if (distance <= 1) return world;
  const double reach = 2 - 1 / std::min(distance, kFarthest);
  return middle_ + reach / distance * (world - middle_);
}

Vec3d Contraction::backward(const Vec3d& place, const Vec3d& by_world, double by_factor) const {
  const Vec3d from_middle = place - middle_;
  int axis = 0;
  const double reach = from_middle.cwiseAbs().maxCoeff(&axis) / half_;
  const double scale = factor(place);
  Vec3d by_place = scale * by_world;
  if (reach <= 1 || reach >= kOutermost) return by_place;
  const double by_reach = (2 * reach - 2) * scale * scale;
  const double sign = from_middle[axis] < 0 ? -1.0 : 1.0;
  by_place[axis] += (by_world.dot(from_middle) + by_factor) * by_reach * sign / half_;
  return by_place;
}

}  // namespace stipple
