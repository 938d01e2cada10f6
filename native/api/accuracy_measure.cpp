#include <cstddef>
#include <utility>

#include "api/camera.h"
#include "api/conversions.h"
#include "api/job.h"
#include "measure/picture_accuracy.h"
#include "measure/volume_accuracy.h"

using namespace stipple;
using namespace stipple::api;

namespace {

PictureAccuracyOptions pictureOptionsFrom(const StippleAccuracyMeasureOptions* options,
                                          const Camera& camera) {
  StippleAccuracyMeasureOptions defaults;
  stipple_accuracy_measure_options_init(&defaults);
  const StippleAccuracyMeasureOptions given = completed(options, defaults, "options");
  PictureAccuracyOptions made;
  made.timing = {given.repetitions, given.max_seconds};
  made.reference_pixels = given.reference_pixels;
  if (given.setting_count == 0) made.accuracies = usualAccuracies(camera);
  const StructArray<StippleAccuracy> settings(given.settings, given.setting_count,
                                              "options->settings");
  for (uint64_t i = 0; i < given.setting_count; ++i) {
    made.accuracies.push_back(accuracyFrom(settings.at(i), settings.nameOf(i).c_str()));
  }
  return made;
}

VolumeAccuracyOptions volumeOptionsFrom(const StippleVoxelizeOptions* finest,
                                        const StippleVolumeAccuracyOptions* options) {
  StippleVolumeAccuracyOptions defaults;
  stipple_volume_accuracy_options_init(&defaults);
  const StippleVolumeAccuracyOptions given = completed(options, defaults, "options");
  return {voxelizeOptionsFrom(finest), {given.repetitions, given.max_seconds}};
}

}  // namespace

extern "C" {

void stipple_accuracy_measure_options_init(StippleAccuracyMeasureOptions* options) {
  if (!options) return;
  const PictureAccuracyOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleAccuracyMeasureOptions);
  options->repetitions = defaults.timing.repetitions;
  options->reference_pixels = defaults.reference_pixels;
  options->max_seconds = defaults.timing.most_seconds;
}

StippleStatus stipple_accuracy_measure_start(StippleContext* context,
                                             const StippleInstance* instances, uint64_t count,
                                             const StippleCamera* camera,
                                             const StippleRenderOptions* render,
                                             const StippleAccuracyMeasureOptions* options,
                                             StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(job, "job");
    Instances placed = instancesFrom(instances, count);
    const ShotSettings shot = shotFrom(render, placed);
    requireMeasurable(shot);
    const Camera view = cameraFrom(camera);
    validate(view);
    const PictureAccuracyOptions measured = pictureOptionsFrom(options, view);
    validate(measured, placed, view);
    const RenderMemory memory = measurePictureMemory(placed, view, shot, measured);
    context->state->requirePictureMemory(memory.sum(), "measuring an image of " + sizeText(view),
                                         memory.pair_bytes);
    *job = startJob(
        context->state,
        [placed = std::move(placed), shot, measured, view](Progress& progress) -> JobResult {
          return std::make_shared<const MeasuredAccuracy>(
              measurePicture(placed, view, shot, measured, progress));
        });
  });
}

void stipple_volume_accuracy_options_init(StippleVolumeAccuracyOptions* options) {
  if (!options) return;
  const VolumeAccuracyOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleVolumeAccuracyOptions);
  options->repetitions = defaults.timing.repetitions;
  options->max_seconds = defaults.timing.most_seconds;
}

StippleStatus stipple_volume_accuracy_start(StippleContext* context,
                                            const StippleInstance* instances, uint64_t count,
                                            const StippleVoxelizeOptions* finest,
                                            const StippleVolumeAccuracyOptions* options,
                                            StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(job, "job");
    Instances placed = instancesFrom(instances, count);
    const VolumeAccuracyOptions measured = volumeOptionsFrom(finest, options);
    validate(measured, placed);
    const uint64_t limit = context->state->memory_limit_bytes;
    *job = startJob(context->state,
                    [placed = std::move(placed), measured, limit](Progress& progress) -> JobResult {
                      return std::make_shared<const MeasuredAccuracy>(
                          MeasuredAccuracy{measureVolume(placed, measured, limit, progress), {}});
                    });
  });
}

}  // extern "C"
