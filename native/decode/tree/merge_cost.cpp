#include "decode/tree/merge_cost.h"

// Lanes along the other nodes. No product and sum are fused, so every target gives the bits of the
// plain kernel: a tree does not depend on the processor that it was built on.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "decode/tree/merge_cost.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

#include "decode/tree/merge_lanes-inl.h"
#include "decode/tree/merge_steps-inl.h"

/// Field by field: lane i is that of the node whose first double is number rows[i] of `values`.
template <class Load>
HWY_INLINE void fillNode(const Load& load, MergeValues<CostLanes>& node) {
  // The fields of MergeValues in order.
  size_t field = 0;
  for (CostLanes& x : node.mean) x = load(field++);
  for (CostLanes& x : node.colour) x = load(field++);
  node.opacity = load(field++);
  ++field;  // no cost needs the area
  for (CostLanes& x : node.covariance) x = load(field++);
  for (CostLanes& x : node.plane_size) x = load(field++);
  node.visibility = load(field++);
  node.contrast = load(field++);
  node.weight = load(field++);
  node.depth = load(field++);
  node.inflation = load(field++);
  node.leaf_area = load(field++);
  for (CostLanes& x : node.around) x = load(field++);
}

HWY_FLATTEN void costsOfLanes(const MergeNode* nodes, uint32_t slot, const uint32_t* others,
                              size_t count, const MergeScale& scale, float* costs) {
  const Tag d;
  const IndexTag di;
  constexpr size_t kRow = sizeof(MergeNode) / sizeof(double);
  const double* values = nodes->mean.data();
  const double* own = values + slot * kRow;
  MergeValues<CostLanes> a, b, merged;
  fillNode([&](size_t field) { return CostLanes(own[field]); }, a);
  const CostLanes footprint(scale.footprint);
  const hn::Rebind<float, Tag> df;
  const size_t lanes = hn::Lanes(d);
  HWY_ALIGN int64_t rows[hn::MaxLanes(d)];
  HWY_ALIGN float out[hn::MaxLanes(df)];
  for (size_t first = 0; first < count; first += lanes) {
    const size_t live = count - first < lanes ? count - first : lanes;
    // Lanes beyond the last node repeat it.
    for (size_t k = 0; k < lanes; ++k) {
      rows[k] = static_cast<int64_t>(others[first + (k < live ? k : live - 1)] * kRow);
    }
    const auto index = hn::Load(di, rows);
    fillNode([&](size_t field) { return CostLanes(hn::GatherIndex(d, values + field, index)); }, b);
    mergeMoments(a, b, footprint, merged);
    const CostLanes error = errorOfMerge(a, b, merged, footprint);
    const CostLanes largest(static_cast<double>(hwy::HighestValue<float>()));
    hn::Store(hn::DemoteTo(df, min(error, largest).v), df, out);
    for (size_t k = 0; k < live; ++k) costs[first + k] = out[k];
  }
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
MergeCostKernel namedMergeCostKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), costsOfLanes};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <algorithm>
#include <limits>

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedMergeCostKernel);

namespace {

void costsOneByOne(const MergeNode* nodes, uint32_t slot, const uint32_t* others, size_t count,
                   const MergeScale& scale, float* costs) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  for (size_t i = 0; i < count; ++i) {
    const MergeNode& other = nodes[others[i]];
    const MergeNode merged = mergedNode(nodes[slot], other, scale);
    costs[i] =
        static_cast<float>(std::min(mergeError(nodes[slot], other, merged, scale), kLargest));
  }
}

}  // namespace

std::vector<MergeCostKernel> mergeCostKernels() {
  return onEveryTarget(MergeCostKernel{"scalar", costsOneByOne},
                       [] { return HWY_DYNAMIC_DISPATCH(namedMergeCostKernel)(); });
}

MergeCostKernel chosenMergeCostKernel() {
  static const MergeCostKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedMergeCostKernel)(), mergeCostKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
