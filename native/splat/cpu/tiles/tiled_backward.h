#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <vector>

#include "splat/cpu/back_projector.h"
#include "splat/cpu/backward_sums.h"
#include "splat/cpu/reused_array.h"
#include "splat/cpu/tiles/tile_backward.h"
#include "splat/cpu/tiles/tile_kernel_backward.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/render/render_backward.h"

namespace stipple {

/// Scratch of tiles: one for every thread that was at work at the same time.
class TileScratch {
 public:
  std::unique_ptr<TileBackward> take();
  void giveBack(std::unique_ptr<TileBackward> one);
  uint64_t bytes() const { return idle_.size() * TileBackward::memoryBound(); }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<TileBackward>> idle_;
};

struct BackwardWorkspace::Arrays {
  RenderWorkspace own_picture;  ///< of a call from nothing
  BackwardSums sums;
  ReusedArray<float> tile_sums;     ///< [held entries][fields]
  std::vector<uint32_t> used;       ///< [tiles] as TileSums::used
  std::vector<double> backgrounds;  ///< [tiles][3]
  std::vector<std::array<double, 6>> cameras;
  TileScratch scratch;
};

/// renderBackward with a kernel of backwardKernels() and one of backProjectors(): for tests and
/// benchmarks that compare them.
void renderBackwardWith(const BackwardKernel& kernel, BackProjector project, RenderWorkspace& drawn,
                        const RenderResult& picture, const BackwardInput& input,
                        BackwardWorkspace& workspace, BackwardResult& result,
                        uint64_t memory_limit_bytes = UINT64_MAX, Progress* progress = nullptr);
void renderBackwardWith(const BackwardKernel& kernel, BackProjector project,
                        std::span<const SplatInstance> instances, const Camera& camera,
                        const RenderOptions& options, const BackwardInput& input,
                        BackwardWorkspace& workspace, BackwardResult& result,
                        uint64_t memory_limit_bytes = UINT64_MAX, Progress* progress = nullptr);
BackwardResult renderBackwardWith(const BackwardKernel& kernel, BackProjector project,
                                  std::span<const SplatInstance> instances, const Camera& camera,
                                  const RenderOptions& options, const BackwardInput& input,
                                  uint64_t memory_limit_bytes = UINT64_MAX,
                                  Progress* progress = nullptr);

}  // namespace stipple
