#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

// The one blending equation. A splat is a Gaussian of pixel coordinates with opacity o; with
// q = d^T C^-1 d, C its projected covariance and d the pixel centre minus the projected centre,
//   alpha = min(0.99, o exp(-q/2)),
// skipped below 1/255. Splats come front to back; T starts at 1:
//   colour += T alpha c,   T <- T (1 - alpha),
// and a splat that would bring T below 1e-4 is left out and ends the pixel.
// Based on: Zwicker, Pfister, van Baar and Gross, EWA Volume Splatting, Visualization 2001;
// Kerbl, Kopanas, Leimkuehler and Drettakis, 3D Gaussian Splatting, SIGGRAPH 2023, section 6.

namespace stipple {

constexpr double kMaxAlpha = 0.99;
constexpr double kMinAlpha = 1.0 / 255.0;
constexpr double kMinTransmittance = 1e-4;

/// The projected splat: the form |L d|^2 = d^T C^-1 d with L lower triangular, which loses no
/// digits on needles, unlike the three entries of C^-1.
template <typename T>
struct Footprint {
  T mean_x;   ///< pixels
  T mean_y;   ///< pixels
  T l00;      ///< 1/pixels
  T l10;      ///< 1/pixels
  T l11;      ///< 1/pixels
  T opacity;  ///< with the compensation of the low-pass
};

/// q/2 at the offset (dx, dy) from the centre, pixels.
template <typename T>
T halfSquaredDistance(const Footprint<T>& footprint, T dx, T dy) {
  const T g0 = footprint.l00 * dx;
  const T g1 = footprint.l10 * dx + footprint.l11 * dy;
  return T(0.5) * (g0 * g0 + g1 * g1);
}

/// Alpha of a splat at one pixel, 0 where it is skipped.
template <typename T>
T splatAlpha(T opacity, T half_squared_distance) {
  // exp(-6) is below 1/255: far pixels need no exponential (and do not underflow).
  if (!(half_squared_distance < T(6))) return T(0);
  const T alpha = std::min(T(kMaxAlpha), opacity * std::exp(-half_squared_distance));
  return alpha < T(kMinAlpha) ? T(0) : alpha;
}

/// One pixel while splats are blended into it.
template <typename T>
struct PixelBlend {
  T transmittance = T(1);
  T colour[3] = {T(0), T(0), T(0)};
  T weighted_depth = T(0);  ///< sum of w z
  T median_depth = T(-1);   ///< meaningful where has_median
  uint32_t count = 0;       ///< splats blended
  bool has_median = false;
  bool finished = false;  ///< no further splat counts

  /// Blends one splat of alpha > 0.
  template <typename Colour>
  void add(T alpha, const Colour* splat_colour, T depth) {
    const T next = transmittance * (T(1) - alpha);
    if (next < T(kMinTransmittance)) {
      finished = true;
      return;
    }
    const T weight = transmittance * alpha;
    for (int c = 0; c < 3; ++c) colour[c] += weight * T(splat_colour[c]);
    weighted_depth += weight * depth;
    if (!has_median && next < T(0.5)) {
      has_median = true;
      median_depth = depth;
    }
    transmittance = next;
    ++count;
  }
};

}  // namespace stipple
