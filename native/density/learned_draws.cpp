#include "density/learned_draws.h"

#include <cmath>

namespace stipple {

AnchorSet drawLearned(const DensityModel& density, AnchorSamplingOptions options,
                      const LearnedDraws& draws, Progress* progress) {
  if (draws.nested) {
    options.order = AnchorOrder::kProgressive;
    options.seed += draws.seed;
  }
  AnchorSet anchors = sampleAnchors(density, options, progress);
  if (draws.jitter) return anchors;
  const float leaves = std::ldexp(1.0f, anchors.leaf_level);
  for (float& p : anchors.positions) p = (std::floor(p * leaves) + 0.5f) / leaves;
  return anchors;
}

}  // namespace stipple
