#pragma once

#include "splat/render/projection.h"

// splat/render/projection.h backwards. The loss depends on a footprint through the pixels' offsets d from
// its centre; with e = L d, L L^T... the form |L d|^2 = d^T C^-1 d, and M = sum of s e e^T,
//   dL/dmean = L^T (sum of s e),   dL/dC = 1/2 L^T M L,   dL/dA = L^T M (L A)
// for C = A A^T + variance I. L A has rows of length <= 1, so needles lose no digits here either.

namespace stipple {

/// Derivatives by a footprint, as sums over its pixels: s = alpha dL/dalpha, e = L d.
template <typename T>
struct FootprintGradient {
  T s;          ///< sum of s
  T first[2];   ///< sum of s e
  T second[3];  ///< sum of s e e^T: entries 00, 01, 11
  T depth;      ///< by the depth of the centre
};

template <typename T>
struct ProjectionGradient {
  T mean[2];  ///< by the projected centre, per pixel
  T position[3];
  T rotation[4];
  T scales[3];
  T opacity;
  T centre[3];  ///< by the centre in the camera's frame
  T turn[3];    ///< by a rotation about the camera's origin, radians
};

/// L, lower triangular.
template <typename T>
struct InverseFactor {
  T l00, l10, l11;
};

#include "splat/render/projection_backward_steps-inl.h"

}  // namespace stipple
