#include "decode/tree/moving_cost.h"

// Lanes along the times. No product and sum are fused, so every target gives the bits of the plain
// kernel: a tree does not depend on the processor that it was built on.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "decode/tree/moving_cost.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <limits>
#include <numbers>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

#include "decode/tree/merge_lanes-inl.h"
#include "decode/tree/merge_steps-inl.h"
#include "decode/tree/moving_steps-inl.h"

HWY_FLATTEN void costsOfLanes(const MovingNodeRows& rows, uint32_t slot, const uint32_t* others,
                              size_t count, float* costs) {
  costsOverTime<CostLanes>(rows, slot, others, count, costs);
}

HWY_FLATTEN void mergeRowsOfLanes(const MovingNodeRows& rows, uint32_t a, uint32_t b,
                                  const double* means, MovingMerge& merged) {
  mergeRowsOverTime<CostLanes>(rows, a, b, means, merged);
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
MovingMergeKernel namedMovingMergeKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), costsOfLanes,
          mergeRowsOfLanes};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedMovingMergeKernel);

std::vector<MovingMergeKernel> movingMergeKernels() {
  return onEveryTarget(scalarMovingMergeKernel(),
                       [] { return HWY_DYNAMIC_DISPATCH(namedMovingMergeKernel)(); });
}

MovingMergeKernel chosenMovingMergeKernel() {
  static const MovingMergeKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedMovingMergeKernel)(), movingMergeKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
