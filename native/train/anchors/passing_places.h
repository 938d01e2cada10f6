#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/views/view_source.h"
#include "decode/anchors/scaffold.h"

namespace stipple {

/// Places at which something is for a part of a clip alone: what moves, comes or goes.
struct PassingPlaces {
  std::vector<float> positions;  ///< [N,3]
  std::vector<double> spans;     ///< [N,2] seconds from when to when

  size_t size() const { return positions.size() / 3; }
  /// [M,3], those at which something is at a moment between two.
  std::vector<float> between(double from, double to) const;
};

/// Those of the points of the views that have times; none where points have none.
/// In: training: the views that may be looked at; seed: of which points are drawn where they are
/// many. Same result for any number of threads. Cost: that of pointLives(). Errors: those of
/// ViewSource::load.
PassingPlaces passingPlaces(const ViewSource& views, std::span<const size_t> training,
                            uint64_t seed, Progress* progress = nullptr);

/// Rows of the anchors of a scaffold but those whose splats have the least opacities together,
/// ascending. In: dropped: how many those are.
std::vector<uint32_t> allButFaintest(const ScaffoldParameters& scaffold, size_t dropped);

}  // namespace stipple
