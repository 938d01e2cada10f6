#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "densify/control_part.h"

namespace stipple {

/// What each of several equal splats at one place must be, to look together as one did.
struct RelocationShare {
  double opacity = 0;
  double logit = 0;
  double log_shrink = 0;  ///< natural logarithm of their scale over the scale of the one
};

/// In: logit of the one; count >= 1 splats that stand for it, of any number. A splat of opacity o
/// becomes `count` of 1 - (1 - o)^(1/count), so that their composite over the centre is o, of the
/// scale at which the integral of a composited slice is that of the one.
/// Cost: 33 exponentials and logarithms; error of the scale below 1e-11.
/// Source: Kheradmand, Rebain, Sharma, Sun, Tseng, Isack, Kar, Tagliasacchi, Yi, 3D Gaussian
/// Splatting as Markov Chain Monte Carlo, NeurIPS 2024, section 3.3.
RelocationShare relocationShare(float logit, uint64_t count);

/// Splats of a fit while some of them move to where others are; nothing is copied before write().
class RelocatedSplats {
 public:
  /// In: splats outlive this.
  explicit RelocatedSplats(const RawSplats& splats);

  /// Splats that are at most this opaque become copies of others, drawn by opacity with
  /// replacement. None where no splat is more opaque.
  void moveDead(const FitMoment& moment, double dead_opacity);

  /// Appends copies of `count` splats that are drawn by opacity with replacement.
  void appendCopies(const FitMoment& moment, size_t count, RawSplats& append);

  /// The row whose place, turn and colour it has.
  size_t origin(size_t row) const { return origins_[row]; }
  /// As they are now.
  float logit(size_t row) const { return logits_[row]; }
  const float* position(size_t row) const { return &splats_.positions[origins_[row] * 3]; }
  const float* rotation(size_t row) const { return &splats_.rotations[origins_[row] * 4]; }
  const float* logScales(size_t row) const { return &log_scales_[row * 3]; }
  RawSplats rowsOf(const std::vector<uint32_t>& rows) const;

  /// [N] how often each splat was drawn.
  const std::vector<uint32_t>& drawCounts() const { return draw_counts_; }

  /// Writes everything that has changed. Moments of splats that were drawn are forgotten; those of
  /// splats that have moved stay.
  void write(SplatEdit& edit) const;

 private:
  void shareOut(const std::vector<uint32_t>& drawn);

  const RawSplats& splats_;
  std::vector<uint32_t> origins_;  ///< [N] rows whose place, turn and colour they have
  std::vector<float> logits_;      ///< [N]
  std::vector<float> log_scales_;  ///< [N,3]
  std::vector<uint32_t> draw_counts_;
  std::vector<uint8_t> has_moved_;  ///< [N]
};

}  // namespace stipple
