#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/clouds/cloud_extent.h"
#include "data/clouds/splat_cloud.h"
#include "decode/tree/merge_rounds.h"

namespace stipple {

/// Leaves in Morton order: neighbours in space are neighbours in memory. Returns: [N] rows.
std::vector<uint32_t> spatialOrder(const std::vector<float>& positions, const CloudExtent& extent);

/// A visibility as merges count it: splats that no view sees may show in others, and count a
/// little.
double countedVisibility(float visibility);

/// As many splats of the same kind.
SplatCloud emptyLike(const SplatCloud& cloud, size_t count);

/// Rows of a cloud in another order.
void gatherRows(SplatCloud& cloud, const std::vector<uint32_t>& from);

/// Refuses footprints that no tree is built for. Errors: kInvalidArgument.
void requireFootprint(double footprint);

/// Refuses inner nodes that are not one fewer than the leaves, or of another harmonic degree.
/// `what` names their tree. Errors: kInvalidArgument.
void requireNodesLike(const SplatCloud& nodes, const SplatCloud& leaves, const char* what);

/// Harmonics of merged splats: the mean of both children's by their weights.
class HarmonicRows {
 public:
  /// In: order: the leaf of each first node; merged [N-1], by the order of merging.
  HarmonicRows(const SplatCloud& leaves, const std::vector<uint32_t>& order, SplatCloud& merged)
      : leaves_(leaves), order_(order), merged_(merged), stride_(leaves.shStride()) {}

  void mix(const MergeIds& ids, double share_first);

 private:
  const float* row(uint32_t id) const;

  const SplatCloud& leaves_;
  const std::vector<uint32_t>& order_;
  SplatCloud& merged_;
  size_t stride_;
};

}  // namespace stipple
