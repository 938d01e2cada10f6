#pragma once

#include <optional>
#include <span>

#include "math/vec.h"

namespace stipple {

struct Line {
  Vec3d place = Vec3d::Zero();
  Vec3d direction = Vec3d::UnitZ();  ///< unit
};

/// The place with the least sum of squared distances to lines. None where they are parallel, or
/// nearly: a hundredth of a radian apart.
std::optional<Vec3d> nearestToLines(std::span<const Line> lines);

}  // namespace stipple
