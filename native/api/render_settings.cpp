#include "api/render_settings.h"

#include "api/guard.h"
#include "math/colour.h"

namespace stipple::api {

namespace {

/// True when the composited values are display values.
bool compositesInDisplaySpace(const Instances& instances, BlendSpace blend_space) {
  return blend_space == BlendSpace::kAsTrained &&
         (instances.list.empty() ||
          instances.list.front().cloud->colour_space == ColourSpace::kDisplay);
}

}  // namespace

RenderSettings renderSettings(const StippleRenderOptions* options, const Instances& instances) {
  StippleRenderOptions defaults;
  stipple_render_options_init(&defaults);
  const StippleRenderOptions given = completed(options, defaults, "options");
  RenderSettings settings;
  settings.method = enumValue<StippleRenderMethod>(given.method, 1, "options->method");
  settings.options.low_pass = enumValue<LowPass>(given.low_pass, 3, "options->low_pass");
  settings.options.blend_space =
      enumValue<BlendSpace>(given.blend_space, 1, "options->blend_space");
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
  return settings;
}

}  // namespace stipple::api
