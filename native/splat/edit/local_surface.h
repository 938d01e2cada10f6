#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"
#include "splat/edit/ground_plane.h"

namespace stipple {

/// The ground around a place as a height over its plane: h(u, v) of second degree, fitted to points
/// that lie near it, so that it bridges a hole of gently bent ground.
class LocalSurface {
 public:
  /// Along the plane, and above it.
  struct Place {
    double u, v, h;
  };

  /// In: origin: the place that u = v = 0 is over or under; points near the plane count. `reach`:
  /// metres from the plane within which points are looked at first.
  LocalSurface(const Plane& plane, const Vec3d& origin, std::span<const Vec3d> points,
               double reach);

  /// h is above the surface, not above the plane.
  Place placeOf(const Vec3d& point) const;
  Vec3d pointAt(const Place& place) const;
  /// The parts of a direction along u and v.
  Vec2d along(const Vec3d& direction) const { return {u_.dot(direction), v_.dot(direction)}; }
  /// The rotation that leads the surface's direction at one place to that at another, by the
  /// smallest turn; the identity, bit for bit, where the surface is a plane.
  Mat3d turn(double from_u, double from_v, double to_u, double to_v) const;
  /// Metres around the surface in which most of its points lie.
  double band() const { return band_; }

 private:
  double height(double u, double v) const;
  Vec3d normal(double u, double v) const;
  void fit(const std::vector<Place>& places, double reach, bool bends);

  Vec3d origin_, u_, v_, n_;
  double unit_ = 1;                   ///< metres: coordinates are divided by it
  std::array<double, 6> terms_ = {};  ///< of 1, u, v, uu, uv, vv, in units
  double band_ = 0;
};

}  // namespace stipple
