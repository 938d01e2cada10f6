#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "generate/image_preparation.h"
#include "generate/seeded_noise.h"

namespace stipple {

/// How an image becomes a latent of splats.
struct GenerateOptions {
  /// Where the four files of weights are (io/assets/weights_folder.h).
  std::string weights_folder;
  /// From noise to the object, 1 to 1000; 10 to 20 are usual. Time grows with them.
  uint32_t steps = 20;
  /// How much more than plainly the image is followed, 0 to 100; up to 1 takes half the time.
  double guidance = 3.0;
  /// 0.01 to 100. Above 1 more of the steps are taken where there is much noise.
  double shift = 3.0;
  /// Tokens of the latent, 1 to kMostFlowTokens. Published networks were trained with 1,024 to
  /// 8,192; time grows with them, and their square.
  uint64_t token_count = 8192;
  PreparationOptions preparation;
  NoiseSeed noise;
  /// The mean of what the colour encoder says instead of a sample.
  bool uses_mean_colour = false;
  /// The result's colours are led closer to the image (image_matching.h), which networks that were
  /// trained here can do.
  bool matches_colours = false;
  /// Notes what passes by in every layer of the encoders too, for comparing with somebody else's
  /// run.
  bool watches_layers = false;
  /// Metres: the largest side of the object, which stands on the origin with the middle of its
  /// base; 0: as the networks have it, in a cube of side 1 around the origin.
  double size = 1.0;
  /// A preview is decoded after every so many steps; 0: never.
  uint32_t preview_steps = 0;
  /// Anchors of a preview, and of the splats that tell how large the object is; at least 1.
  uint64_t preview_anchors = 256;
  /// A file that keeps the state after every step, and that an equal generation goes on from;
  /// empty: none.
  std::string checkpoint_path;
  /// Of the structure encoder's attention heads, which its file does not tell.
  size_t structure_head_width = 64;
};

}  // namespace stipple
