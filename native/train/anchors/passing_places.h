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

/// Features at which a network of opacities shows all splats of an anchor, if faintly: 0 where it
/// does, as at the start of a fit, else what is nearest to 0. Splats that are not there learn
/// nothing, and networks that have learned for long need not show those of features of 0.
/// Returns: [kScaffoldFeatures].
std::vector<float> faintFeatures(const Mlp& opacity);

}  // namespace stipple
