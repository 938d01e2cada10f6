#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"

namespace stipple {

struct FillOptions {
  /// Removed splats this near to each other are one hole, metres. Automatic: as floaters are
  /// grouped.
  std::optional<double> radius;
  /// How far around a hole splats are copied from, metres. Automatic: half the width of the hole,
  /// and at least some rows of splats.
  std::optional<double> ring_width;
  /// Side of the patches that are copied at once, metres. Automatic: a dozen splats.
  std::optional<double> patch_size;
  uint64_t seed = 0;  ///< of the choice among patches that fit equally
};

struct FillReport {
  uint64_t hole_count = 0;      ///< groups of removed splats
  uint64_t filled_count = 0;    ///< of those, filled
  uint64_t no_ring_count = 0;   ///< fewer than 16 splats of the ground are left around them
  uint64_t no_plane_count = 0;  ///< what is left around them spans no plane
  uint64_t covered_count = 0;   ///< nothing is missing of the ground under them
  uint64_t splat_count = 0;     ///< new splats
  double radius = 0;            ///< as used, metres; 0: all removed splats are at one place
};

/// Splats that close the holes of a cloud, alone. A hole is a group of removed splats. A plane is
/// laid through what is left around it, bent a little where the ground is; cells of the plane where
/// splats are missing get copies of the splats of cells where they are not, patch by patch, at the
/// same height over the ground, turned with it.
/// In: removed [N]: anything but 0 is a removed splat.
/// Errors: kInvalidArgument for a cloud that validate() refuses, a mask of another length, one that
/// removes nothing or all, options out of range; kCancelled.
/// Determinism: by the seed, for any number of threads. Cost: O(N) for each hole.
SplatCloud holesFilled(const SplatCloud& cloud, std::span<const uint8_t> removed,
                       const FillOptions& options, FillReport& report, Progress* progress);

}  // namespace stipple
