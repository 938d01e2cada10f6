#include "api/accuracy.h"

#include <iterator>
#include <string>

#include "api/guard.h"
#include "base/number_text.h"

using namespace stipple;
using namespace stipple::api;

namespace {

constexpr const char* kLevelNames[] = {"draft", "preview", "final", "reference"};

struct Knob {
  const char* name;
  const char* label;
  bool has_bound;
  const char* bound;
};

constexpr Knob kKnobs[] = {
    {"order", "Order", false,
     "No bound: by their centres, one of two splats that cross is in front as a whole, and changes "
     "at once when the camera turns. By pixel, the order is exact."},
    {"projection", "Projection", false,
     "No bound: affine ellipses are wrong for splats that fill a wide angle, far from the axis or "
     "close to the camera. Along rays the picture of each splat is exact."},
    {"antialiasing", "Anti-aliasing", false,
     "No bound, another filter: as trained, splats smaller than a pixel grow when zoomed out. Mip "
     "keeps their light; samples average a larger picture, at the square of their number in time."},
    {"samples_per_side", "Samples per Side", false,
     "No bound: detail finer than a sample still counts as one; the error falls with the number of "
     "samples, which cost their square in time."},
    {"sh_degree_limit", "Harmonic Degree", false,
     "No bound: view-dependent colour above this degree is left out, splat by splat at most what "
     "its own coefficients there sum up to."},
    {"precision", "Precision", true,
     "Float: within 1e-4 of the largest colour of the same picture in double, where no threshold "
     "falls on the other side. Double: rounding of the result, 6e-8."},
    {"least_alpha", "Contribution Cut-off", true,
     "Each splat below the cut-off x takes at most x of the pixel's colour with it; N of them in a "
     "pixel at most 1 - (1 - x)^N of the largest colour."},
    {"budget_share", "Share of Splats", false,
     "No bound: splats are merged, those first whose merging changes the least. On three scenes "
     "the "
     "error grew by about half each time the share was halved."},
    {"level", "Limits", true,
     "All levels but reference end a pixel at a transmittance of 1e-4 (at most 1e-4 of the largest "
     "colour) and hold alpha to 0.99 (at most 0.01 of the colours behind, for each splat)."},
};

[[noreturn]] void refuse(const std::string& what, const std::string& allowed) {
  fail(ErrorCode::kInvalidArgument, what + "; " + allowed);
}

void requireKnobs(const StippleAccuracy& a, const std::string& name) {
  const auto field = [&](const char* knob) { return name + "->" + knob; };
  enumValue<uint32_t>(a.level, 3, field("level").c_str());
  enumValue<uint32_t>(a.order, 1, field("order").c_str());
  enumValue<uint32_t>(a.projection, 1, field("projection").c_str());
  enumValue<uint32_t>(a.antialiasing, 2, field("antialiasing").c_str());
  enumValue<uint32_t>(a.sh_degree_limit, 4, field("sh_degree_limit").c_str());
  enumValue<uint32_t>(a.precision, 1, field("precision").c_str());
  if (a.samples_per_side < 1 || a.samples_per_side > kMaxSamplesPerSide) {
    refuse(field("samples_per_side") + " is " + std::to_string(a.samples_per_side),
           "1 to 16 is allowed");
  }
  if (!(a.least_alpha > 0 && a.least_alpha < 1)) {
    refuse(field("least_alpha") + " is " + numberText(a.least_alpha),
           "a number above 0 and below 1 is allowed");
  }
  if (!(a.budget_share > 0 && a.budget_share <= 1)) {
    refuse(field("budget_share") + " is " + numberText(a.budget_share),
           "a number above 0 and up to 1 is allowed");
  }
}

void requireAgreement(const StippleAccuracy& a, const std::string& name) {
  const bool samples = a.antialiasing == STIPPLE_SAMPLING_SAMPLES;
  if (a.samples_per_side > 1 && !samples) {
    refuse(name + "->samples_per_side is " + std::to_string(a.samples_per_side) +
               " without antialiasing by samples",
           "it must be 1, or antialiasing STIPPLE_SAMPLING_SAMPLES");
  }
  if (a.level != STIPPLE_ACCURACY_REFERENCE) return;
  if (a.order != STIPPLE_ORDER_PIXEL || a.projection != STIPPLE_PROJECTION_RAY ||
      a.precision != STIPPLE_PRECISION_DOUBLE) {
    refuse(name +
               "->level is reference with a knob below it: order, projection or precision is not "
               "the exact one",
           "order must be pixel, projection ray and precision double, or the level another");
  }
}

StippleAccuracy accuracyOf(uint32_t level) {
  StippleAccuracy a = {};
  a.struct_size = sizeof(a);
  a.level = level;
  a.samples_per_side = 1;
  a.sh_degree_limit = static_cast<uint32_t>(kMaxShDegree);
  a.least_alpha = kMinAlpha;
  a.budget_share = 1;
  switch (level) {
    case STIPPLE_ACCURACY_DRAFT:
      a.budget_share = 0.25;
      a.sh_degree_limit = 1;
      break;
    case STIPPLE_ACCURACY_PREVIEW:
      a.budget_share = 0.5;
      a.sh_degree_limit = 2;
      break;
    case STIPPLE_ACCURACY_REFERENCE:
      a.order = STIPPLE_ORDER_PIXEL;
      a.projection = STIPPLE_PROJECTION_RAY;
      a.precision = STIPPLE_PRECISION_DOUBLE;
      a.least_alpha = rayYardstick().limits.least_alpha;
      break;
    default:
      break;
  }
  return a;
}

}  // namespace

namespace stipple::api {

StippleAccuracy accuracyFrom(const StippleAccuracy* given, const char* name) {
  const uint32_t level = completeUpTo(given, 2 * sizeof(uint32_t), name).level;
  enumValue<uint32_t>(level, 3, (std::string(name) + "->level").c_str());
  const StippleAccuracy a = completed(given, accuracyOf(level), name);
  requireKnobs(a, name);
  requireAgreement(a, name);
  return a;
}

RenderAccuracy renderAccuracy(const StippleAccuracy& a) {
  RenderAccuracy accuracy;
  accuracy.order = a.order == STIPPLE_ORDER_PIXEL ? RayOrder::kResponse : RayOrder::kCentre;
  accuracy.projection =
      a.projection == STIPPLE_PROJECTION_RAY ? RayProjection::kRay : RayProjection::kAffine;
  accuracy.precision =
      a.precision == STIPPLE_PRECISION_DOUBLE ? Precision::kDouble : Precision::kFloat;
  accuracy.samples_per_side = a.samples_per_side;
  if (a.level == STIPPLE_ACCURACY_REFERENCE) accuracy.limits = rayYardstick().limits;
  accuracy.limits.least_alpha = a.least_alpha;
  return accuracy;
}

}  // namespace stipple::api

extern "C" {

StippleStatus stipple_accuracy_init(uint32_t level, StippleAccuracy* accuracy) {
  return guarded([&] {
    enumValue<uint32_t>(level, 3, "level");
    require(accuracy, "accuracy") = accuracyOf(level);
  });
}

StippleStatus stipple_accuracy_check(const StippleAccuracy* accuracy) {
  return guarded([&] { accuracyFrom(accuracy, "accuracy"); });
}

StippleStatus stipple_accuracy_knob_count(uint64_t* count) {
  return guarded([&] { require(count, "count") = std::size(kKnobs); });
}

StippleStatus stipple_accuracy_knob_info(uint64_t index, StippleAccuracyKnobInfo* info) {
  return guarded([&] {
    if (index >= std::size(kKnobs)) {
      refuse("index is " + std::to_string(index),
             "0 to " + std::to_string(std::size(kKnobs) - 1) + " is allowed");
    }
    const Knob& knob = kKnobs[index];
    StippleAccuracyKnobInfo out = {};
    out.has_bound = knob.has_bound ? 1 : 0;
    out.name_utf8 = knob.name;
    out.label_utf8 = knob.label;
    out.bound_utf8 = knob.bound;
    deliver(info, out, "info");
  });
}

const char* stipple_accuracy_level_name(uint32_t level) {
  return level < std::size(kLevelNames) ? kLevelNames[level] : nullptr;
}

const char* stipple_accuracy_verdict(double psnr) {
  if (psnr >= 45) return "looks identical";
  if (psnr >= 38) return "hard to see";
  if (psnr >= 30) return "visible side by side";
  return "obvious";
}

}  // extern "C"
