#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "splat/render/accurate_render.h"

namespace stipple {

enum class AccuracyLevel : uint32_t { kDraft = 0, kPreview = 1, kFinal = 2, kReference = 3 };

enum class Antialiasing : uint32_t {
  kAsTrained = 0,  ///< the low-pass of the render options
  kMip = 1,        ///< 0.1 px^2 with compensation
  kSamples = 2,    ///< a larger picture, averaged
};

/// Every knob that trades the exactness of a picture for time: a level, and what differs from it.
struct AccuracySettings {
  AccuracyLevel level = AccuracyLevel::kFinal;
  RayOrder order = RayOrder::kCentre;
  RayProjection projection = RayProjection::kAffine;
  Antialiasing antialiasing = Antialiasing::kAsTrained;
  uint32_t samples_per_side = 1;  ///< 1..kMaxSamplesPerSide; above 1 with kSamples alone
  int sh_degree_limit = kMaxShDegree;
  Precision precision = Precision::kFloat;
  double least_alpha = kMinAlpha;  ///< above 0, below 1
  double budget_share = 1;         ///< of the splats of each cloud; above 0, up to 1
};

/// The knobs of a level. All but kReference draw as splats are trained, with fewer of them or less
/// of their colour below kFinal.
AccuracySettings accuracyOf(AccuracyLevel level);

/// Refuses knobs outside their range, samples without antialiasing by samples, and the reference
/// with a knob that is not the exact one. In: name, of the argument. Errors: kInvalidArgument.
void validate(const AccuracySettings& accuracy, const std::string& name);

/// What the renderer makes of it; budget, harmonics and low-pass are the shot's business.
RenderAccuracy renderAccuracy(const AccuracySettings& accuracy);

/// "draft", "preview", "final", "reference".
const char* accuracyLevelName(AccuracyLevel level);
constexpr size_t kAccuracyLevelCount = 4;

/// Names of the knobs with their values as text, in the order in which they are shown.
std::vector<std::pair<std::string, std::string>> knobValues(const AccuracySettings& accuracy);

/// "preview", or the level with the knobs that differ from it: "final + projection ray".
std::string accuracyName(const AccuracySettings& accuracy);

/// What is known of a knob's error.
struct AccuracyKnob {
  const char* name;   ///< of the field
  const char* label;  ///< for users
  bool has_bound;
  const char* bound;  ///< in words: the bound, or why there is none
};
std::span<const AccuracyKnob> accuracyKnobs();

/// A PSNR in dB as an artist would say it: "looks identical" to "obvious".
const char* accuracyVerdict(double psnr);
/// The same of an image at a setting, against the reference. Splats look as they were trained at the
/// level final, whose difference from the reference is that of the order and the projection that
/// training had: it is no fault that one sees, so the level is not judged by it.
const char* accuracyVerdict(const AccuracySettings& accuracy, double psnr);

}  // namespace stipple
