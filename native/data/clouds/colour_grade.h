#pragma once

#include <array>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// What an artist sets; the defaults change nothing.
struct GradeSettings {
  double exposure = 0.0;                         ///< stops, -16..16; +1 doubles the light
  std::array<double, 3> tint = {1.0, 1.0, 1.0};  ///< factor of the light of each channel, 0..16
  double saturation = 1.0;                       ///< 0 (grey)..16, about Rec.709 luma
  double opacity = 1.0;                          ///< factor of every splat's opacity, 0..1
};

/// An affine map of colours as they are stored (harmonics in any direction + 0.5, before anything
/// is clamped): matrix colour + offset; and a factor of opacities. The same map of the harmonics
/// gives the same colours, so a grade costs no change of the splats. Nothing is clamped by it.
struct ColourGrade {
  std::array<double, 9> matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< row-major, entries up to 1e9
  std::array<double, 3> offset = {0, 0, 0};                    ///< entries up to 1e9
  double opacity = 1.0;                                        ///< 0..1

  bool changesColour() const;
  bool isNeutral() const { return !changesColour() && opacity == 1.0; }
};

/// The map of settings, for colours stored in `space`: the light of each channel times its factor
/// f = 2^exposure tint, then luma + saturation (colour - luma).
/// Scene linear: colour -> f colour. Display: with g = f^(1/2.4), colour -> g colour + 0.055 (g -
/// 1), exactly what f does to the light of colours above the foot of the sRGB curve (0.04045)
/// before and after; below it the value is off by up to 0.055 |g - 1|, and never by more than 0.055
/// where f < 1. Saturation of display colours acts on display values. Errors: kInvalidArgument for
/// a setting outside its range.
ColourGrade gradeOf(const GradeSettings& settings, ColourSpace space);

/// Refuses values that are not finite or outside their range. In: what, as a noun.
void validate(const ColourGrade& grade, const char* what);

/// In and out: colour [3] as stored.
template <typename T>
void applyGrade(const ColourGrade& grade, T* colour) {
  const T in[3] = {colour[0], colour[1], colour[2]};
  for (size_t c = 0; c < 3; ++c) {
    const double* row = &grade.matrix[c * 3];
    colour[c] = T(row[0]) * in[0] + T(row[1]) * in[1] + T(row[2]) * in[2] + T(grade.offset[c]);
  }
}

/// The cloud with the grade in its harmonics and opacities; one that is neutral keeps every bit.
/// Errors: as validate() of the grade; kInvalidArgument where a coefficient leaves float32.
/// Cost: O(N), all threads.
void bakeGrade(SplatCloud& cloud, const ColourGrade& grade);

}  // namespace stipple
