#pragma once

#include <cstdint>
#include <memory>

#include "densify/control_part.h"
#include "densify/parts/recovery_pruning.h"

namespace stipple {

struct EdgeAwareScoreOptions {
  uint64_t views = 10;  ///< before each event: those of its last iterations
  /// After splats went because they had not recovered, the next event looks at every view.
  RecoveryPruningOptions recovery;
  uint64_t late_after = 14500;  ///< iteration of 30,000 after which strength alone counts
};

/// Of the candidates those multiply first that cover edges of the pictures: their blending weights
/// times the edge in each pixel, over the mean of the view's splats, summed over views. Where none
/// of them covers an edge, strength counts. Owns kScore. Cost: one statistic of the backward pass,
/// in the iterations before an event.
std::unique_ptr<ControlPart> makeEdgeAwareScore(const EdgeAwareScoreOptions& options = {});

}  // namespace stipple
