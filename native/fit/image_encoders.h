#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "generate/dino_encoder.h"
#include "generate/image_condition.h"
#include "generate/patch_condition.h"
#include "generate/vae_encoder.h"
#include "io/assets/weights_folder.h"

namespace stipple {

/// What tells a flow network of an image: the two published encoders, or for a network that was
/// trained here, patches of the image.
class ImageEncoders {
 public:
  /// Opens the published ones. In: structure_head_width: of DinoEncoder's options. Errors: those of
  /// requireWeights(); kFormat.
  ImageEncoders(const WeightsFolder& folder, uint32_t structure_head_width);
  explicit ImageEncoders(const PatchSizes& patches) : patches_(patches) {}

  size_t structureWidth() const;
  size_t colourWidth() const;
  /// Tokens of an image of a side, and multiplications and additions for it.
  uint64_t rows(uint32_t size) const;
  double flops(uint32_t size) const { return structureFlops(size) + colourFlops(size); }
  double structureFlops(uint32_t size) const;
  double colourFlops(uint32_t size) const;
  uint64_t noiseCount(uint32_t size) const;
  /// Bytes that they take beside their results.
  uint64_t memoryBound(uint32_t size) const;
  /// Files that features depend on; those of the flow are not among them.
  std::span<const WeightsRole> roles() const;

  /// What they say of an image, whatever the noise is. Of patches: the pixels, as structure.
  ImageFeatures features(const NetworkRun& run, const PreparedImage& image,
                         const ProgressShare& share, const StageListener& listener) const;
  ImageCondition condition(const PreparedImage& image, const ImageFeatures& features,
                           std::span<const float> noise, const StageListener& listener) const;

 private:
  std::optional<DinoEncoder> structure_;
  std::optional<VaeEncoder> colour_;
  std::optional<PatchSizes> patches_;
};

}  // namespace stipple
