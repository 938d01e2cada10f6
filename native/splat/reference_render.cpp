#include <algorithm>
#include <numeric>

#include "splat/render.h"
#include "splat/scene.h"
#include "splat/surface.h"

// The definition of correct: every visible splat in order at every pixel, in double.

namespace stipple {

namespace {

struct ReferenceSplat {
  Projected<double> projected;
  double colour[3];
  uint32_t key;
  bool is_holdout;
};

/// What shows and what only hides, of splats at one pixel: sums of w, and of w z.
struct Shares {
  double shown = 0;
  double shown_depth = 0;
  double hidden = 0;
};

std::vector<ReferenceSplat> visibleInOrder(const PlacedScene& scene) {
  std::vector<ReferenceSplat> splats;
  for (const PlacedCloud& placed : scene.clouds) {
    for (size_t i = 0; i < placed.cloud->size(); ++i) {
      ReferenceSplat splat;
      if (!projectSplat(scene, placed, i, splat.projected)) continue;
      splatColour(scene, placed, i, splat.colour);
      splat.key = depthKey(splat.projected.depth);
      splat.is_holdout = placed.is_holdout;
      if (splat.is_holdout) std::fill(splat.colour, splat.colour + 3, 0.0);
      splats.push_back(splat);
    }
  }
  std::stable_sort(splats.begin(), splats.end(),
                   [](const ReferenceSplat& a, const ReferenceSplat& b) { return a.key < b.key; });
  return splats;
}

}  // namespace

ReferenceResult renderReference(std::span<const SplatInstance> instances, const Camera& camera,
                                const RenderOptions& options, Progress* progress) {
  const PlacedScene scene = placeScene(instances, camera, options);
  advance(progress, 0.0, "Projecting splats");
  const std::vector<ReferenceSplat> splats = visibleInOrder(scene);

  ReferenceResult result;
  result.width = camera.width;
  result.height = camera.height;
  const size_t pixel_count = static_cast<size_t>(camera.width) * camera.height;
  result.colour.resize(pixel_count * 4);
  if (options.with_depth) result.depth.resize(pixel_count);
  if (options.with_median_depth) result.median_depth.resize(pixel_count);
  if (options.with_counts) result.counts.resize(pixel_count);
  if (options.with_transmittance) result.transmittance.resize(pixel_count);
  const bool with_surface = hasSurface(options);
  result.surface_weight.resize(with_surface ? pixel_count : 0);

  std::vector<const ReferenceSplat*> row;
  for (uint32_t y = 0; y < camera.height; ++y) {
    advance(progress, static_cast<double>(y) / camera.height, "Rendering the reference");
    const double py = y + 0.5;
    // Leaving out splats beyond half_y, and below beyond half_x, cannot change the picture: their
    // alpha there is under 1/255 and splatAlpha would skip them.
    row.clear();
    for (const ReferenceSplat& splat : splats) {
      const Projected<double>& p = splat.projected;
      if (std::abs(py - p.footprint.mean_y) <= p.half_y) row.push_back(&splat);
    }
    for (uint32_t x = 0; x < camera.width; ++x) {
      const double px = x + 0.5;
      const size_t i = static_cast<size_t>(y) * camera.width + x;
      PixelBlend<double> pixel;
      Shares shares;
      SurfaceAtPixel<double> surface{};
      if (with_surface) surface = surfaceAt<double>(options.surface, i);
      for (const ReferenceSplat* splat : row) {
        const Projected<double>& p = splat->projected;
        const double dx = px - p.footprint.mean_x;
        if (std::abs(dx) > p.half_x) continue;
        const double alpha = splatAlpha(
            p.footprint.opacity, halfSquaredDistance(p.footprint, dx, py - p.footprint.mean_y));
        if (!(alpha > 0)) continue;
        if (with_surface && !pixel.isBefore(surface, orderingDepth(p.depth))) {
          pixel.addSurface(surface);
          if (pixel.finished) break;
        }
        const double weight = pixel.transmittance * alpha;
        pixel.add(alpha, splat->colour, p.depth);
        if (pixel.finished) break;
        (splat->is_holdout ? shares.hidden : shares.shown) += weight;
        if (!splat->is_holdout) shares.shown_depth += weight * p.depth;
      }
      if (with_surface && pixel.surface_weight < 0) pixel.addSurface(surface);
      // Sum of w: 1 - T where all shows.
      double coverage = with_surface ? pixel.splatCoverage(surface) : 1.0 - pixel.transmittance;
      double weighted_depth = pixel.weighted_depth;
      if (shares.hidden > 0) {
        coverage = shares.shown;
        weighted_depth = shares.shown_depth;
      }
      for (size_t c = 0; c < 3; ++c) {
        result.colour[i * 4 + c] =
            pixel.colour[c] +
            (options.with_background ? pixel.transmittance * options.background[c] : 0.0);
      }
      result.colour[i * 4 + 3] = options.with_background ? 1.0 - shares.hidden : coverage;
      if (with_surface) {
        result.surface_weight[i] = pixel.surface_weight;
        result.colour[i * 4 + 3] =
            alphaApart(surface, pixel.surface_weight, coverage, options.with_background) -
            (options.with_background ? shares.hidden : 0.0);
      }
      const double empty = static_cast<double>(kEmptyDepth);
      if (options.with_depth) {
        result.depth[i] = coverage > 0 ? weighted_depth / coverage : empty;
        if (with_surface) {
          result.depth[i] =
              depthWithSurface(weighted_depth, coverage, surface, pixel.surface_weight, empty);
        }
      }
      if (options.with_median_depth) {
        result.median_depth[i] = pixel.has_median ? pixel.median_depth : empty;
      }
      if (options.with_counts) result.counts[i] = pixel.count;
      if (options.with_transmittance) result.transmittance[i] = pixel.transmittance;
    }
  }
  if (with_surface && options.surface.colour && !options.splats_apart) {
    addSurface(options.surface.colour, result.surface_weight.data(), pixel_count,
               result.colour.data());
  }
  if (!options.splats_apart) result.surface_weight.clear();
  advance(progress, 1.0, "Rendering the reference");
  return result;
}

}  // namespace stipple
