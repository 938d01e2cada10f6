#pragma once

#include <memory>

#include "decode/tree/moving_decoder.h"
#include "model/splat_model.h"
#include "motion/motion_cloud.h"

namespace stipple {

/// The kind "motion": splats that move by numbers of their own, at any budget by the tree of their
/// merges. It has no density. In: tree: null: the first who asks for fewer than all has it built by
/// `trees`. Errors: kInvalidArgument for what validate() refuses, for no splats, and for a tree
/// that does not fit them.
std::shared_ptr<const SplatModel> makeMotionSplats(MotionCloud moving, ModelNotes notes = {},
                                                   std::shared_ptr<const MovingTree> tree = nullptr,
                                                   MovingTreeSource trees = {});

}  // namespace stipple
