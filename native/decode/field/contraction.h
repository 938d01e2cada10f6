#pragma once

#include "density/octree_density.h"
#include "math/vec.h"

namespace stipple {

/// Unbounded space in a cube: the inner half of the root, by side, is as it is; what lies around it
/// is drawn in, out to 64 times as far, evenly in one over the distance.
/// Based on: Barron et al., Mip-NeRF 360, CVPR 2022, eq. 10. Differs: largest coordinate in place
/// of the length, so that the image is a cube.
class Contraction {
 public:
  explicit Contraction(const RootCube& root);

  /// How much larger things are in the world than in the root, at a place of the root (metres, in
  /// its frame): of lengths across the direction from the middle. 1 in the inner half.
  double factor(const Vec3d& place) const;
  Vec3d toWorld(const Vec3d& place) const { return middle_ + factor(place) * (place - middle_); }
  Vec3d fromWorld(const Vec3d& world) const;

  /// Derivative by the place of the root. In: by_world: by toWorld(place); by_factor: by
  /// factor(place), beside what toWorld takes of it.
  Vec3d backward(const Vec3d& place, const Vec3d& by_world, double by_factor) const;

 private:
  Vec3d middle_;
  double half_;  ///< half a side of the inner cube, metres
};

}  // namespace stipple
