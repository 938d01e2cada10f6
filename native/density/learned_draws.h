#pragma once

#include <cstdint>

#include "density/anchor_sampling.h"

namespace stipple {

class LearnedDensity;

/// How the anchors of a learned field are drawn, in its fit and wherever it is decoded.
struct LearnedDraws {
  bool jitter = true;   ///< anchors anywhere in their leaf; else in its middle
  bool nested = false;  ///< always in the progressive order; else as the caller asks for
  uint64_t seed = 0;    ///< nested: added to the caller's, so that its 0 gives the fit's own draws
};

/// sampleAnchors as the field has learned to expect it. Errors and cost: those of sampleAnchors.
AnchorSet drawLearned(const DensityModel& density, AnchorSamplingOptions options,
                      const LearnedDraws& draws, Progress* progress = nullptr);

/// The anchors that decoding draws from a density as it is now, as leaves of the density itself.
/// Errors and cost: those of sampleAnchors.
AnchorSet drawSettled(const LearnedDensity& density, const AnchorSamplingOptions& options,
                      const LearnedDraws& draws);

}  // namespace stipple
