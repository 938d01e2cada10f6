#include "fit/image_encoders.h"

#include <algorithm>

#include "io/assets/weight_file.h"

namespace stipple {

namespace {

// Channels of the colour encoder's first level, whose maps are the largest that there are.
constexpr uint64_t kFirstColourChannels = 128;
constexpr WeightsRole kPublished[] = {WeightsRole::kStructureEncoder, WeightsRole::kColourEncoder};

WeightTable open(const WeightsFolder& folder, WeightsRole role) {
  return openWeightFile(requireWeights(folder, role).path);
}

}  // namespace

ImageEncoders::ImageEncoders(const WeightsFolder& folder, uint32_t structure_head_width)
    : structure_(std::in_place, open(folder, WeightsRole::kStructureEncoder),
                 DinoOptions{structure_head_width}),
      colour_(std::in_place, open(folder, WeightsRole::kColourEncoder)) {}

size_t ImageEncoders::structureWidth() const {
  return patches_ ? patches_->structureWidth() : structure_->width();
}

size_t ImageEncoders::colourWidth() const {
  return patches_ ? kPatchPlaceWidth : colour_->tokenWidth();
}

uint64_t ImageEncoders::rows(uint32_t size) const {
  return patches_ ? patches_->rows() : structure_->rowsFor(size, size);
}

double ImageEncoders::structureFlops(uint32_t size) const {
  return patches_ ? 0 : structure_->flops(size, size);
}

double ImageEncoders::colourFlops(uint32_t size) const {
  return patches_ ? 0 : colour_->flops(size, size);
}

uint64_t ImageEncoders::noiseCount(uint32_t size) const {
  return patches_ ? 0 : colour_->noiseCount(size, size);
}

uint64_t ImageEncoders::memoryBound(uint32_t size) const {
  if (patches_) return 0;
  const uint64_t side = size, count = rows(size), width = structure_->width();
  constexpr uint64_t kInner = 4;  // how much wider than tokens the MLPs of image encoders are
  const uint64_t structure = count * (2 + 2 * kInner) * width * sizeof(float);
  const uint64_t colour = 2 * side * side * kFirstColourChannels * sizeof(float);
  return std::max(structure, colour);
}

std::span<const WeightsRole> ImageEncoders::roles() const {
  if (patches_) return {};
  return kPublished;
}

ImageFeatures ImageEncoders::features(const NetworkRun& run, const PreparedImage& image,
                                      const ProgressShare& share,
                                      const StageListener& listener) const {
  if (!patches_) return featuresOf(run, *structure_, *colour_, image, share, listener);
  ImageFeatures features;
  features.structure = patchCondition(image, *patches_).structure;
  return features;
}

ImageCondition ImageEncoders::condition(const PreparedImage& image, const ImageFeatures& features,
                                        std::span<const float> noise,
                                        const StageListener& listener) const {
  if (patches_) return patchCondition(image, *patches_);
  return conditionOf(*structure_, *colour_, features, noise, listener);
}

}  // namespace stipple
