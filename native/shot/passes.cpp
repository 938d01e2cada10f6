#include "shot/passes.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "math/colour.h"
#include "math/empty_depth.h"
#include "splat/render/surface.h"

namespace stipple {

namespace {

/// Applies `curve` to the colours of premultiplied pixels, in place.
template <typename Curve>
void changeColour(float* colour, size_t pixel_count, const Curve& curve) {
  parallelFor(pixel_count, 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* pixel = colour + i * 4;
      const float alpha = pixel[3];
      if (alpha <= 0.0f) continue;
      for (int c = 0; c < 3; ++c) pixel[c] = curve(pixel[c] / alpha) * alpha;
    }
  });
}

template <typename From, typename To>
void copyTo(const std::vector<From>& values, To* out) {
  if (!out) return;
  for (size_t i = 0; i < values.size(); ++i) out[i] = static_cast<To>(values[i]);
}

/// Composites a picture over the image behind it, in place, in the space that it was composited in.
/// `to` and `from`: from the space of both into that one, and back.
template <typename Number, typename To, typename From>
void addBackground(const ShotSettings& settings, const std::vector<Number>& transmittance,
                   const To& to, const From& from, float* colour) {
  const float* behind = settings.background_image;
  parallelFor(transmittance.size(), 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* pixel = colour + i * 4;
      const float alpha = pixel[3], through = static_cast<float>(transmittance[i]);
      // What neither shows nor passes is a hole; a rounding is none.
      const float hole = 1.0f - alpha - through;
      const float whole = hole > 1e-5f ? 1.0f - hole : 1.0f;
      for (size_t c = 0; c < 3; ++c) {
        const float light = std::isfinite(behind[i * 3 + c]) ? behind[i * 3 + c] : 0.0f;
        const float own = alpha > 0.0f ? to(pixel[c] / alpha) * alpha : 0.0f;
        pixel[c] = whole > 0.0f ? from((own + through * to(light)) / whole) * whole : 0.0f;
      }
      pixel[3] = whole;
    }
  });
}

template <typename Number>
void finishBackground(const ShotSettings& settings, const std::vector<Number>& transmittance,
                      bool is_display, float* colour) {
  if (is_display) {
    addBackground(
        settings, transmittance, [](float value) { return linearToSrgb(value); },
        [](float value) { return srgbToLinear(value); }, colour);
  } else {
    const auto same = [](float value) { return value; };
    addBackground(settings, transmittance, same, same, colour);
  }
}

/// Expected depths as ShotSettings::solid_depth has them, in place. In: colour, of the splats alone
/// unless there is a background.
template <typename Result>
void makeSolid(const Result& picture, const ShotSettings& settings, float* depth) {
  const SurfaceLayer& surface = settings.options.surface;
  // Averages have colours of all images, and depths of one: they cannot be taken apart.
  const bool is_average = isSampled(settings.sampling);
  parallelFor(picture.depth.size(), 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double splats = static_cast<double>(picture.colour[i * 4 + 3]);
      if (settings.options.with_background) splats -= static_cast<double>(picture.transmittance[i]);
      double own = 0, far = static_cast<double>(kEmptyDepth);
      if (surface.depth && surface.colour) {
        own = static_cast<double>(picture.surface_weight[i]) *
              static_cast<double>(surface.colour[i * 4 + 3]);
        far = static_cast<double>(surface.depth[i]);
      }
      const double mean = static_cast<double>(picture.depth[i]);
      if (splats <= 0) continue;
      if (splats + own < 0.5) {
        depth[i] = kEmptyDepth;
      } else if (own > splats) {
        depth[i] = static_cast<float>(std::min(far, static_cast<double>(kEmptyDepth)));
      } else if (own > 0 && far < static_cast<double>(kEmptyDepth) && !is_average) {
        depth[i] = static_cast<float>((mean * (splats + own) - own * far) / splats);
      }
    }
  });
}

/// From the splats to the picture, in place: their colours times `light`, then the surface.
template <typename Weight>
void finishLayers(float* colour, const ShotSettings& settings,
                  const std::vector<Weight>& surface_weight, size_t pixel_count) {
  const float* surface = settings.options.surface.colour;
  const float* light = settings.splat_light;
  parallelFor(pixel_count, 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* pixel = colour + i * 4;
      for (size_t c = 0; light && c < 3; ++c) pixel[c] *= light[i * 3 + c];
      if (!surface) continue;
      const float weight = static_cast<float>(surface_weight[i]);
      for (size_t c = 0; c < 4; ++c) pixel[c] += weight * surface[i * 4 + c];
    }
  });
}

template <typename Result>
void fill(const Result& picture, const ShotSettings& settings, const ShotPasses& passes,
          bool is_light) {
  copyTo(picture.colour, passes.colour);
  copyTo(picture.depth, passes.depth);
  if (settings.solid_depth && passes.depth) makeSolid(picture, settings, passes.depth);
  copyTo(picture.median_depth, passes.median_depth);
  copyTo(picture.counts, passes.counts);
  copyTo(picture.transmittance, passes.transmittance);
  copyTo(picture.normal, passes.normal);
  copyTo(picture.objects, passes.objects);
  if (!passes.colour) return;
  const size_t pixel_count = static_cast<size_t>(picture.width) * picture.height;
  if (is_light && settings.averages_light) {
    changeColour(passes.colour, pixel_count, [](float value) { return linearToSrgb(value); });
  } else if (!is_light && settings.linearise) {
    lineariseColour(passes.colour, pixel_count);
  }
  if (settings.background_image) {
    finishBackground(settings, picture.transmittance, settings.linearise, passes.colour);
  }
  if (settings.options.surface.colour || settings.splat_light) {
    finishLayers(passes.colour, settings, picture.surface_weight, pixel_count);
  }
}

}  // namespace

void askForPasses(const ShotPasses& passes, ShotSettings& settings) {
  RenderOptions& options = settings.options;
  options.with_depth = passes.depth != nullptr;
  options.with_median_depth = passes.median_depth != nullptr;
  options.with_counts = passes.counts != nullptr;
  options.with_transmittance = passes.transmittance != nullptr || settings.background_image ||
                               settings.surroundings.pixels ||
                               (settings.solid_depth && options.with_background);
  options.with_normal = passes.normal != nullptr;
  options.with_objects = passes.objects != nullptr;
}

void lineariseColour(float* colour, size_t pixel_count) {
  changeColour(colour, pixel_count, [](float value) { return srgbToLinear(value); });
}

void fillPasses(const RenderResult& picture, const ShotSettings& settings, const ShotPasses& passes,
                bool is_light) {
  fill(picture, settings, passes, is_light);
}

void fillPasses(const ReferenceResult& picture, const ShotSettings& settings,
                const ShotPasses& passes) {
  fill(picture, settings, passes, false);
}

void narrow(const ReferenceResult& from, RenderResult& to) {
  to.width = from.width;
  to.height = from.height;
  const auto take = [](const auto& values, auto& out) {
    out.resize(values.size());
    copyTo(values, out.data());
  };
  take(from.colour, to.colour);
  take(from.depth, to.depth);
  take(from.median_depth, to.median_depth);
  take(from.counts, to.counts);
  take(from.surface_weight, to.surface_weight);
  take(from.transmittance, to.transmittance);
  take(from.normal, to.normal);
  take(from.objects, to.objects);
}

}  // namespace stipple
