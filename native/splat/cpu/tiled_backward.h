#pragma once

#include "splat/cpu/tile_kernel_backward.h"
#include "splat/render_backward.h"

namespace stipple {

/// renderBackward with a kernel of backwardKernels(): for tests and benchmarks that compare them.
BackwardResult renderBackwardWith(const BackwardKernel& kernel,
                                  std::span<const SplatInstance> instances, const Camera& camera,
                                  const RenderOptions& options, const BackwardInput& input,
                                  uint64_t memory_limit_bytes = UINT64_MAX,
                                  Progress* progress = nullptr);

}  // namespace stipple
