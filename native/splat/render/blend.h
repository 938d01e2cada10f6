#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

// The one blending equation. A splat is a Gaussian of pixel coordinates with opacity o; with
// q = d^T C^-1 d, C its projected covariance and d the pixel centre minus the projected centre,
//   alpha = min(0.99, o exp(-q/2)),
// skipped below 1/255, or what the picture's cut-off is. Splats come front to back; T starts at 1:
//   colour += T alpha c,   T <- T (1 - alpha),
// and a splat that would bring T below 1e-4 is left out and ends the pixel.
//
// Something else, a mesh, may stand between the splats: a surface of premultiplied colour S,
// opacity a and depth z. It comes after the splats whose centres are no deeper than z and before
// the others, as if it were one more splat, except that it is never left out:
//   w = T,   T <- T (1 - a),
// and the pixel is what the splats summed up to, plus w S; T below 1e-4 ends it. Without a colour
// the surface is a matte: a = 1, and nothing is added. It may also hide more than a, up to 1, of
// what is behind it, and a splat may be a holdout: both take their share of T and add nothing, so
// colour and alpha are those of the rest, sum of w and not 1 - T. Depths compare as the numbers of
// single precision by which splats are sorted; a splat at exactly z comes first. Based on: Zwicker,
// Pfister, van Baar and Gross, EWA Volume Splatting, Visualization 2001; Kerbl, Kopanas,
// Leimkuehler and Drettakis, 3D Gaussian Splatting, SIGGRAPH 2023, section 6.

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

/// Alpha of a splat at one pixel, 0 where it is skipped. In: least, what still counts.
template <typename T>
T splatAlpha(T opacity, T half_squared_distance, T least = T(kMinAlpha)) {
  // exp(-6) is below 1/255: far pixels need no exponential. Below any other cut-off, 0 does.
  if (!(half_squared_distance < (least < T(kMinAlpha) ? T(700) : T(6)))) return T(0);
  const T alpha = std::min(T(kMaxAlpha), opacity * std::exp(-half_squared_distance));
  return alpha < least ? T(0) : alpha;
}

/// The depth of a splat that its place between surfaces goes by.
inline float orderingDepth(double depth) {
  return static_cast<float>(std::min(depth, 1e38));
}

/// A surface at one pixel.
template <typename T>
struct SurfaceAtPixel {
  float depth;       ///< planar z, metres; kNoSurface: behind everything
  T transmittance;   ///< 1 - a
  bool shows;        ///< false: a matte
  T opacity = T(0);  ///< a, with every digit of a little; for depthWithSurface
};

/// Above every orderingDepth.
constexpr float kNoSurface = 3e38f;

/// One pixel while splats are blended into it.
template <typename T>
struct PixelBlend {
  T transmittance = T(1);
  T colour[3] = {T(0), T(0), T(0)};
  T weighted_depth = T(0);   ///< sum of w z
  T median_depth = T(-1);    ///< meaningful where has_median
  T surface_weight = T(-1);  ///< w of the surface; below 0 while it has not come
  uint32_t count = 0;        ///< splats blended
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

  bool isBefore(const SurfaceAtPixel<T>& surface, float ordering_depth) const {
    return surface_weight >= T(0) || !(ordering_depth > surface.depth);
  }

  /// The surface's turn: a splat behind it, or the end of the pixel.
  void addSurface(const SurfaceAtPixel<T>& surface) {
    surface_weight = transmittance;
    transmittance *= surface.transmittance;
    if (surface.shows && surface.depth < kNoSurface && !has_median && transmittance < T(0.5)) {
      has_median = true;
      median_depth = T(surface.depth);
    }
    if (transmittance < T(kMinTransmittance)) finished = true;
  }

  /// What the splats alone cover, once the surface has come: every digit of a little is kept, and
  /// it is exactly 0 where no splat blends.
  T splatCoverage(const SurfaceAtPixel<T>& surface) const {
    return (T(1) - surface_weight) + (surface_weight * surface.transmittance - transmittance);
  }
};

/// Expected depth with a surface: as given where no splat blends; that of the splats alone for a
/// matte and for a surface behind everything. In: empty, the depth of nothing.
template <typename T>
T depthWithSurface(T weighted_depth, T splat_coverage, const SurfaceAtPixel<T>& surface,
                   T surface_weight, T empty) {
  const bool has_depth = surface.shows && surface.depth < kNoSurface;
  if (splat_coverage == T(0)) return has_depth ? T(surface.depth) : empty;
  if (!has_depth) return weighted_depth / splat_coverage;
  const T own = surface_weight * surface.opacity;
  return (weighted_depth + own * T(surface.depth)) / (splat_coverage + own);
}

}  // namespace stipple
