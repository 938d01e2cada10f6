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

ImageCondition encodeImage(const NetworkRun& run, const DinoEncoder& structure,
                           const VaeEncoder& colour, const PreparedImage& image,
                           std::span<const float> noise, const ProgressShare& share,
                           const StageListener& listener) {
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
  ImageCondition condition;
  condition.rows = structure.rowsFor(image.size, image.size);
  condition.structure_width = static_cast<uint32_t>(structure.width());
  condition.colour_width = static_cast<uint32_t>(colour.tokenWidth());
  if (run.progress != nullptr) run.progress->enterPart(share.begin, middle);
  condition.structure =
      structure.encode(run, rgb, image.size, image.size, under("structure.", listener));
  if (run.progress != nullptr) run.progress->enterPart(middle, share.end);
  const std::vector<float> tokens =
      colour.encode(run, rgb, image.size, image.size, noise, under("colour.", listener));
  if (run.progress != nullptr) run.progress->enterPart(0.0, 1.0);
  condition.colour.assign(structure.prefixRows() * colour.tokenWidth(), 0.0f);
  condition.colour.insert(condition.colour.end(), tokens.begin(), tokens.end());
  return condition;
}

}  // namespace stipple
