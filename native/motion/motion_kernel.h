#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "motion/moving_splat.h"

namespace stipple {

/// Columns of splats that move, as of MovingSplat. Float: const float for splats that are given,
/// float for derivatives; those have no centres (null).
template <class Float>
struct MotionColumns {
  Float* positions = nullptr;                ///< [N,3]
  Float* rotations = nullptr;                ///< [N,4]
  Float* opacities = nullptr;                ///< [N]
  std::array<Float*, kMotionWaves> waves{};  ///< [N,3] each
  Float* phases = nullptr;                   ///< [N,4]
  Float* spins = nullptr;                    ///< [N,4]
  Float* lifespans = nullptr;                ///< [N,2]
  Float* centres = nullptr;                  ///< [N]
};

/// Columns of the same splats at one time, or of derivatives by these.
template <class Float>
struct MomentColumns {
  Float* positions = nullptr;  ///< [N,3]
  Float* rotations = nullptr;  ///< [N,4]
  Float* opacities = nullptr;  ///< [N]
};

struct MotionKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")
  /// momentOf() of rows [begin, end).
  void (*moments)(const MotionColumns<const float>& splats, const TimeWindow& window, float time,
                  size_t begin, size_t end, const MomentColumns<float>& moments);
  /// momentGradient() of rows [begin, end); writes all columns that `by_splats` has.
  void (*gradients)(const MotionColumns<const float>& splats, const TimeWindow& window, float time,
                    size_t begin, size_t end, const MomentColumns<const float>& by_moments,
                    const MotionColumns<float>& by_splats);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
MotionKernel chosenMotionKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<MotionKernel> motionKernels();

MotionKernel scalarMotionKernel();

}  // namespace stipple
