#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "motion/motion_kernel.h"

namespace stipple {

/// The clip that splats move in: frame_count frames from `begin` on.
struct MotionClip {
  double begin = 0;  ///< seconds
  double frames_per_second = 24;
  uint32_t frame_count = 1;
  double window_frames = kWindowFrames;  ///< as of timeWindow()
  double window_share = kWindowShare;

  /// Seconds of the last frame.
  double end() const { return begin + (frame_count - 1) / frames_per_second; }
  /// A time as a part of the clip: 0 at the first frame, 1 - 1/frame_count at the last; times
  /// beyond are those.
  double partOf(double seconds) const;
  TimeWindow window() const { return timeWindow(frame_count, window_frames, window_share); }
};

/// Splats that move, as a structure of arrays: MovingSplat says what the numbers mean. Scales and
/// harmonics are the same at all times.
struct MotionCloud {
  SplatCloud splats;  ///< places about which they move; rotations at their moments; opacities there
  std::array<std::vector<float>, kMotionWaves> waves;  ///< [N,3] metres each
  std::vector<float> phases;                           ///< [N,4] radians
  std::vector<float> spins;                            ///< [N,4]
  std::vector<float> lifespans;                        ///< [N,2]
  std::vector<float> centres;                          ///< [N] 0..1, parts of the clip
  MotionClip clip;

  size_t size() const { return splats.size(); }
  MotionColumns<const float> columns() const;
};

/// Refuses what validate() refuses in a cloud, clips without frames, and motion that is not finite
/// or outside of its bounds. `what` names it. Errors: kInvalidArgument.
void validate(const MotionCloud& moving, const char* what);

/// What moves, at a time, into columns [N]; every other column of the cloud is its own at all
/// times. Threads and determinism: parallel; same result for any number of threads.
void momentsAt(const MotionCloud& moving, double seconds, const MomentColumns<float>& moments);

/// The splats whose mask is not 0, bit for bit and in their order, in the same clip. In: mask [N].
/// Errors: kInvalidArgument for a mask of another length.
MotionCloud kept(const MotionCloud& moving, std::span<const uint8_t> mask);

/// The cloud at a time.
SplatCloud splatsAt(const MotionCloud& moving, double seconds);

}  // namespace stipple
