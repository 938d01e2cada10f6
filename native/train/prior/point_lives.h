#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/views/view_source.h"
#include "train/prior/start_points.h"

namespace stipple {

/// Of a point that stays where it is until an end of the clip.
constexpr float kWholeLife = 1e30f;
/// Of a point of which nothing is known.
constexpr float kUnknownLife = -1;

/// How long points stay where they are seen: seconds before and after the time of each, [N,2],
/// kWholeLife or kUnknownLife; empty where points have no times.
///
/// Points that are there at all times live for the whole clip. Of others, cameras that stand still
/// tell it. Where none can, those that move on, as others are there at all times, live until
/// half-way to the next time at which any was seen.
///
/// A camera that shows the colour of a point at its place, at its own time, is asked at other times
/// whether it still does. The life ends where most of these cameras do not. What covers a point for
/// a while does not end its life where it is seen again for most of the clip.
/// In: training: the views that may be looked at. Same result for any number of threads. Cost: at
/// most 5 cameras at 48 times are loaded. Errors: those of ViewSource::load.
std::vector<float> pointLives(const ViewSource& views, std::span<const size_t> training,
                              const StartPoints& points, Progress* progress = nullptr);

}  // namespace stipple
