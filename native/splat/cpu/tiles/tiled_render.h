#pragma once

#include "splat/cpu/tiles/tile_kernel.h"
#include "splat/cpu/tiles/tile_lists.h"
#include "splat/cpu/tiles/tile_passes.h"
#include "splat/cpu/visible_splats.h"
#include "splat/render/render.h"

namespace stipple {

/// What a backward pass needs of the picture that was drawn last, beside the scene, its splats and
/// lists. Pixels lie tile by tile, each [kTilePixelCount].
struct KeptPicture {
  bool wanted = false;
  uint64_t number = 0;  ///< RenderResult::number; 0: nothing usable is here
  uint32_t width = 0;   ///< pixels
  uint32_t height = 0;
  bool with_background = false;
  bool with_depth = false;
  double background[3] = {};
  std::vector<const SplatCloud*> clouds;  ///< of the instances
  uint64_t fingerprint = 0;               ///< fingerprintOf the clouds as they were drawn
  ReusedArray<float> transmittance;       ///< behind the last splat
  /// As TilePixels::end; kInDoubt where the pixel was blended again in double.
  ReusedArray<int32_t> ends;
  ReusedArray<float>
      depth;  ///< as RenderResult::depth but over TilePixels::coverage, if with_depth

  uint64_t bytes() const;
};

constexpr int32_t kInDoubt = -1;

/// What RenderWorkspace holds.
struct RenderWorkspace::Arrays {
  PlacedScene scene;
  VisibleSplats visible;
  TileListMemory lists;
  KeptPicture kept;
  PassSplats passes;
};

/// Tells whether the clouds, of unchanged sizes, are still those that were drawn: of every position
/// and opacity, and of the rotations, scales and colours of some visible splats. A step of training
/// changes all of them. Same for any number of threads. Cost: reads 16 bytes per splat.
uint64_t fingerprintOf(const PlacedScene& scene, const VisibleSplats& visible);

/// Bytes of KeptPicture at most.
uint64_t keptPictureBound(const TileGrid& grid, bool with_depth, size_t instance_count);

/// renderTiledWith that hands out no picture and keeps what a backward pass needs.
void blendTiledWith(TileKernel kernel, Projector projector,
                    std::span<const SplatInstance> instances, const Camera& camera,
                    const RenderOptions& options, RenderWorkspace& workspace, Progress* progress);

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
