#pragma once

#include "splat/cpu/tile_kernel.h"
#include "splat/cpu/tile_lists.h"
#include "splat/cpu/visible_splats.h"
#include "splat/render.h"

namespace stipple {

/// What RenderWorkspace holds.
struct RenderWorkspace::Arrays {
  PlacedScene scene;
  VisibleSplats visible;
  TileListMemory lists;
};

/// renderTiled with a kernel of tileKernels() and a projector of projectors(): for tests and
/// benchmarks that compare them.
void renderTiledWith(TileKernel kernel, Projector projector,
                     std::span<const SplatInstance> instances, const Camera& camera,
                     const RenderOptions& options, RenderWorkspace& workspace, RenderResult& result,
                     Progress* progress = nullptr);

/// The same with the best projector and memory of its own.
RenderResult renderTiledWith(TileKernel kernel, std::span<const SplatInstance> instances,
                             const Camera& camera, const RenderOptions& options,
                             Progress* progress = nullptr);

}  // namespace stipple
