#pragma once

#include <cstdint>
#include <vector>

#include "base/progress.h"
#include "data/accuracy_report.h"
#include "measure/timing.h"
#include "shot/shot_settings.h"
#include "splat/render/image_renderer.h"

namespace stipple {

/// What is measured, and how often.
struct PictureAccuracyOptions {
  std::vector<AccuracySettings> accuracies;
  Timing timing;                             ///< of each picture that is not too slow
  uint64_t reference_pixels = 16 * 64 * 64;  ///< compared, in blocks of 64 x 64; 0: all
};

/// A report, and the settings that its rows have.
struct MeasuredAccuracy {
  AccuracyReport report;
  std::vector<AccuracySettings>
      accuracies;  ///< one for each row; empty where it is not of pictures
};

/// Levels, and final with each of its knobs moved alone. All along rays where the camera has
/// nothing else; colours by harmonics only where there are some.
std::vector<AccuracySettings> usualAccuracies(const Instances& instances, const Camera& camera);

/// Refuses options outside their range, a camera that cannot be drawn so, and instances without
/// splats. Errors: kInvalidArgument.
void validate(const PictureAccuracyOptions& options, const Instances& instances,
              const Camera& camera);

/// Bytes that measurePicture allocates at most.
RenderMemory measurePictureMemory(const ImageRendererFactory& images, const Instances& instances,
                                  const Camera& camera, const ShotSettings& shot,
                                  const PictureAccuracyOptions& options);

/// Draws the view at every accuracy and against the reference, and times it. In: shot, which
/// requireMeasurable() accepts; options, which validate() accepts, with accuracies.
MeasuredAccuracy measurePicture(const ImageRendererFactory& images, const Instances& instances,
                                const Camera& camera, const ShotSettings& shot,
                                const PictureAccuracyOptions& options, Progress& progress);

}  // namespace stipple
