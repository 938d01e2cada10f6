#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "decode/detail/detail_network.h"
#include "train/detail/coarse_evidence.h"

namespace stipple {

/// Numbers that the network says of a child: colour, logit of opacity, log scales along the axes of
/// the splat that it comes from, and a turn in these axes.
constexpr size_t kChildNumbers = 11;

/// Whether a splat can become that many: 1, 2, 4 or 8, one halving for each of its axes.
bool isChildCount(size_t children);

/// The splats of the network's leaves. Of zeros they look about as the coarse splat does: it is cut
/// in two along its longest axes, each half 0.4 deviations to one side, 0.8 times as long, and so
/// much less opaque that all of them together hide what the whole one did. What the network says
/// moves, scales, turns and colours them from there; higher harmonics stay.
class ChildSplats {
 public:
  /// In: children of each layer (isChildCount()); what the network was given, and made of it.
  ChildSplats(const SplatCloud& coarse, const CoarseEvidence& evidence,
              std::span<const size_t> children, const DetailNetwork::Tape& tape);

  /// Coarse splats that stay, in their order, then the leaves, layer by layer. In: leaves, of
  /// forward(). Threads and determinism: parallel; same bits for any number of threads.
  SplatCloud apply(std::span<const DetailNetwork::Leaves> leaves) const;
  /// In: fine, of apply(); by_fine: derivatives by its stored values. Out: by the leaves.
  std::vector<DetailNetwork::Leaves> backward(std::span<const DetailNetwork::Leaves> leaves,
                                              const SplatCloud& fine,
                                              const SplatCloud& by_fine) const;

  /// How a leaf begins.
  struct Start {
    uint32_t point = 0;  ///< of the evidence
    /// In deviations of the coarse splat, along its axes.
    Vec3d offset = Vec3d::Zero();
    Vec3d shrinks = Vec3d::Ones();  ///< of its scales
    double opacity = 0;
  };

 private:
  const SplatCloud& coarse_;
  const CoarseEvidence& evidence_;
  std::vector<OrderedSplat> splats_;  ///< [points]
  std::vector<uint32_t> stays_;       ///< coarse splats
  std::vector<Start> starts_;         ///< of all leaves, layer by layer
};

}  // namespace stipple
