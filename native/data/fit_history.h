#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace stipple {

/// What a fit was like on views that it did not learn from.
struct FitMeasure {
  uint64_t iteration = 0;
  uint64_t budget = 0;       ///< that was asked for; 0: all splats
  uint64_t splat_count = 0;  ///< that were drawn
  double psnr = 0;  ///< dB, mean over views, display values; over black where views have alpha
  double foreground_psnr = 0;  ///< the same where alpha is above 0; psnr where no view has alpha
  double ssim = 0;             ///< mean over views
  double density_entropy = 0;  ///< nats; NaN of models without a density
  /// dB, the same as psnr over a few of the views that are learned from, by which the best state is
  /// chosen; NaN: not known, of a checkpoint whose best was chosen otherwise.
  double training_psnr = std::numeric_limits<double>::quiet_NaN();
  /// dB, the same as psnr of the pixels in which something moves (data/views/moving_pixels.h), mean
  /// over the views that have any; NaN where none has, as where no camera stands still.
  double moving_psnr = std::numeric_limits<double>::quiet_NaN();
};

/// What one iteration was like.
struct FitRecord {
  float loss = 0;
  float l1 = 0;
  float ssim = 1;
  uint32_t splat_count = 0;
  float render_seconds = 0;
  float backward_seconds = 0;  ///< with the loss
  float field_seconds = 0;
  float optimiser_seconds = 0;
  float edit_seconds = 0;
  float other_seconds = 0;  ///< pictures, and what the trainer itself does
};

/// The story of a fit, for its report.
struct FitHistory {
  std::vector<FitRecord> records;     ///< by iteration, from the first
  std::vector<FitMeasure> measures;   ///< while it ran, ascending iterations
  std::vector<FitMeasure> by_budget;  ///< of the result, ascending budgets
  uint64_t best_iteration = 0;        ///< of the result: the highest training_psnr
  bool measured_on_held_out = true;   ///< false: too few views, measured on those of training
  uint64_t training_view_count = 0;
  uint64_t measured_view_count = 0;
};

}  // namespace stipple
