// Based on: IEC 61966-2-1 (the sRGB curve is a power law of colour + 0.055 above its foot, so a
// factor of the light is an affine map of the stored colour); ITU-R BT.709 (luma).
#include "data/clouds/colour_grade.h"

#include <atomic>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;
constexpr double kLargestEntry = 1e9;
// Of the sRGB curve above its foot: light = ((colour + kLift) / (1 + kLift))^kPower.
constexpr double kLift = 0.055;
constexpr double kPower = 2.4;
constexpr double kLuma[3] = {0.2126, 0.7152, 0.0722};

/// In: owner, or an empty text. Allocates nothing where the value is right: pictures are drawn
/// again and again.
void requireRange(double value, double low, double high, const char* owner, const char* name) {
  if (value >= low && value <= high) return;
  const std::string prefix(owner);
  fail(ErrorCode::kInvalidArgument, prefix + (prefix.empty() ? "" : ": ") + name + " is " +
                                        numberText(value) + "; " + numberText(low) + " to " +
                                        numberText(high) + " is allowed");
}

}  // namespace

bool ColourGrade::changesColour() const {
  const ColourGrade neutral;
  return matrix != neutral.matrix || offset != neutral.offset;
}

ColourGrade gradeOf(const GradeSettings& settings, ColourSpace space) {
  requireRange(settings.exposure, -16, 16, "", "exposure");
  for (const double value : settings.tint) requireRange(value, 0, 16, "", "tint");
  requireRange(settings.saturation, 0, 16, "", "saturation");
  requireRange(settings.opacity, 0, 1, "", "opacity");
  double gain[3];
  double lift[3];
  for (size_t c = 0; c < 3; ++c) {
    gain[c] = std::exp2(settings.exposure) * settings.tint[c];
    if (space == ColourSpace::kDisplay) gain[c] = std::pow(gain[c], 1.0 / kPower);
    lift[c] = space == ColourSpace::kDisplay ? kLift * (gain[c] - 1.0) : 0.0;
  }
  ColourGrade grade;
  grade.opacity = settings.opacity;
  const double s = settings.saturation;
  for (size_t row = 0; row < 3; ++row) {
    grade.offset[row] = 0.0;
    for (size_t c = 0; c < 3; ++c) {
      // 1 - s is 0 where the saturation is neutral, so the identity stays exact.
      const double mix = (row == c ? s : 0.0) + (1.0 - s) * kLuma[c];
      grade.matrix[row * 3 + c] = mix * gain[c];
      grade.offset[row] += mix * lift[c];
    }
  }
  return grade;
}

void validate(const ColourGrade& grade, const char* what) {
  for (const double value : grade.matrix) {
    requireRange(value, -kLargestEntry, kLargestEntry, what, "an entry of the colour matrix");
  }
  for (const double value : grade.offset) {
    requireRange(value, -kLargestEntry, kLargestEntry, what, "an entry of the colour offset");
  }
  requireRange(grade.opacity, 0, 1, what, "opacity");
}

void bakeGrade(SplatCloud& cloud, const ColourGrade& grade) {
  validate(grade, "grade");
  if (grade.opacity != 1.0) {
    for (float& value : cloud.opacities) {
      value = static_cast<float>(static_cast<double>(value) * grade.opacity);
    }
  }
  if (!grade.changesColour()) return;
  constexpr double kC0 = 0.28209479177387814;
  // colour = C0 dc + 1/2 + the rest; the map of the constant 1/2 goes into dc.
  double moved[3] = {0.5, 0.5, 0.5};
  applyGrade(grade, moved);
  ColourGrade turning = grade;
  turning.offset = {0, 0, 0};
  const size_t stride = cloud.shStride();
  std::atomic<bool> is_finite{true};
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* sh = &cloud.sh[i * stride];
      for (size_t k = 0; k < stride; k += 3) {
        double colour[3];
        for (size_t c = 0; c < 3; ++c) colour[c] = static_cast<double>(sh[k + c]);
        applyGrade(turning, colour);
        for (size_t c = 0; c < 3; ++c) {
          if (k == 0) colour[c] += (moved[c] - 0.5) / kC0;
          sh[k + c] = static_cast<float>(colour[c]);
          if (!std::isfinite(sh[k + c])) is_finite.store(false, std::memory_order_relaxed);
        }
      }
    }
  });
  if (!is_finite.load()) {
    fail(ErrorCode::kInvalidArgument,
         "the grade makes a colour larger than 3.4e38; a weaker grade is needed");
  }
}

}  // namespace stipple
