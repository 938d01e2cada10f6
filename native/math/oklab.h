#pragma once

#include <cmath>

#include "math/vec.h"

namespace stipple {

/// Lightness and two opponent colours of a colour in linear Rec.709: distances in it are about as
/// large as they look. Odd in its cube roots, so that colours outside 0..1 have a place, too.
/// Based on: Ottosson, A perceptual color space for image processing, 2020.
template <typename T>
Eigen::Matrix<T, 3, 1> oklabFromLinear(const Eigen::Matrix<T, 3, 1>& rgb) {
  const T l =
      std::cbrt(T(0.4122214708) * rgb[0] + T(0.5363325363) * rgb[1] + T(0.0514459929) * rgb[2]);
  const T m =
      std::cbrt(T(0.2119034982) * rgb[0] + T(0.6806995451) * rgb[1] + T(0.1073969566) * rgb[2]);
  const T s =
      std::cbrt(T(0.0883024619) * rgb[0] + T(0.2817188376) * rgb[1] + T(0.6299787005) * rgb[2]);
  return {T(0.2104542553) * l + T(0.7936177850) * m - T(0.0040720468) * s,
          T(1.9779984951) * l - T(2.4285922050) * m + T(0.4505937099) * s,
          T(0.0259040371) * l + T(0.7827717662) * m - T(0.8086757660) * s};
}

}  // namespace stipple
