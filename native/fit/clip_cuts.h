#pragma once

#include <optional>

#include "data/views/view_source.h"

namespace stipple {

/// Where a clip jumps from one shot to another.
struct ClipCut {
  double before = 0;  ///< seconds, of the last frame of the first shot
  double behind = 0;  ///< of the first frame of the second
};

/// The strongest cut of a clip that cameras with names see, if there is one: between two frames
/// that follow each other images change by far more than they do between any others. At most a few
/// cameras are asked, whose images are looked at with few pixels.
/// Cost: loads up to 4 images of each time. Errors: those of ViewSource::load.
std::optional<ClipCut> findCut(const ViewSource& views);

}  // namespace stipple
