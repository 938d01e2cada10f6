#pragma once

#include <cstdint>
#include <string>

#include "data/views/view_source.h"
#include "train/loop/held_out.h"

namespace stipple {

/// What the data set says of its views; where it says nothing, or nothing is to be held out, every
/// so many-th is (splitViews).
FitViews splitAsTold(const ViewSource& views, uint64_t holdout);

/// One sentence on which cameras are held out, where cameras took several views each; else empty.
std::string heldOutCameras(const ViewSource& views, const FitViews& split);

}  // namespace stipple
