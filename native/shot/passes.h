#pragma once

#include <cstdint>

#include "shot/shot_settings.h"

namespace stipple {

/// Where the passes of a picture go, row 0 at the top; null: the pass is not asked for.
struct ShotPasses {
  float* colour = nullptr;         ///< [H,W,4] premultiplied
  float* depth = nullptr;          ///< [H,W]
  float* median_depth = nullptr;   ///< [H,W]
  uint32_t* counts = nullptr;      ///< [H,W]
  float* transmittance = nullptr;  ///< [H,W]
  float* normal = nullptr;         ///< [H,W,3]
  uint32_t* objects = nullptr;     ///< [H,W]
};

/// Asks the renderer for those passes that have a place to go to, and for what finishes them.
void askForPasses(const ShotPasses& passes, ShotSettings& settings);

/// Premultiplied display values become premultiplied scene linear ones, in place. In: [N,4].
void lineariseColour(float* colour, size_t pixel_count);

/// Copies a drawn picture to where its passes go and finishes its colour: over the background's
/// image, converted as the settings say, the splats' times splat_light, then the surface over what
/// they leave. In: is_light, whether
/// colours have been linearised already where that was wanted.
void fillPasses(const RenderResult& picture, const ShotSettings& settings, const ShotPasses& passes,
                bool is_light = false);
void fillPasses(const ReferenceResult& picture, const ShotSettings& settings,
                const ShotPasses& passes);

/// The reference's picture in single precision.
void narrow(const ReferenceResult& from, RenderResult& to);

}  // namespace stipple
