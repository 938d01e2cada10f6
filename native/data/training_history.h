#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stipple {

/// What one step of a training of networks was like, means over its examples.
struct TrainingRecord {
  uint32_t part = 0;
  bool is_skipped = false;  ///< its derivatives were not finite, and nothing was learned
  float loss = 0;
  float structure = 0;   ///< nats per level over the least that it can be
  float divergence = 0;  ///< of latents from the normal distribution
  float l1 = 0;          ///< of images; 0 where none were drawn
  float ssim = 1;
  float learning_rate = 0;
  float gradient_norm = 0;
  float seconds = 0;
};

/// What some objects were like as the networks make them of their latents.
struct TrainingMeasure {
  uint64_t step = 0;
  uint64_t anchors = 0;  ///< of detail: splats
  uint64_t objects = 0;
  double psnr = 0;  ///< dB, mean over views, then over objects, over black, display values
  double ssim = 0;
  /// The same psnr of a few objects that are learned from, by which the best state is chosen.
  double training_psnr = 0;
  /// Of detail, dB: the coarse splats that finer ones were made of, and a cut of the fitted object
  /// to as many splats as these are; 0: nothing was compared.
  double coarse_psnr = 0, cut_psnr = 0;
  uint64_t coarse_splats = 0;
};

/// The story of a training.
struct TrainingHistory {
  std::vector<TrainingRecord> records;     ///< by step
  std::vector<TrainingMeasure> measures;   ///< while it ran, of held-out objects
  std::vector<TrainingMeasure> by_budget;  ///< of the result
  uint64_t best_step = 0;                  ///< of the result
  bool measured_on_held_out = true;        ///< false: no object is held out
  std::vector<std::string> part_names;     ///< "structure", ...
};

}  // namespace stipple
