#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/training_history.h"
#include "fit/training/collection.h"
#include "train/loop/held_out.h"

namespace stipple {

/// Sizes at which objects are measured.
struct MeasuredAt {
  size_t tokens = 128;
  uint64_t anchors = 1024;
  uint64_t seed = 0;  ///< of the draw of anchors
};

/// Encodes objects, decodes their latents, and compares drawings with all their views.
class AutoencoderMeasure {
 public:
  /// In: both must outlive this.
  AutoencoderMeasure(const BackendFactory& backends, const Collection& collection)
      : collection_(collection), views_(backends) {}

  /// In: values: the weights; objects: numbers in the collection, at least one. Out: anchors,
  /// objects, psnr, ssim; the rest is left alone. Errors: those of reading images; kCancelled.
  TrainingMeasure measure(const DensityAutoencoder& networks, std::span<const float> values,
                          const std::vector<size_t>& objects, const MeasuredAt& at,
                          Progress* progress = nullptr);

 private:
  const Collection& collection_;
  ViewMeasure views_;
};

}  // namespace stipple
