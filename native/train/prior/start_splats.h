#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "data/views/view_source.h"

namespace stipple {

/// Where there is no prior, or none says how many.
constexpr uint64_t kStartSplatsOfDepth = 50000;
constexpr uint64_t kStartSplatsOfPictures = 30000;

struct StartOptions {
  /// Splats; 0: as many as the prior has points, or the constants above. No more than the prior has
  /// points: which of them is drawn by their weights.
  uint64_t count = 0;
  uint64_t max_count = 0;  ///< hard cap; 0: none
  int sh_degree = 3;
  Antialias antialias = Antialias::kClassic;
  uint64_t seed = 0;
};

/// The splats that a fit begins with: round, as large as the distance to their neighbours, faint.
/// They stand at the points of the views; without points, on the surfaces that depth pictures show;
/// without depth, where pictures agree (swept_points.h); where they tell nothing, anywhere in the
/// volume that the cameras share.
/// In: training: the views that may be looked at, at least one. Same result for any number of
/// threads. Cost: O(N log N); loads at most 64 pictures. Errors: those of ViewSource::load.
/// Source: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting, SIGGRAPH 2023, section 5.
SplatCloud startSplats(const ViewSource& views, std::span<const size_t> training,
                       const StartOptions& options, Progress* progress = nullptr);

/// When the surface at each of these splats was there: [N] seconds, NaN at all times (PointSet);
/// empty where no point says so, or where they do not stand at points.
std::vector<double> startTimes(const ViewSource& views, const StartOptions& options);

}  // namespace stipple
