#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "data/views/view_source.h"
#include "densify/raw_splats.h"
#include "densify/strategy.h"
#include "motion/motion_cloud.h"

namespace stipple {

/// The clip that the times of views tell: from the first to the last, with as many frames as there
/// are times that differ. Errors: kInvalidArgument for views of one time, and for clips that are
/// shorter than a nanosecond or longer than 10^12 s.
MotionClip clipOfViews(const ViewSource& views);

/// How a fit of splats that move gets from raw numbers to splats at one time. Raw splats have the
/// motion as extras (RawSplats::extras): the eight waves [N,3], phases [N,4], spins [N,4], the
/// logarithms of both temporal scales over lifespanUnit() [N,2], and the moments [N], which are not
/// learned. They stand behind the extras of the strategy, whose own way from numbers to splats
/// comes first and gives the splats about which all moves.
class MovingParameterisation final : public Parameterisation {
 public:
  /// In: how: the strategy's own way, or null; it must outlive this. first_extra: number of extras
  /// before those of the motion.
  MovingParameterisation(const MotionClip& clip, const Parameterisation* how, size_t first_extra)
      : clip_(clip), how_(how), first_extra_(first_extra), seconds_(clip.begin) {}

  /// The time of the splats that are made from now on, seconds.
  void setTime(double seconds) { seconds_ = seconds; }
  const MotionClip& clip() const { return clip_; }

  /// Row lengths of the extras, in their order.
  static std::vector<size_t> extraLengths();
  /// Learning rates of the extras. In: position_rate: of this iteration, metres; extent: of the
  /// cameras, metres.
  static std::vector<double> rates(double position_rate, double extent);
  /// The extras of splats that begin to move: they stand still, and their moments are drawn among
  /// every 20th frame and the last one. In: times: empty, or [count] seconds at which a splat's
  /// surface was where it stands, NaN for any: that time is its moment, and it fades to
  /// kVisibleShare until the nearest other of these times on either side.
  std::vector<std::vector<float>> initialExtras(size_t count, uint64_t seed,
                                                std::span<const double> times = {}) const;
  /// The temporal scale of each splat that fades it at the present time, in stretched time. Out:
  /// lifespans [N].
  void lifespansInUse(const RawSplats& raw, std::vector<float>& lifespans) const;
  /// All that raw splats with these extras say.
  MotionCloud cloudOf(const RawSplats& raw) const;

  void activate(const RawSplats& raw, SplatCloud& cloud) const override;
  void adjoint(const RawSplats& raw, const SplatCloud& cloud, const CloudGradient& by_cloud,
               RawSplats& by_raw) const override;

 private:
  void rest(const RawSplats& raw) const;
  MotionColumns<const float> columnsOf(const RawSplats& raw) const;

  MotionClip clip_;
  const Parameterisation* how_;
  size_t first_extra_;
  double seconds_;
  mutable SplatCloud rest_;                ///< before anything moves
  mutable std::vector<float> lifespans_;   ///< [N,2]
  mutable std::vector<float> by_opacity_;  ///< [N] by those of rest_
};

}  // namespace stipple
