#pragma once

#include <memory>

#include "decode/tree/moving_decoder.h"
#include "train/backend/backend_factory.h"

namespace stipple {

/// Builds trees of splats that move: what views see of them at some times of the clip, then the
/// tree of their merges. In: backends: null: all splats count as seen. The source keeps them.
/// Threads and determinism: parallel; same tree for any number of threads.
/// Cost: one backward pass for each view and time, and buildMovingTree().
MovingTreeSource movingTreesByViews(std::shared_ptr<const BackendFactory> backends);

}  // namespace stipple
