#pragma once

#include <vector>

#include "splat/render/projection.h"
#include "splat/render/scene.h"

namespace stipple {

/// A splat in the affine picture, with the depth at which it is densest behind each pixel.
struct AffineSplat {
  Footprint<double> footprint;
  double half_x, half_y;  ///< pixels: beyond them alpha is below the least that counts
  double depth;           ///< view z of the centre, metres
  double slope[2];        ///< metres per pixel: depth + slope . d, d from the centre
  double colour[3];
  bool is_holdout;
  uint32_t index;  ///< among all splats of the picture

  /// Depth of the largest response behind a pixel: the mean of z, given the pixel, of the Gaussian
  /// that the affine projection makes of the splat.
  double depthAt(double dx, double dy) const { return depth + slope[0] * dx + slope[1] * dy; }
};

/// Projects splat `index` of its cloud. Returns false where no pixel of any picture would have an
/// alpha of least_alpha. Leaves the colour.
bool makeAffineSplat(const PlacedScene& scene, const PlacedCloud& placed, size_t index,
                     double least_alpha, AffineSplat& splat);

/// Splats that may show an alpha of least_alpha or more in the picture, centres between the near
/// and the far plane; by rounded view z, then by place in the scene.
std::vector<AffineSplat> affineSplats(const PlacedScene& scene, double least_alpha);

}  // namespace stipple
