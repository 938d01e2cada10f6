#include "data/clouds/splat_colour.h"

#include <cmath>

#include "base/parallel.h"
#include "math/colour.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;

/// Slopes of the transfer functions of math/colour.h.
double slopeToSrgb(double linear) {
  const double v = std::abs(linear);
  return v <= 0.0031308 ? 12.92 : 1.055 / 2.4 * std::pow(v, 1.0 / 2.4 - 1.0);
}

double slopeToLinear(double display) {
  const double v = std::abs(display);
  return v <= 0.04045 ? 1.0 / 12.92 : 2.4 / 1.055 * std::pow((v + 0.055) / 1.055, 1.4);
}

}  // namespace

void convertColours(SplatCloud& cloud, ColourSpace to) {
  if (cloud.colour_space == to) return;
  cloud.colour_space = to;
  const bool encode = to == ColourSpace::kDisplay;
  const size_t stride = cloud.shStride();
  const size_t coefficients = shCoefficientCount(cloud.sh_degree);
  constexpr double kC0 = 0.28209479177387814;
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* sh = &cloud.sh[i * stride];
      for (size_t c = 0; c < 3; ++c) {
        const double before = kC0 * static_cast<double>(sh[c]) + 0.5;
        const double after = encode ? linearToSrgb(before) : srgbToLinear(before);
        const double slope = encode ? slopeToSrgb(before) : slopeToLinear(before);
        sh[c] = static_cast<float>((after - 0.5) / kC0);
        for (size_t k = 1; k < coefficients; ++k) {
          sh[k * 3 + c] = static_cast<float>(static_cast<double>(sh[k * 3 + c]) * slope);
        }
      }
    }
  });
}

}  // namespace stipple
