#pragma once

#include "splat/render/ray_render.h"

namespace stipple {

enum class Precision : uint32_t { kFloat = 0, kDouble = 1 };

/// What of a picture trades exactness for time, beside what RenderOptions has.
struct RenderAccuracy {
  RayOrder order = RayOrder::kCentre;
  RayProjection projection = RayProjection::kAffine;
  Precision precision = Precision::kFloat;
  BlendLimits limits;
  /// n: the picture at n times the size, averaged over squares of n x n; 1..kMaxSamplesPerSide.
  uint32_t samples_per_side = 1;
};

constexpr uint32_t kMaxSamplesPerSide = 16;

/// Whether renderTiled draws this picture; else renderRays.
bool isTiled(const RenderAccuracy& accuracy);
/// Whether it is renderRays, every splat near a block at each of its pixels, with one sample each.
bool isSlow(const RenderAccuracy& accuracy, const Camera& camera);
/// What renderRays is told then.
RayOptions rayOptions(const RenderAccuracy& accuracy);

/// Draws with the cheapest renderer that keeps what `accuracy` asks for. Of an averaged picture
/// colour, alpha and transmittance are means; depth is the mean weighted by alpha; median depth the
/// median of the medians, the nearer of two; counts the largest; normals the mean, made unit again;
/// objects those of the middle.
/// In: workspace, used where the picture is tiled. Out: result.
/// Errors: those of renderTiled; kInvalidArgument for samples outside their range and for an
/// averaged picture above 65,536 pixels a side.
void renderAccurate(std::span<const SplatInstance> instances, const Camera& camera,
                    const RenderOptions& options, const RenderAccuracy& accuracy,
                    RenderWorkspace& workspace, RenderResult& result, Progress* progress = nullptr);

/// Upper bound of the bytes that it allocates.
RenderMemory accurateMemory(std::span<const SplatInstance> instances, const Camera& camera,
                            const RenderOptions& options, const RenderAccuracy& accuracy);

}  // namespace stipple
