#pragma once

#include "splat/cpu/tile_kernel.h"
#include "splat/render.h"

namespace stipple {

/// renderTiled with a kernel of tileKernels(): for tests and benchmarks that compare them.
RenderResult renderTiledWith(TileKernel kernel, std::span<const SplatInstance> instances,
                             const Camera& camera, const RenderOptions& options,
                             Progress* progress = nullptr);

}  // namespace stipple
