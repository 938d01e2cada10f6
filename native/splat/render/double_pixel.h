#pragma once

#include "splat/render/blend.h"
#include "splat/render/render.h"
#include "splat/render/surface.h"

namespace stipple {

/// Which of the blending equation's limits hold (splat/render/blend.h).
struct BlendLimits {
  double least_alpha = kMinAlpha;  ///< fainter splats are skipped
  double most_alpha = kMaxAlpha;   ///< more opaque ones count as this
  bool ends_early = true;          ///< at a transmittance of 1e-4
};

/// A pixel that is blended in double, with what shows, what only hides, and a surface between.
class DoublePixel {
 public:
  /// In: pixel: index into the options' surface.
  DoublePixel(const RenderOptions& options, size_t pixel, bool ends_early = true)
      : has_surface_(hasSurface(options)), ends_early_(ends_early) {
    if (has_surface_) surface_ = surfaceAt<double>(options.surface, pixel);
  }

  /// Blends the next splat, alpha > 0. Returns false where the pixel has ended.
  bool add(double alpha, const double* colour, double depth, bool is_holdout) {
    if (has_surface_ && !blend_.isBefore(surface_, orderingDepth(depth))) {
      blend_.addSurface(surface_);
      if (hasEnded()) return false;
    }
    const double weight = blend_.transmittance * alpha;
    if (ends_early_) {
      blend_.add(alpha, colour, depth);
      if (blend_.finished) return false;
    } else {
      addWhole(alpha, weight, colour, depth);
    }
    weight_ = weight;
    (is_holdout ? hidden_ : shown_) += weight;
    if (!is_holdout) shown_depth_ += weight * depth;
    return true;
  }

  /// Of the splat that was blended last.
  double weight() const { return weight_; }

  /// Of the surface itself, once write() has been called.
  double ownSurfaceWeight() const {
    return has_surface_ && surface_.shows ? blend_.surface_weight * surface_.opacity : 0.0;
  }

  /// Writes pixel `i` of a result that has its arrays; colours are without the surface's.
  template <typename Result>
  void write(const RenderOptions& options, size_t i, Result& result) {
    using Number = typename decltype(result.colour)::value_type;
    if (has_surface_ && blend_.surface_weight < 0) blend_.addSurface(surface_);
    // Sum of w: 1 - T where all shows.
    double coverage = has_surface_ ? blend_.splatCoverage(surface_) : 1.0 - blend_.transmittance;
    double weighted_depth = blend_.weighted_depth;
    if (hidden_ > 0) {
      coverage = shown_;
      weighted_depth = shown_depth_;
    }
    for (size_t c = 0; c < 3; ++c) {
      const double behind =
          options.with_background ? blend_.transmittance * options.background[c] : 0.0;
      result.colour[i * 4 + c] = static_cast<Number>(blend_.colour[c] + behind);
    }
    double alpha = options.with_background ? 1.0 - hidden_ : coverage;
    if (has_surface_) {
      result.surface_weight[i] = static_cast<Number>(blend_.surface_weight);
      alpha = alphaApart(surface_, blend_.surface_weight, coverage, options.with_background) -
              (options.with_background ? hidden_ : 0.0);
    }
    result.colour[i * 4 + 3] = static_cast<Number>(alpha);
    const double empty = static_cast<double>(kEmptyDepth);
    if (options.with_depth) {
      double depth = coverage > 0 ? weighted_depth / coverage : empty;
      if (has_surface_) {
        depth = depthWithSurface(weighted_depth, coverage, surface_, blend_.surface_weight, empty);
      }
      result.depth[i] = static_cast<Number>(depth);
    }
    if (options.with_median_depth) {
      result.median_depth[i] = static_cast<Number>(blend_.has_median ? blend_.median_depth : empty);
    }
    if (options.with_counts) result.counts[i] = blend_.count;
    if (options.with_transmittance) {
      result.transmittance[i] = static_cast<Number>(blend_.transmittance);
    }
  }

 private:
  bool hasEnded() const { return ends_early_ && blend_.finished; }

  void addWhole(double alpha, double weight, const double* colour, double depth) {
    for (size_t c = 0; c < 3; ++c) blend_.colour[c] += weight * colour[c];
    blend_.weighted_depth += weight * depth;
    blend_.transmittance *= 1 - alpha;
    if (!blend_.has_median && blend_.transmittance < 0.5) {
      blend_.has_median = true;
      blend_.median_depth = depth;
    }
    ++blend_.count;
  }

  PixelBlend<double> blend_;
  SurfaceAtPixel<double> surface_{};
  bool has_surface_;
  bool ends_early_;
  double shown_ = 0, shown_depth_ = 0, hidden_ = 0, weight_ = 0;
};

/// Arrays of a result for what the options ask for.
template <typename Result>
void sizeResult(const Camera& camera, const RenderOptions& options, Result& result) {
  result.width = camera.width;
  result.height = camera.height;
  const size_t pixel_count = static_cast<size_t>(camera.width) * camera.height;
  result.colour.resize(pixel_count * 4);
  if (options.with_depth) result.depth.resize(pixel_count);
  if (options.with_median_depth) result.median_depth.resize(pixel_count);
  if (options.with_counts) result.counts.resize(pixel_count);
  if (options.with_transmittance) result.transmittance.resize(pixel_count);
  if (options.with_normal) result.normal.resize(pixel_count * 3);
  if (options.with_objects) result.objects.resize(pixel_count);
  result.surface_weight.resize(hasSurface(options) ? pixel_count : 0);
}

/// After every pixel has been written: the surface's colour, where it is wanted.
template <typename Result>
void finishSurface(const RenderOptions& options, Result& result) {
  if (hasSurface(options) && options.surface.colour && !options.splats_apart) {
    addSurface(options.surface.colour, result.surface_weight.data(), result.colour.size() / 4,
               result.colour.data());
  }
  if (!options.splats_apart) result.surface_weight.clear();
}

}  // namespace stipple
