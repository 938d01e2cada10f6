#include "shot/shot_settings.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "math/colour.h"
#include "splat/render/surface.h"

namespace stipple {

namespace {

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

std::string methodText(ShotMethod method) {
  return "options->method is " + std::to_string(static_cast<uint32_t>(method));
}

void validateLight(const float* light, const Camera& camera) {
  const size_t pixel_count = static_cast<size_t>(camera.width) * camera.height;
  requireFinite(light, pixel_count * 3, 3, "options->splat_light at pixel");
  for (size_t i = 0; i < pixel_count * 3; ++i) {
    if (light[i] < 0.0f) {
      refuse("options->splat_light at pixel " + std::to_string(i / 3) + " is " +
             std::to_string(light[i]) + "; 0 and more is allowed");
    }
  }
}

}  // namespace

void takeAccuracy(const AccuracySettings& accuracy, ShotSettings& settings) {
  if (settings.method != ShotMethod::kTiled) {
    refuse(methodText(settings.method) +
           " beside options->accuracy, which chooses the method itself; 0 is allowed with it");
  }
  RenderOptions& options = settings.options;
  if (accuracy.antialiasing == Antialiasing::kMip) {
    if (options.low_pass != LowPass::kFromCloud && options.low_pass != LowPass::kMip) {
      refuse("options->low_pass is " + std::to_string(static_cast<uint32_t>(options.low_pass)) +
             ", and options->accuracy asks for mip; 0 or 2 is allowed with that");
    }
    options.low_pass = LowPass::kMip;
  }
  options.sh_degree_limit = std::min(options.sh_degree_limit, accuracy.sh_degree_limit);
  settings.accuracy = renderAccuracy(accuracy);
  settings.budget_share = accuracy.budget_share;
  settings.has_accuracy = true;
}

void takeOutput(OutputColour output, const Instances& instances, ShotSettings& settings) {
  const bool is_display = compositesInDisplaySpace(instances, settings.options.blend_space);
  settings.linearise = output == OutputColour::kSceneLinear && is_display;
  settings.averages_light =
      output == OutputColour::kComposited && isSampled(settings.sampling) && is_display;
  if (!settings.linearise) return;
  for (double& value : settings.options.background) value = linearToSrgb(value);
}

bool followsRays(ShotMethod method) {
  return method == ShotMethod::kRays || method == ShotMethod::kRaysUnlimited;
}

void validate(const ShotSettings& settings, const Camera& camera) {
  const bool is_exact =
      settings.method == ShotMethod::kTiled && settings.accuracy.projection == RayProjection::kRay;
  if (!followsRays(settings.method) && !is_exact) {
    requireImagePlane(camera, "the affine projection of splats");
  }
  validateSurface(settings.options.surface, camera);
  if (settings.splat_light) validateLight(settings.splat_light, camera);
  if (settings.background_image && settings.options.with_background) {
    refuse(
        "options->with_background is 1 beside options->background_image, which stands in its "
        "place; 0 is allowed with it");
  }
  validate(settings.surroundings);
  if (settings.surroundings.pixels &&
      (settings.background_image || settings.options.with_background)) {
    refuse(
        "options->surroundings stands beside a background, in whose place it is; with_background "
        "0 and background_image NULL are allowed with it");
  }
}

void requireDerivative(const ShotSettings& settings, const Instances& instances) {
  if (settings.options.object_order != ObjectOrder::kTogether) {
    fail(ErrorCode::kUnsupported,
         "options->object_order is 1, which a backward pass does not follow; 0 is allowed");
  }
  if (settings.has_accuracy) {
    refuse("options->accuracy is set, which a backward pass does not follow; it must be NULL");
  }
  if (settings.method != ShotMethod::kTiled) {
    refuse(methodText(settings.method) + "; derivatives have 0 (tiled) only");
  }
  if (isSampled(settings.sampling)) {
    refuse(
        "options has an aperture, a shutter or samples; derivatives are those of one sharp "
        "image");
  }
  if (settings.options.surface.depth || settings.splat_light) {
    refuse("options has a surface or a splat_light; derivatives are those of splats alone");
  }
  for (size_t i = 0; i < instances.list.size(); ++i) {
    if (!instances.list[i].holdout) continue;
    refuse("instances[" + std::to_string(i) + "].holdout is 1; instances with derivatives have 0");
  }
  if (settings.background_image || settings.surroundings.pixels || settings.solid_depth) {
    refuse(
        "options has a background_image, surroundings or solid_depth; derivatives are those of "
        "splats alone and of all that shows");
  }
  if (settings.linearise) {
    refuse(
        "options->output_colour is 0 (scene linear), which converts the composited image; "
        "derivatives are those of 1 (composited)");
  }
}

void requireMeasurable(const ShotSettings& settings) {
  if (settings.has_accuracy) {
    refuse("render->accuracy is set, which measuring chooses itself; it must be NULL");
  }
  if (isSampled(settings.sampling)) {
    refuse("render has an aperture, a shutter or samples; what is measured is one sharp image");
  }
  if (settings.method != ShotMethod::kTiled) {
    refuse("render->method is " + std::to_string(static_cast<uint32_t>(settings.method)) +
           ", which measuring chooses itself; 0 is allowed");
  }
  if (settings.splat_light || settings.options.surface.depth || settings.background_image ||
      settings.surroundings.pixels) {
    refuse(
        "render has a surface, light, background_image or surroundings, which measuring does not "
        "draw; they must be NULL");
  }
}

}  // namespace stipple
