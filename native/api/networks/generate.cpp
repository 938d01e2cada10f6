#include <memory>
#include <optional>
#include <utility>

#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "api/networks/weights_folder_of.h"
#include "base/parallel.h"
#include "data/images/byte_image.h"
#include "fit/generate_session.h"

using namespace stipple;
using namespace stipple::api;

namespace {

GenerateSession& sessionOf(const StippleJob* job) {
  return keptSession(job, &StippleJob::generation, "makes no splats of an image");
}

StippleGenerateOptions completedOptions(const StippleGenerateOptions* given) {
  StippleGenerateOptions defaults;
  stipple_generate_options_init(&defaults);
  return completed(given, defaults, "options");
}

GenerateOptions generateOptionsFrom(const StippleContext& context,
                                    const StippleGenerateOptions* given) {
  const StippleGenerateOptions from = completedOptions(given);
  GenerateOptions options;
  options.weights_folder =
      weightsFolderOf(context, from.weights_folder_utf8, "options->weights_folder_utf8");
  if (from.checkpoint_path_utf8) options.checkpoint_path = from.checkpoint_path_utf8;
  options.steps = from.steps;
  options.guidance = from.guidance;
  options.shift = from.shift;
  options.size = from.size;
  options.token_count = from.token_count;
  options.preparation.canvas_size = from.canvas_size;
  options.preparation.erode_radius = from.erode_radius;
  options.noise = {enumValue<NoiseSource>(from.noise_source, 1, "options->noise_source"),
                   from.seed};
  options.uses_mean_colour =
      enumValue<uint32_t>(from.uses_mean_colour, 1, "options->uses_mean_colour") == 1;
  options.matches_colours =
      enumValue<uint32_t>(from.matches_colours, 1, "options->matches_colours") == 1;
  options.preview_steps = from.preview_steps;
  options.preview_anchors = from.preview_anchors;
  options.watches_layers =
      enumValue<uint32_t>(from.watches_layers, 1, "options->watches_layers") == 1;
  return options;
}

StippleGenerateEstimate estimateTo(const GenerateEstimate& estimate) {
  StippleGenerateEstimate out = {};
  out.bytes = estimate.bytes;
  out.weight_bytes = estimate.weight_bytes;
  out.seconds = estimate.seconds;
  out.operations = estimate.operations;
  out.image_seconds = estimate.image_seconds;
  return out;
}

}  // namespace

extern "C" {

void stipple_generate_options_init(StippleGenerateOptions* options) {
  if (!options) return;
  const GenerateOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleGenerateOptions);
  options->steps = defaults.steps;
  options->token_count = static_cast<uint32_t>(defaults.token_count);
  options->canvas_size = defaults.preparation.canvas_size;
  options->erode_radius = defaults.preparation.erode_radius;
  options->noise_source = static_cast<uint32_t>(defaults.noise.source);
  options->preview_anchors = defaults.preview_anchors;
  options->seed = defaults.noise.seed;
  options->guidance = defaults.guidance;
  options->shift = defaults.shift;
  options->size = defaults.size;
}

StippleStatus stipple_generate_start(StippleContext* context, const StippleImage* image,
                                     const StippleImage* mask,
                                     const StippleGenerateOptions* options, StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(job, "job");
    std::optional<ByteImage> seen, shown;
    if (image) seen = toByteImage(*image->image);
    if (mask) shown = toMask(toByteImage(*mask->image));
    const GenerateOptions settings = generateOptionsFrom(*context, options);
    const StippleGenerateOptions asked = completedOptions(options);
    const bool looks =
        settings.matches_colours ||
        enumValue<uint32_t>(asked.measures_likeness, 1, "options->measures_likeness") == 1;
    auto session = std::make_shared<GenerateSession>(std::move(seen), std::move(shown), settings,
                                                     looks ? context->state->backends : nullptr);
    if (asked.encoded_by) session->takeFeatures(sessionOf(asked.encoded_by));
    context->state->requireMemory(session->memoryBound(), "this generation");
    *job = startJob(
        context->state,
        [session](Progress& progress) -> JobResult {
          session->run(progress);
          return session->model();
        },
        nullptr, session);
  });
}

StippleStatus stipple_generate_estimate(StippleContext* context,
                                        const StippleGenerateOptions* options,
                                        StippleGenerateEstimate* estimate) {
  return guarded([&] {
    require(context, "context");
    const GenerateOptions settings = generateOptionsFrom(*context, options);
    GenerateEstimate found;
    withThreads(context->state->thread_count, [&] { found = GenerateSession::estimate(settings); });
    deliver(estimate, estimateTo(found), "estimate");
  });
}

StippleStatus stipple_generate_figures(const StippleJob* job, StippleGenerateFigures* figures) {
  return guarded([&] {
    const GenerateStatus status = sessionOf(job).status();
    StippleGenerateFigures out = {};
    out.step = status.step;
    out.steps = status.steps;
    out.resumed_step = status.resumed_step;
    out.preview_step = status.preview_step;
    out.stage_count = static_cast<uint32_t>(status.stage_count);
    out.seconds = status.seconds;
    out.seconds_left = status.seconds_left;
    out.likeness = status.likeness;
    deliver(figures, out, "figures");
  });
}

StippleStatus stipple_generate_stage(const StippleJob* job, uint32_t index,
                                     StippleGenerateStage* stage) {
  return guarded([&] {
    const StageValues& seen = sessionOf(job).stageAt(index);
    StippleGenerateStage out = {};
    out.count = seen.count;
    out.minimum = seen.minimum;
    out.maximum = seen.maximum;
    out.mean = seen.mean;
    out.deviation = seen.deviation;
    out.seconds = seen.seconds;
    out.name_utf8 = seen.name.c_str();
    out.operations = seen.operations;
    deliver(stage, out, "stage");
  });
}

StippleStatus stipple_generate_preview(StippleJob* job, StippleCloud** cloud) {
  return guarded([&] {
    require(cloud, "cloud");
    std::shared_ptr<const SplatCloud> newest = sessionOf(job).takePreview();
    *cloud = newest ? new StippleCloud{job->context, std::move(newest)} : nullptr;
  });
}

}  // extern "C"
