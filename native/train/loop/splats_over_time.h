#pragma once

#include <functional>
#include <optional>
#include <utility>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// The splats of a fit at the times of views: made when they are asked for, and anew only where
/// another time means other splats.
class SplatsOverTime {
 public:
  /// In: make: gives them as they are at a time, seconds; moves: false where that is the same at
  /// all times.
  SplatsOverTime(std::function<SplatCloud(double)> make, bool moves)
      : make_(std::move(make)), moves_(moves) {}
  /// Of a cloud that stands still, which must outlive this.
  explicit SplatsOverTime(const SplatCloud& still) : still_(&still) {}

  /// Valid until the next call.
  const SplatCloud& at(double seconds) {
    if (still_) return *still_;
    if (!made_ || (moves_ && seconds != seconds_)) made_ = make_(seconds);
    seconds_ = seconds;
    return *made_;
  }
  /// The same as last, or at time 0.
  const SplatCloud& latest() { return at(seconds_); }
  /// Call where the splats may have changed.
  void forget() { made_.reset(); }

 private:
  const SplatCloud* still_ = nullptr;
  std::function<SplatCloud(double)> make_;
  bool moves_ = false;
  std::optional<SplatCloud> made_;
  double seconds_ = 0;  ///< of made_
};

}  // namespace stipple
