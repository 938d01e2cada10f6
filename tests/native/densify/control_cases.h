#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "densify/control_part.h"
#include "densify/control_scene.h"
#include "densify/strategies.h"

// Splats and moments that strategies are asked about.

namespace stipple::testing {

/// A fit of the published length whose cameras are spread as those of its scenes.
inline FitMoment publishedMoment(uint64_t iteration, uint64_t max_splats = 0) {
  FitMoment moment = at(iteration, max_splats);
  moment.extent = 5;
  moment.position_rate = 1e-3;
  return moment;
}

/// Splats in a box of side 2, of sizes, turns and opacities as they come.
inline RawSplats mixedSplats(size_t count, uint32_t seed, float least_logit = -7,
                             float most_logit = 4) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  std::normal_distribution<float> normal;
  RawSplats splats;
  splats.sh_degree = 1;
  splats.resize(count);
  for (float& value : splats.positions) value = 2 * unit(random) - 1;
  for (float& value : splats.rotations) value = normal(random);
  for (float& value : splats.log_scales) value = -5 + 2 * unit(random);
  for (float& value : splats.logits)
    value = least_logit + (most_logit - least_logit) * unit(random);
  for (float& value : splats.sh) value = normal(random);
  return splats;
}

/// Moments that are told apart: [row, number] each of its own.
inline RawSplats countedMoments(const RawSplats& splats) {
  RawSplats moments = zerosLike(splats);
  for (size_t i = 0; i < arrayCount(moments); ++i) {
    std::vector<float>& values = arrayOf(moments, static_cast<RawArray>(i));
    for (size_t k = 0; k < values.size(); ++k) values[k] = 1 + static_cast<float>(k);
  }
  return moments;
}

/// Splats, and moments that moved with them.
struct Edited {
  RawSplats splats;
  RawSplats moments;
};
inline Edited moved(const SplatEdit& edit, const RawSplats& splats) {
  validate(edit, splats);
  Edited now{splats, countedMoments(splats)};
  const EditTarget targets[] = {{&now.splats, false}, {&now.moments, true}};
  applyEdit(edit, targets);
  return now;
}

inline bool areSame(const RawSplats& a, const RawSplats& b) {
  if (arrayCount(a) != arrayCount(b)) return false;
  for (size_t i = 0; i < arrayCount(a); ++i) {
    if (arrayOf(a, static_cast<RawArray>(i)) != arrayOf(b, static_cast<RawArray>(i))) return false;
  }
  return true;
}

inline double opacityOf(float logit) {
  return 1 / (1 + std::exp(-static_cast<double>(logit)));
}

}  // namespace stipple::testing
