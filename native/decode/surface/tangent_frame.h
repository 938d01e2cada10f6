#pragma once

#include <cmath>

namespace stipple {

/// Two unit vectors that make a right-handed frame (u, v, n) with a unit normal.
/// Based on: Duff, Burgess, Christensen, Hery, Kensler, Liani, Villemin, Building an Orthonormal
/// Basis, Revisited, JCGT 2017.
struct TangentFrame {
  float u[3];
  float v[3];

  explicit TangentFrame(const float* n) {
    const float sign = std::copysign(1.0f, n[2]);
    const float a = -1.0f / (sign + n[2]);
    const float b = n[0] * n[1] * a;
    u[0] = 1.0f + sign * n[0] * n[0] * a;
    u[1] = sign * b;
    u[2] = -sign * n[0];
    v[0] = b;
    v[1] = sign + n[1] * n[1] * a;
    v[2] = -n[1];
  }
};

}  // namespace stipple
