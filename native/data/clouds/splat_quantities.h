#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// What can be shown of each splat, to look at density control.
enum class SplatQuantity : uint32_t {
  kScore = 0,      ///< [N] how much it asks to multiply; of the last event, in the strategy's units
  kAge = 1,        ///< [N] iterations of a fit since it was made; without a fit, events
  kSplitAxis = 2,  ///< [N,3] splitAxes()
  kContribution = 3,  ///< [N] pixels that it fills: blending weights, summed; mean of the views
};
constexpr size_t kSplatQuantityCount = 4;

/// What was known of the splats of a cloud when it was made; empty where nothing was.
struct SplatQuantities {
  std::vector<float> score;
  std::vector<float> age;
  std::vector<float> contribution;

  /// The values of a quantity that is kept here; the cloud itself tells kSplitAxis.
  const std::vector<float>& of(SplatQuantity quantity) const;
};

/// [N,3] the longest axis of each splat, in the cloud's frame, times 1 - (second axis / longest): 0
/// where it is round across, and any direction would do, 1 for a needle. Of equal axes the first
/// counts, as where strategies split. Its sign is that of the rotation's column.
std::vector<float> splitAxes(const SplatCloud& cloud);

}  // namespace stipple
