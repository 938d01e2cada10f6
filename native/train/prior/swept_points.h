#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/progress.h"
#include "data/views/view_source.h"
#include "train/prior/start_points.h"

namespace stipple {

struct SweepOptions {
  uint64_t count = 0;  ///< pixels that are followed
  uint64_t seed = 0;
  /// Pixels give no place whose depth is not told apart: the views must look twice as alike there
  /// as anywhere else along the ray.
  bool only_certain = false;
};

/// Places on surfaces, found by what pictures have in common, where nothing else tells of them. A
/// pixel is followed along its ray; of the depths that no view sees through (visual hull, where
/// pictures have alpha), the one stands at which the neighbouring views look most alike.
/// Returns: at most SweepOptions::count places with the colours of their pixels. Where pictures
/// show nothing to tell depths apart, and of a view alone, any depth in the cameras' volume will
/// do. In: training: the views that may be looked at, at least one. Same result for any number of
/// threads. Cost: O(count); loads at most 64 pictures, and keeps them at 256 pixels a side.
/// Errors: those of ViewSource::load. Source: Collins, A Space-Sweep Approach to True Multi-Image
/// Matching, CVPR 1996; Laurentini, The Visual Hull Concept, PAMI 1994.
StartPoints sweptPoints(const ViewSource& views, std::span<const size_t> training,
                        const SweepOptions& options, Progress* progress = nullptr);

/// How many places are worth looking for: 30,000, or one for 16 pixels where that is fewer, of the
/// pictures that are compared, at the size at which they are.
uint64_t placesOfPictures(const ViewSource& views, std::span<const size_t> training);

}  // namespace stipple
