#include "density/learned_draws.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "density/learned_density.h"
#include "math/morton.h"

namespace stipple {

namespace {

uint64_t leafAt(const float* position, int level) {
  std::array<uint32_t, 3> at;
  for (size_t axis = 0; axis < 3; ++axis) {
    at[axis] = static_cast<uint32_t>(std::ldexp(position[axis], level));
  }
  return mortonEncode(at[0], at[1], at[2]);
}

/// As leaves of a level below theirs.
void descend(int leaf_level, AnchorSet& anchors) {
  std::vector<std::pair<uint64_t, size_t>> order(anchors.size());
  for (size_t i = 0; i < anchors.size(); ++i) {
    order[i] = {leafAt(&anchors.positions[i * 3], leaf_level), i};
  }
  std::sort(order.begin(), order.end());
  const AnchorSet from = anchors;
  anchors.leaf_level = leaf_level;
  for (size_t i = 0; i < order.size(); ++i) {
    const auto [leaf, source] = order[i];
    std::copy_n(&from.positions[source * 3], 3, &anchors.positions[i * 3]);
    anchors.log_q[i] = from.log_q[source];
    anchors.leaves[i] = leaf;
    if (!from.ranks.empty()) anchors.ranks[i] = from.ranks[source];
  }
}

}  // namespace

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

AnchorSet drawSettled(const LearnedDensity& density, const AnchorSamplingOptions& options,
                      const LearnedDraws& draws) {
  AnchorSet anchors = drawLearned(SettledDensity(density), options, draws);
  if (anchors.leaf_level < density.leafLevel()) descend(density.leafLevel(), anchors);
  return anchors;
}

}  // namespace stipple
