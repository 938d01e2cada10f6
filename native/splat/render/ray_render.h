#pragma once

#include <span>

#include "base/progress.h"
#include "splat/render/double_pixel.h"
#include "splat/render/render.h"

namespace stipple {

/// In which order splats come at a pixel.
enum class RayOrder : uint32_t {
  kResponse =
      0,        ///< by where on the pixel's ray each is densest: right where splats interpenetrate
  kCentre = 1,  ///< by the view z of the centres, as the tiled renderer has them
};

/// What the picture makes of a splat.
enum class RayProjection : uint32_t {
  kRay = 0,     ///< what each pixel's ray meets
  kAffine = 1,  ///< an ellipse, by the derivative of the projection at the splat's centre
};

/// Some pixels of a picture.
struct PixelArea {
  uint32_t x0 = 0, y0 = 0;
  uint32_t width = 0, height = 0;
};

struct RayOptions {
  RayOrder order = RayOrder::kResponse;
  RayProjection projection = RayProjection::kRay;
  BlendLimits limits;
  /// Pixels to draw, whole blocks of kRayBlockSide from multiples of it on; the others stay 0.
  /// Empty: all.
  std::span<const PixelArea> areas = {};
  double progress_begin = 0, progress_end = 1;  ///< fractions that drawing goes through
};

constexpr uint32_t kRayBlockSide = 64;

/// Without limits: nothing is left out that could show, no alpha is limited, no pixel ends early.
/// What is fainter than 1e-9 is skipped.
RayOptions unlimitedRays();

struct PlacedScene;
/// Errors: kUnsupported for objects that are drawn apart, where splats come by response: those of
/// one object then belong between those of another.
void requireOrder(const PlacedScene& scene, const RayOptions& rays);

/// Draws splats along the rays of the pixels: alpha = o exp(-m^2 / 2), m the smallest Mahalanobis
/// distance of the ray from the splat. That is what a Gaussian in space looks like in a perspective
/// picture; the affine projection of renderTiled agrees with it for splats that are small, far away
/// and near the middle, and not at wide angles or close by. The low-pass is one in space, of the
/// width that a pixel has at the splat's centre: variance v (z/f)^2 for v px^2, with the same
/// compensation of opacity. Depths are those of the largest response on the ray.
/// With RayProjection::kAffine alpha is that of renderReference, and the place of the largest
/// response the mean depth of the affine Gaussian behind the pixel.
/// Double precision. Same bits for any number of threads. Cost: O(splats * blocks of 64 x 64 +
/// pixels * splats near their tile). Errors: those of renderTiled.
/// Panoramas and fisheyes too: there z is the distance from the camera everywhere, the width of a
/// pixel is that at the equator or the axis, and what a fisheye does not see stays empty.
/// Based on: Moenne-Loccoz et al., 3D Gaussian Ray Tracing, SIGGRAPH Asia 2024 (the response along
/// a ray); Zwicker et al., EWA Volume Splatting, Visualization 2001 (low-pass). Differs: tiles
/// instead of a tree of boxes; the distance is that of the cross product, which cancels nothing
/// near the axis of a needle.
RenderResult renderRays(std::span<const SplatInstance> instances, const Camera& camera,
                        const RenderOptions& options, const RayOptions& rays,
                        Progress* progress = nullptr);

/// Upper bound of the bytes that renderRays allocates: per splat, and its result.
RenderMemory rayMemory(uint64_t splat_count, size_t instance_count, const Camera& camera,
                       const RenderOptions& options);
RenderMemory rayMemory(std::span<const SplatInstance> instances, const Camera& camera,
                       const RenderOptions& options);

}  // namespace stipple
