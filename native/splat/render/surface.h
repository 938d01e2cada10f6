#pragma once

#include <cstddef>
#include <vector>

#include "math/camera.h"
#include "splat/render/blend.h"
#include "splat/render/render.h"

namespace stipple {

/// Refuses a layer of another size than the camera's picture, NaN and minus infinity among its
/// depths, colours that are not finite, opacities outside 0..1 or below the colour's alpha. Errors:
/// kInvalidArgument.
void validateSurface(const SurfaceLayer& surface, const Camera& camera);

inline bool hasSurface(const RenderOptions& options) {
  return options.surface.depth != nullptr;
}

/// The layer at pixel `index`.
template <typename T>
SurfaceAtPixel<T> surfaceAt(const SurfaceLayer& layer, size_t index) {
  const float depth = layer.depth[index];
  const bool is_there = depth < kEmptyDepth;
  SurfaceAtPixel<T> surface;
  surface.depth = is_there ? depth : kNoSurface;
  surface.shows = layer.colour != nullptr;
  if (surface.shows) {
    surface.opacity = T(layer.colour[index * 4 + 3]);
  } else if (is_there) {
    surface.opacity = layer.matte_opacity ? T(layer.matte_opacity[index]) : T(1);
  }
  const bool hides_more = surface.shows && layer.matte_opacity;
  surface.transmittance = T(1) - (hides_more ? T(layer.matte_opacity[index]) : surface.opacity);
  return surface;
}

/// Alpha of what is not the surface, which the colour goes with until addSurface: of the splats,
/// and of the background behind them.
template <typename T>
T alphaApart(const SurfaceAtPixel<T>& surface, T surface_weight, T splat_coverage,
             bool with_background) {
  return with_background ? T(1) - surface_weight * (T(1) - surface.transmittance) : splat_coverage;
}

/// Adds the surface to pixels that were drawn without it. In and out: colour [count,4]; in: weight
/// [count], the layer's colour [count,4].
template <typename T>
void addSurface(const float* surface_colour, const T* weight, size_t count, T* colour) {
  for (size_t i = 0; i < count; ++i) {
    for (size_t c = 0; c < 4; ++c) colour[i * 4 + c] += weight[i] * T(surface_colour[i * 4 + c]);
  }
}

}  // namespace stipple
