#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "generate/progress_share.h"
#include "generate/stage_listener.h"
#include "nn/feature_map.h"
#include "nn/network_run.h"

namespace stipple {

class DinoEncoder;
class VaeEncoder;
struct PreparedImage;

/// What a flow network is told of an image: two vectors of features for each token. Row k of one
/// belongs to row k of the other.
struct ImageCondition {
  uint64_t rows = 0;
  uint32_t structure_width = 0;  ///< 1280 of DINOv3 ViT-H/16+
  uint32_t colour_width = 0;     ///< 128 of the FLUX.2 VAE, packed
  std::vector<float> structure;  ///< [rows, structure_width]
  std::vector<float> colour;     ///< [rows, colour_width]
};

/// What both networks say of an image, whatever the noise is: one serves all seeds.
struct ImageFeatures {
  std::vector<float> structure;  ///< [rows, structure_width]
  FeatureMap moments;            ///< VaeEncoder::momentsOf()
};

/// Asks both networks. In: share: of whose progress (Progress::enterPart()); listener: hears of the
/// stages of both, with "structure." and "colour." before their names.
/// Errors: kFormat for networks whose patches differ; those of the encoders.
/// Threads and determinism: as of the encoders. Cost: the sum of both; memory: the larger one's.
ImageFeatures featuresOf(const NetworkRun& run, const DinoEncoder& structure,
                         const VaeEncoder& colour, const PreparedImage& image,
                         const ProgressShare& share = {}, const StageListener& listener = {});
/// In: noise: of VaeEncoder::noiseCount() for the image, normally distributed, or empty: the
/// image's mean latent. Errors: kInvalidArgument for features of other networks.
ImageCondition conditionOf(const DinoEncoder& structure, const VaeEncoder& colour,
                           const ImageFeatures& features, std::span<const float> noise,
                           const StageListener& listener = {});

/// Both of these: encodes an image by both networks. The colours of the tokens that belong to the
/// whole image are zeros. In: noise: of VaeEncoder::noiseCount() for the image, normally
/// distributed, or empty: the image's mean latent (VaeEncoder::encode()); share: of whose progress
/// (Progress::enterPart()); listener: hears of the stages of both, with "structure." and "colour."
/// before their names. Errors: kFormat for networks whose patches differ; those of the encoders.
/// Threads and determinism: as of the encoders. Cost: the sum of both; memory: the larger one's.
ImageCondition encodeImage(const NetworkRun& run, const DinoEncoder& structure,
                           const VaeEncoder& colour, const PreparedImage& image,
                           std::span<const float> noise, const ProgressShare& share = {},
                           const StageListener& listener = {});

}  // namespace stipple
