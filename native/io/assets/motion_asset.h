#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "io/assets/asset_header.h"

namespace stipple {

/// The stored numbers of splats that move (motion/motion_cloud.h says what they mean): io knows
/// arrays, not algorithms.
struct MotionTensors {
  /// Cosines of the first harmonic, sines of the first, cosines of the second and so on.
  static constexpr size_t kWaves = 8;

  SplatCloud splats;                               ///< [N] what does not change with time
  std::array<std::vector<float>, kWaves> waves{};  ///< [N,3] metres each
  std::vector<float> phases;                       ///< [N,4] radians
  std::vector<float> spins;                        ///< [N,4]
  std::vector<float> lifespans;                    ///< [N,2] above 0
  std::vector<float> centres;                      ///< [N] 0..1, parts of the clip
};

/// The splats, their clip, and where they have one the tree of their merges.
struct MotionAsset : MotionTensors {
  double begin = 0;  ///< seconds of the first frame
  double frames_per_second = 24;
  uint32_t frame_count = 1;
  double window_frames = 0;  ///< of stretched time; 0: it is not stretched
  double window_share = 0.7;
  MotionTensors nodes;               ///< [N-1] inner nodes in the order in which they are split
  std::vector<uint32_t> parents;     ///< [2N-1] as of HierarchyAsset; none: there is no tree
  std::vector<float> errors;         ///< [N-1]
  std::string settings_json = "{}";  ///< free for the caller (how the splats were made)
  AssetExtras extras;                ///< of the file that it was read from
};

/// `.stipple.safetensors`, version 1, kind "motion". The settings of the file also have the time
/// from the first to the last frame, as those of every asset that moves (asset_time.h). Bounds of
/// single numbers are the caller's to check: these functions hold sizes and finite numbers.
/// Errors: kIo, kFormat, kUnsupported (newer major version, other kind).
void writeMotionAsset(const MotionAsset& asset, const std::string& path);
MotionAsset readMotionAsset(const std::string& path);

}  // namespace stipple
