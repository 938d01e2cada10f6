#include "generate/image_condition.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "generate/dino_encoder.h"
#include "generate/image_preparation.h"
#include "generate/vae_encoder.h"

namespace stipple {

namespace {

StageListener under(const std::string& prefix, const StageListener& listener) {
  if (!listener) return {};
  return [prefix, &listener](const std::string& stage, const StageNumbers& numbers) {
    listener(prefix + stage, numbers);
  };
}

}  // namespace

ImageFeatures featuresOf(const NetworkRun& run, const DinoEncoder& structure,
                         const VaeEncoder& colour, const PreparedImage& image,
                         const ProgressShare& share, const StageListener& listener) {
  if (structure.patchSize() != colour.tokenSize()) {
    fail(ErrorCode::kFormat, "The image encoders do not fit together: one has patches of " +
                                 std::to_string(structure.patchSize()) + " pixels, the other of " +
                                 std::to_string(colour.tokenSize()) + ".");
  }
  std::vector<float> rgb(image.rgb.size());
  for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<float>(image.rgb[i]) / 255.0f;
  const double structure_flops = structure.flops(image.size, image.size);
  const double middle =
      share.at(structure_flops / (structure_flops + colour.flops(image.size, image.size)));
  ImageFeatures features;
  if (run.progress != nullptr) run.progress->enterPart(share.begin, middle);
  features.structure =
      structure.encode(run, rgb, image.size, image.size, under("structure.", listener));
  if (run.progress != nullptr) run.progress->enterPart(middle, share.end);
  features.moments = colour.momentsOf(run, rgb, image.size, image.size, under("colour.", listener));
  if (run.progress != nullptr) run.progress->enterPart(0.0, 1.0);
  return features;
}

ImageCondition conditionOf(const DinoEncoder& structure, const VaeEncoder& colour,
                           const ImageFeatures& features, std::span<const float> noise,
                           const StageListener& listener) {
  const std::vector<float> tokens =
      colour.tokensOf(features.moments, noise, under("colour.", listener));
  ImageCondition condition;
  condition.rows = structure.prefixRows() + tokens.size() / colour.tokenWidth();
  condition.structure_width = static_cast<uint32_t>(structure.width());
  condition.colour_width = static_cast<uint32_t>(colour.tokenWidth());
  if (features.structure.size() != condition.rows * structure.width()) {
    fail(ErrorCode::kInvalidArgument,
         "The structure of an image has " + std::to_string(features.structure.size()) +
             " numbers; its colours need " + std::to_string(condition.rows) + " rows of " +
             std::to_string(structure.width()) + ".");
  }
  condition.structure = features.structure;
  condition.colour.assign(structure.prefixRows() * colour.tokenWidth(), 0.0f);
  condition.colour.insert(condition.colour.end(), tokens.begin(), tokens.end());
  return condition;
}

ImageCondition encodeImage(const NetworkRun& run, const DinoEncoder& structure,
                           const VaeEncoder& colour, const PreparedImage& image,
                           std::span<const float> noise, const ProgressShare& share,
                           const StageListener& listener) {
  const ImageFeatures features = featuresOf(run, structure, colour, image, share, listener);
  return conditionOf(structure, colour, features, noise, listener);
}

}  // namespace stipple
