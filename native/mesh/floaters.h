#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"

namespace stipple {

/// What counts as a floater: haze, blobs and specks that captures leave in the air. Each rule looks
/// at the splats that those before it left.
struct FloaterOptions {
  bool by_opacity = true;
  bool by_size = true;
  bool by_connectivity = true;
  double min_opacity = 0.02;  ///< 0..1; fainter splats go
  /// Largest standard deviation, metres, above which splats go. Automatic: far outside the
  /// distribution of the logarithms of sizes (median and median absolute deviation).
  std::optional<double> max_size;
  /// Splats at most this far apart hang together, metres. Automatic: well above the distances to
  /// the eighth neighbour, again by median and median absolute deviation.
  std::optional<double> radius;
  /// Smaller groups go; the largest one always stays. Automatic: a thousandth of the splats, held
  /// to 10..1000.
  std::optional<uint64_t> min_group_count;
};

struct FloaterReport {
  uint64_t faint = 0;     ///< by opacity
  uint64_t large = 0;     ///< of the rest, by size
  uint64_t isolated = 0;  ///< of the rest, by connectivity
  uint64_t kept = 0;      ///< the four add up to the splats of the cloud
  uint64_t group_count = 0;
  double max_size = 0;  ///< what was used, metres; 0 where the rule was off
  double radius = 0;
  uint64_t min_group_count = 0;
};

/// Splats to keep: 1, floaters: 0. [N]
/// Errors: kInvalidArgument for options out of range and clouds that validate() refuses,
/// kCancelled. Determinism: any number of threads. Cost: O(N log N).
std::vector<uint8_t> withoutFloaters(const SplatCloud& cloud, const FloaterOptions& options,
                                     FloaterReport& report, Progress* progress);

/// The radius that withoutFloaters() takes by itself for points [N,3]. 0: all are at one place.
double connectingRadius(const std::vector<float>& points);

}  // namespace stipple
