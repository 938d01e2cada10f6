#include "api/render_settings.h"

#include <algorithm>

#include "api/accuracy.h"
#include "api/guard.h"
#include "math/colour.h"
#include "splat/render/surface.h"

namespace stipple::api {

namespace {

void takeAccuracy(const StippleAccuracy& given, RenderSettings& settings) {
  const StippleAccuracy accuracy = accuracyFrom(&given, "options->accuracy");
  if (settings.method != STIPPLE_RENDER_TILED) {
    fail(ErrorCode::kInvalidArgument,
         "options->method is " + std::to_string(settings.method) +
             " beside options->accuracy, which chooses the method itself; 0 is allowed with it");
  }
  RenderOptions& options = settings.options;
  if (accuracy.antialiasing == STIPPLE_SAMPLING_MIP) {
    if (options.low_pass != LowPass::kFromCloud && options.low_pass != LowPass::kMip) {
      fail(ErrorCode::kInvalidArgument,
           "options->low_pass is " + std::to_string(static_cast<uint32_t>(options.low_pass)) +
               ", and options->accuracy asks for mip; 0 or 2 is allowed with that");
    }
    options.low_pass = LowPass::kMip;
  }
  options.sh_degree_limit =
      std::min(options.sh_degree_limit, static_cast<int>(accuracy.sh_degree_limit));
  settings.accuracy = renderAccuracy(accuracy);
  settings.budget_share = accuracy.budget_share;
  settings.has_accuracy = true;
}

Sampling samplingFrom(const StippleRenderOptions& given, const Instances& instances) {
  Sampling sampling;
  sampling.samples = given.samples;
  if (given.lens) {
    const StippleLens lens = complete(given.lens, "options->lens");
    sampling.aperture = {lens.aperture_radius, lens.focus_distance, lens.blades, lens.rotation,
                         lens.ratio == 0 ? 1.0 : lens.ratio};
  }
  if (given.shutter) {
    const StippleShutter shutter = complete(given.shutter, "options->shutter");
    Shutter& made = sampling.shutter;
    made.step_count = shutter.step_count;
    if (made.step_count < 2 || made.step_count > kMaxShutterSteps) {
      fail(ErrorCode::kInvalidArgument, "options->shutter->step_count is " +
                                            std::to_string(made.step_count) +
                                            "; 2 to 1025 is allowed");
    }
    const auto take = [](const double* matrices, size_t count, std::vector<Mat4d>& out) {
      if (!matrices) return;
      for (size_t i = 0; i < count; ++i) {
        out.push_back(Eigen::Map<const Mat4d>(matrices + i * 16));
      }
    };
    take(shutter.cameras, made.step_count, made.camera);
    take(shutter.instances, made.step_count * instances.list.size(), made.instances);
    if (shutter.curve) made.curve.assign(shutter.curve, shutter.curve + shutter.curve_count);
  }
  validate(sampling, instances.list.size());
  return sampling;
}

}  // namespace

bool compositesInDisplaySpace(const Instances& instances, BlendSpace blend_space) {
  return blend_space == BlendSpace::kAsTrained &&
         (instances.list.empty() ||
          instances.list.front().cloud->colour_space == ColourSpace::kDisplay);
}

RenderSettings renderSettings(const StippleRenderOptions* options, const Instances& instances) {
  StippleRenderOptions defaults;
  stipple_render_options_init(&defaults);
  const StippleRenderOptions given = completed(options, defaults, "options");
  RenderSettings settings;
  settings.method = enumValue<StippleRenderMethod>(given.method, 3, "options->method");
  settings.options.low_pass = enumValue<LowPass>(given.low_pass, 3, "options->low_pass");
  settings.options.blend_space =
      enumValue<BlendSpace>(given.blend_space, 1, "options->blend_space");
  settings.options.object_order =
      enumValue<ObjectOrder>(given.object_order, 1, "options->object_order");
  const auto output =
      enumValue<StippleOutputColour>(given.output_colour, 1, "options->output_colour");
  settings.options.sh_degree_limit =
      enumValue<int>(given.sh_degree_limit, 4, "options->sh_degree_limit");
  settings.options.with_background =
      enumValue<uint32_t>(given.with_background, 1, "options->with_background") == 1;
  settings.linearise = output == STIPPLE_OUTPUT_SCENE_LINEAR &&
                       compositesInDisplaySpace(instances, settings.options.blend_space);
  for (int c = 0; c < 3; ++c) {
    requireFinite(given.background[c], "options->background");
    settings.options.background[c] =
        settings.linearise ? linearToSrgb(given.background[c]) : given.background[c];
  }
  settings.options.surface = {given.surface_width, given.surface_height, given.surface_depth,
                              given.surface_colour, given.matte_opacity};
  settings.options.splats_apart = given.surface_colour != nullptr;
  settings.splat_light = given.splat_light;
  if (given.accuracy) takeAccuracy(*given.accuracy, settings);
  settings.sampling = samplingFrom(given, instances);
  settings.averages_light = output == STIPPLE_OUTPUT_COMPOSITED && isSampled(settings.sampling) &&
                            compositesInDisplaySpace(instances, settings.options.blend_space);
  return settings;
}

void validateLayers(const RenderSettings& settings, const Camera& camera) {
  validateSurface(settings.options.surface, camera);
  if (!settings.splat_light) return;
  const size_t pixel_count = static_cast<size_t>(camera.width) * camera.height;
  requireFinite(settings.splat_light, pixel_count * 3, 3, "options->splat_light at pixel");
  for (size_t i = 0; i < pixel_count * 3; ++i) {
    if (settings.splat_light[i] < 0.0f) {
      fail(ErrorCode::kInvalidArgument, "options->splat_light at pixel " + std::to_string(i / 3) +
                                            " is " + std::to_string(settings.splat_light[i]) +
                                            "; 0 and more is allowed");
    }
  }
}

}  // namespace stipple::api
