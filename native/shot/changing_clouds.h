#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "shot/shutter.h"

namespace stipple {

/// The splats of instances that change while the shutter is open, at any moment. Instances with the
/// same clouds at every step share what is made of them.
class ChangingClouds {
 public:
  /// In: what validate(Shutter) accepts; both must outlive this.
  ChangingClouds(std::span<const SplatInstance> instances, const Shutter& shutter);

  /// Refuses values that are none of splats, at any step, and names the first. Cost: every splat of
  /// every step is read once; no picture has to check it again.
  /// Errors: those of validate(SplatCloud).
  void validateValues() const;

  /// Puts the clouds of a moment in place: that of a step, where it is one or those around it are
  /// one, else what blendClouds makes of the two. Valid until the next call; what instances do not
  /// change keeps its own. In: time 0..1; instances as given at the beginning.
  void placeAt(double time, std::span<SplatInstance> instances);

  /// Where one splat of an instance is at a moment, metres in the instance's own space.
  Vec3d positionAt(size_t instance, size_t row, double time) const;

  /// Bytes that placeAt() takes at most, beside the steps.
  static uint64_t memoryBound(std::span<const SplatInstance> instances, const Shutter& shutter);

 private:
  struct Track {
    std::vector<const SplatCloud*> steps;
    size_t instance = 0;  ///< the first that it is of
    SplatCloud between;
  };
  /// A moment as a share of the way from one step to the next.
  struct Place {
    size_t step;
    double share;  ///< 0: at the step, which may be the last
  };
  static Place placeOf(double time, size_t step_count);

  std::span<const SplatInstance> own_;
  std::vector<Track> tracks_;
  std::vector<size_t> track_of_;  ///< [instances] kNone: the splats stay; or empty: all do
};

}  // namespace stipple
