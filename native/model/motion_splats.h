#pragma once

#include <memory>

#include "model/splat_model.h"
#include "motion/motion_cloud.h"

namespace stipple {

/// The kind "motion": splats that move by numbers of their own. It has no density, and always gives
/// all of its splats, as they are at the time that is asked for.
/// Errors: kInvalidArgument for what validate() refuses, and for no splats.
std::shared_ptr<const SplatModel> makeMotionSplats(MotionCloud moving, ModelNotes notes = {});

}  // namespace stipple
