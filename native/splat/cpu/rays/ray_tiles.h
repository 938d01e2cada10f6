#pragma once

#include "splat/cpu/rays/ray_tile_kernel.h"
#include "splat/render/ray_render.h"

namespace stipple {

/// renderRays in single precision, for whole pictures: lists of the splats that each tile's pixels
/// may meet, rays a vector at a time, blending in double. Alpha is off by rounding of float32, at
/// most 1e-4 of itself; what float32 cannot decide double does, as renderRays would: whether a
/// splat shows, which of two is nearer, and all of splats that are too thin for it.
/// Same bits for any number of threads. Errors: those of renderRays; kInvalidArgument where
/// rays.areas has any.
RenderResult renderRayTiles(std::span<const SplatInstance> instances, const Camera& camera,
                            const RenderOptions& options, const RayOptions& rays,
                            Progress* progress = nullptr);

/// The same with a kernel of rayTileKernels(), for tests and benchmarks.
RenderResult renderRayTilesWith(RayTileKernel kernel, std::span<const SplatInstance> instances,
                                const Camera& camera, const RenderOptions& options,
                                const RayOptions& rays, Progress* progress = nullptr);

/// Upper bound of the bytes that it allocates. From a million splats on, those that the picture can
/// show are counted for it. Errors: those of renderRays, about clouds that are read then.
RenderMemory rayTileMemory(std::span<const SplatInstance> instances, const Camera& camera,
                           const RenderOptions& options, const RayOptions& rays);

}  // namespace stipple
