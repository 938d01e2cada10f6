#include "shot/passes.h"

#include <vector>

#include "base/parallel.h"
#include "math/colour.h"

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
  if (settings.options.surface.colour || settings.splat_light) {
    finishLayers(passes.colour, settings, picture.surface_weight, pixel_count);
  }
}

}  // namespace

void askForPasses(const ShotPasses& passes, RenderOptions& options) {
  options.with_depth = passes.depth != nullptr;
  options.with_median_depth = passes.median_depth != nullptr;
  options.with_counts = passes.counts != nullptr;
  options.with_transmittance = passes.transmittance != nullptr;
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
