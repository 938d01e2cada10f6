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

constexpr size_t kRow = sizeof(MergeNode) / sizeof(double);

/// Field by field from several nodes, one in each lane.
class NodeColumns {
 public:
  /// rows [lanes]: the node of lane i begins with number rows[i] of `values`.
  HWY_INLINE void turn(const double* values, const int64_t* rows) {
    if constexpr (kTurns) {
      const Tag d;
      constexpr size_t kBlock = hn::MaxLanes(Tag());
      for (size_t group = 0; group < kGroups; ++group) {
        const double* row[4];
        for (size_t k = 0; k < 4; ++k) row[k] = values + rows[4 * group + k];
        double* out = columns_ + group * 4 * kRow;
        for (size_t field = 0; field < kRow; field += kBlock) {
          hn::StoreInterleaved4(hn::Load(d, row[0] + field), hn::Load(d, row[1] + field),
                                hn::Load(d, row[2] + field), hn::Load(d, row[3] + field), d,
                                out + 4 * field);
        }
      }
    } else {
      values_ = values;
      rows_ = rows;
    }
  }

  HWY_INLINE CostLanes operator()(size_t field) const {
    const Tag d;
    if constexpr (kTurns) {
#if HWY_TARGET != HWY_SCALAR
      if constexpr (kGroups == 2) {
        const hn::Half<Tag> dh;
        return CostLanes(hn::Combine(d, hn::Load(dh, columns_ + 4 * (kRow + field)),
                                     hn::Load(dh, columns_ + 4 * field)));
      }
#endif
      return CostLanes(hn::Load(d, columns_ + 4 * field));
    } else {
      return CostLanes(hn::GatherIndex(d, values_ + field, hn::Load(IndexTag(), rows_)));
    }
  }

 private:
  /// Whole vectors of each node, turned four nodes at a time, take half as long as gathers.
  static constexpr bool kTurns = !HWY_HAVE_SCALABLE && hn::MaxLanes(Tag()) >= 4;
  static constexpr size_t kGroups = kTurns ? hn::MaxLanes(Tag()) / 4 : 1;
  HWY_ALIGN double columns_[kTurns ? kGroups * 4 * kRow : 1];  ///< [groups][fields][4 nodes]
  const double* values_ = nullptr;
  const int64_t* rows_ = nullptr;
};

/// Load: gives the lanes of a field, by its number.
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
  const double* values = nodes->mean.data();
  const double* own = values + slot * kRow;
  MergeValues<CostLanes> a, b, merged;
  fillNode([&](size_t field) { return CostLanes(own[field]); }, a);
  const CostLanes footprint(scale.footprint);
  const hn::Rebind<float, Tag> df;
  const size_t lanes = hn::Lanes(d);
  HWY_ALIGN int64_t rows[hn::MaxLanes(d)];
  HWY_ALIGN float out[hn::MaxLanes(df)];
  NodeColumns columns;
  for (size_t first = 0; first < count; first += lanes) {
    const size_t live = count - first < lanes ? count - first : lanes;
    // Lanes beyond the last node repeat it.
    for (size_t k = 0; k < lanes; ++k) {
      rows[k] = static_cast<int64_t>(others[first + (k < live ? k : live - 1)] * kRow);
    }
    columns.turn(values, rows);
    fillNode(columns, b);
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
