#include "shot/accuracy_settings.h"

#include <cstdio>
#include <iterator>
#include <string>

#include "base/error.h"

namespace stipple {

namespace {

constexpr const char* kLevelNames[kAccuracyLevelCount] = {"draft", "preview", "final", "reference"};

constexpr AccuracyKnob kKnobs[] = {
    {"order", "Order", false,
     "No bound: by their centres, one of two splats that cross is in front as a whole, and they "
     "swap at once when the camera rotates. By pixel, the order is exact."},
    {"projection", "Projection", false,
     "No bound: affine ellipses are wrong for splats that fill a wide angle, far from the axis or"
     " close to the camera. Along rays the image of each splat is exact."},
    {"antialiasing", "Anti-aliasing", false,
     "No bound, another filter: as trained, splats smaller than a pixel grow when zoomed out. Mip"
     " keeps their light; samples average a larger image, which takes the square of their number "
     "in time."},
    {"samples_per_side", "Samples per Side", false,
     "No bound: detail finer than a sample still counts as one; the error falls with the number of "
     "samples, which cost their square in time."},
    {"sh_degree_limit", "Harmonic Degree", false,
     "No bound: view-dependent colour above this degree is left out, splat by splat at most what "
     "its own coefficients there sum up to."},
    {"precision", "Precision", true,
     "Float: within 1e-4 of the largest colour of the same image in double, where no threshold "
     "falls on the other side. Double: rounding of the result, 6e-8."},
    {"min_alpha", "Contribution Cut-off", true,
     "Each splat below the cut-off x takes at most x of the pixel's colour with it; N of them in a "
     "pixel at most 1 - (1 - x)^N of the largest colour."},
    {"budget_share", "Share of Splats", false,
     "No bound: splats are merged, those first whose merging changes the least. On three scenes "
     "the error grew by about half each time the share was halved."},
    {"level", "Limits", true,
     "All levels but reference end a pixel at a transmittance of 1e-4 (at most 1e-4 of the largest "
     "colour) and hold alpha to 0.99 (at most 0.01 of the colours behind, for each splat)."},
};

[[noreturn]] void refuse(const std::string& what, const std::string& allowed) {
  fail(ErrorCode::kInvalidArgument, what + "; " + allowed);
}

std::string numberText(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

std::string shortNumber(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g", value);
  return text;
}

void requireKnobs(const AccuracySettings& a, const std::string& name) {
  const auto field = [&](const char* knob) { return name + "->" + knob; };
  if (a.samples_per_side < 1 || a.samples_per_side > kMaxSamplesPerSide) {
    refuse(field("samples_per_side") + " is " + std::to_string(a.samples_per_side),
           "1 to 16 is allowed");
  }
  if (!(a.least_alpha > 0 && a.least_alpha < 1)) {
    refuse(field("min_alpha") + " is " + numberText(a.least_alpha),
           "a number above 0 and below 1 is allowed");
  }
  if (!(a.budget_share > 0 && a.budget_share <= 1)) {
    refuse(field("budget_share") + " is " + numberText(a.budget_share),
           "a number above 0 and up to 1 is allowed");
  }
}

void requireAgreement(const AccuracySettings& a, const std::string& name) {
  if (a.samples_per_side > 1 && a.antialiasing != Antialiasing::kSamples) {
    refuse(name + "->samples_per_side is " + std::to_string(a.samples_per_side) +
               " without antialiasing by samples",
           "it must be 1, or antialiasing STIPPLE_SAMPLING_SAMPLES");
  }
  if (a.level != AccuracyLevel::kReference) return;
  if (a.order != RayOrder::kResponse || a.projection != RayProjection::kRay ||
      a.precision != Precision::kDouble) {
    refuse(name +
               "->level is reference with a knob below it: order, projection or precision is not "
               "the exact one",
           "order must be pixel, projection ray and precision double, or the level another");
  }
}

}  // namespace

AccuracySettings accuracyOf(AccuracyLevel level) {
  AccuracySettings a;
  a.level = level;
  switch (level) {
    case AccuracyLevel::kDraft:
      a.budget_share = 0.25;
      a.sh_degree_limit = 1;
      break;
    case AccuracyLevel::kPreview:
      a.budget_share = 0.5;
      a.sh_degree_limit = 2;
      break;
    case AccuracyLevel::kReference:
      a.order = RayOrder::kResponse;
      a.projection = RayProjection::kRay;
      a.precision = Precision::kDouble;
      a.least_alpha = unlimitedRays().limits.least_alpha;
      break;
    case AccuracyLevel::kFinal:
      break;
  }
  return a;
}

void validate(const AccuracySettings& accuracy, const std::string& name) {
  requireKnobs(accuracy, name);
  requireAgreement(accuracy, name);
}

RenderAccuracy renderAccuracy(const AccuracySettings& a) {
  RenderAccuracy accuracy;
  accuracy.order = a.order;
  accuracy.projection = a.projection;
  accuracy.precision = a.precision;
  accuracy.samples_per_side = a.samples_per_side;
  if (a.level == AccuracyLevel::kReference) accuracy.limits = unlimitedRays().limits;
  accuracy.limits.least_alpha = a.least_alpha;
  return accuracy;
}

const char* accuracyLevelName(AccuracyLevel level) {
  return kLevelNames[static_cast<size_t>(level)];
}

std::vector<std::pair<std::string, std::string>> knobValues(const AccuracySettings& a) {
  const char* antialiasing[] = {"as trained", "mip", "samples"};
  return {{"order", a.order == RayOrder::kResponse ? "pixel" : "centre"},
          {"projection", a.projection == RayProjection::kRay ? "ray" : "affine"},
          {"antialiasing", antialiasing[static_cast<size_t>(a.antialiasing)]},
          {"samples", std::to_string(a.samples_per_side)},
          {"degree", std::to_string(a.sh_degree_limit)},
          {"precision", a.precision == Precision::kDouble ? "double" : "float"},
          {"cut-off", shortNumber(a.least_alpha)},
          {"share", shortNumber(a.budget_share)}};
}

std::string accuracyName(const AccuracySettings& accuracy) {
  const auto own = knobValues(accuracy), usual = knobValues(accuracyOf(accuracy.level));
  std::string name = accuracyLevelName(accuracy.level);
  for (size_t i = 0; i < own.size(); ++i) {
    if (own[i].second == usual[i].second) continue;
    if (own[i].first == "antialiasing" && accuracy.antialiasing == Antialiasing::kSamples) {
      continue;  // the number of samples says it
    }
    name += " + " + own[i].first + " " + own[i].second;
  }
  return name;
}

std::span<const AccuracyKnob> accuracyKnobs() {
  return kKnobs;
}

const char* accuracyVerdict(double psnr) {
  if (psnr >= 45) return "looks identical";
  if (psnr >= 38) return "hard to see";
  if (psnr >= 30) return "visible side by side";
  return "obvious";
}

const char* accuracyVerdict(const AccuracySettings& accuracy, double psnr) {
  if (accuracyName(accuracy) == accuracyLevelName(AccuracyLevel::kFinal)) return "as trained";
  if (accuracy.level == AccuracyLevel::kReference) return "the reference itself";
  return accuracyVerdict(psnr);
}

}  // namespace stipple
