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

struct StartOptions {
  /// Splats; 0: all points of the prior and, of views without depth in which nothing moves, places
  /// beside them: as many as are missing to placesOfPictures() (swept_points.h), at least that
  /// number times twice the share of the pictures that shows no point (1/2 at most); without
  /// points, placesOfPictures() or the constant above. If there are more points than wanted, it is
  /// drawn by their weights which are taken; if fewer, the pictures tell of others.
  uint64_t count = 0;
  uint64_t max_count = 0;   ///< hard cap; 0: none. Half of it at most is kept free of points
  bool with_lives = false;  ///< find how long points stay where they are
  int sh_degree = 3;
  Antialias antialias = Antialias::kClassic;
  uint64_t seed = 0;
};

struct StartSplats {
  SplatCloud splats;
  std::vector<double> times;  ///< [N] as of PointSet
  std::vector<float> lives;   ///< [N,2] pointLives(), where they were asked for
};

/// The splats that a fit begins with: round, as large as the distance to their neighbours, faint.
/// They stand at the points of the views, and where there are fewer than wanted, at places that the
/// pictures tell of as if there were none: on the surfaces that depth pictures show; without depth,
/// where pictures agree (swept_points.h). Without points, where pictures tell nothing, they stand
/// anywhere in the volume that the cameras share. Points know when they were seen where their
/// source says it, and depth pictures do.
///
/// In: training: the views that may be looked at, at least one. Same result for any number of
/// threads. Cost: O(N log N); loads at most 64 pictures. Errors: those of ViewSource::load.
/// Source: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting, SIGGRAPH 2023, section 5.
StartSplats startSplats(const ViewSource& views, std::span<const size_t> training,
                        const StartOptions& options, Progress* progress = nullptr);

}  // namespace stipple
