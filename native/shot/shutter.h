#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "splat/render/render.h"

namespace stipple {

/// What moves and changes while the shutter is open, in steps spread evenly over that time; the
/// first is its begin and the last its end. Between steps: math/moving_frame.h for matrices,
/// data/clouds/cloud_blend.h for splats.
struct Shutter {
  uint32_t step_count = 0;       ///< 0: nothing moves; else 2 or more
  std::vector<Mat4d> camera;     ///< [steps] world to camera; empty: it stands still
  std::vector<Mat4d> instances;  ///< [steps][instances] object to world; empty: they stand still
  /// How far open it is, 0 or more, at moments spread evenly over the time, straight in between.
  /// Empty: always the same.
  std::vector<double> curve = {};
  /// [steps][instances] the splats of each in its own space, in the same rows at every step; null:
  /// the instance's own. Empty: they stay as they are.
  std::vector<std::shared_ptr<const SplatCloud>> clouds = {};
};

constexpr uint32_t kMaxShutterSteps = 1025;  ///< what Blender has at most, twice

/// Refuses a number of steps outside its range, matrices that cannot place, steps that do not fit
/// the instances, and clouds of other counts, degrees, colour spaces or low-passes than the
/// instance's own. Values of splats are not read. Errors: kInvalidArgument.
void validate(const Shutter& shutter, std::span<const SplatInstance> instances);

}  // namespace stipple
