#pragma once

#include <array>

#include "math/vec.h"

namespace stipple {

/// How a lens moves points of the image plane: from (x, y) = (X/Z, Y/Z), where a pinhole would see
/// them, to where the lens does. In order: the angle (fisheye), the field of view, the radial
/// factor (1 + sum radial_i r^2i) / (1 + sum divisor_i r^2i), then tangential and prism terms.
/// All zero: a pinhole.
struct Lens {
  bool fisheye = false;                  ///< equidistant: the radius becomes the angle to the axis
  double field_of_view = 0;              ///< omega of the FOV model, radians; 0: without it
  std::array<double, 6> radial{};        ///< of r^2, r^4 ... r^12
  std::array<double, 3> divisor{};       ///< of r^2, r^4, r^6
  double division = 0;                   ///< k of the division model, r_u = r_d / (1 + k r_d^2)
  std::array<double, 2> tangential{};    ///< p1, p2
  std::array<double, 4> prism{};         ///< of r^2 and r^4: x, x, y, y
  bool tangential_after_radial = false;  ///< its terms see the radius after the radial factor

  bool isDistorted() const;
};

/// Where the lens sees a point of the plane at distance 1. Not finite, or far away, beyond what the
/// model describes.
/// Source: COLMAP's camera models (colmap.github.io/cameras.html); Brown, Decentering distortion of
/// lenses, 1966; Kannala and Brandt, A generic camera model, TPAMI 2006; Devernay and Faugeras,
/// Straight lines have to be straight, 2001 (FOV); Fitzgibbon, Simultaneous linear estimation of
/// multiple view geometry and lens distortion, CVPR 2001 (division).
Vec2d distort(const Lens& lens, const Vec2d& point);

/// The radius, at most `limit`, up to which the lens maps one to one: beyond it a model of high
/// degree folds the picture over, and what it says there is not to be used.
double validRadius(const Lens& lens, double limit);

}  // namespace stipple
