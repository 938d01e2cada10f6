#pragma once

#include <vector>

#include "densify/strategy.h"

namespace stipple {

/// Scales that are tied to how close splats stand: s_a = R sigmoid(u_a), R = exp(extra 0), u =
/// extra 1 [3]. Stored log-scales do not count; whoever uses this writes them at events, for those
/// who look.
class DensityScale final : public Parameterisation {
 public:
  /// Both learn as log-scales do.
  static std::vector<ExtraParameter> parameters();
  /// So that every scale is what it was: R is twice the largest scale of a splat.
  static std::vector<std::vector<float>> initialExtras(const RawSplats& splats);
  /// ln s_a.
  static float logScale(const RawSplats& splats, size_t row, size_t axis);

  void activate(const RawSplats& raw, SplatCloud& cloud) const override;
  void adjoint(const RawSplats& raw, const SplatCloud& cloud, const CloudGradient& by_cloud,
               RawSplats& by_raw) const override;
};

}  // namespace stipple
