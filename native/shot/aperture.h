#pragma once

#include <cstdint>

#include "math/vec.h"

namespace stipple {

/// The opening of a lens, as Cycles has it.
struct Aperture {
  double radius = 0;          ///< metres; 0: everything is sharp
  double focus_distance = 1;  ///< metres, as depths are; there everything is sharp
  uint32_t blades = 0;  ///< 3 to 64: a regular polygon with its corners on the circle; 0: round
  double rotation = 0;  ///< of the polygon, radians, counterclockwise as the camera sees it
  double ratio = 1;     ///< the opening is that much narrower than high; above 0
};

/// Errors: kInvalidArgument.
void validate(const Aperture& aperture);

/// A point of the opening, metres to the right and downwards. In: u, v in 0..1; even points there
/// give even points here.
/// Source: Shirley and Chiu, A Low Distortion Map between Disk and Square, 1997.
Vec2d aperturePoint(const Aperture& aperture, double u, double v);

}  // namespace stipple
