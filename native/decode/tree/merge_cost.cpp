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

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<double>;
using IndexTag = hn::RebindToSigned<Tag>;

/// A vector that looks like a number to merge_steps-inl.h.
struct CostLanes {
  hn::Vec<Tag> v;

  CostLanes() : v(hn::Zero(Tag())) {}
  explicit CostLanes(hn::Vec<Tag> vector) : v(vector) {}
  explicit CostLanes(double value) : v(hn::Set(Tag(), value)) {}

  friend HWY_INLINE CostLanes operator+(CostLanes a, CostLanes b) {
    return CostLanes(hn::Add(a.v, b.v));
  }
  friend HWY_INLINE CostLanes operator-(CostLanes a, CostLanes b) {
    return CostLanes(hn::Sub(a.v, b.v));
  }
  friend HWY_INLINE CostLanes operator*(CostLanes a, CostLanes b) {
    return CostLanes(hn::Mul(a.v, b.v));
  }
  friend HWY_INLINE CostLanes operator/(CostLanes a, CostLanes b) {
    return CostLanes(hn::Div(a.v, b.v));
  }
  friend HWY_INLINE auto operator>(CostLanes a, CostLanes b) { return hn::Gt(a.v, b.v); }
};

HWY_INLINE CostLanes sqrt(CostLanes a) {
  return CostLanes(hn::Sqrt(a.v));
}
HWY_INLINE CostLanes min(CostLanes a, CostLanes b) {
  return CostLanes(hn::Min(a.v, b.v));
}
HWY_INLINE CostLanes max(CostLanes a, CostLanes b) {
  return CostLanes(hn::Max(a.v, b.v));
}
HWY_INLINE CostLanes pick(hn::Mask<Tag> condition, CostLanes yes, CostLanes no) {
  return CostLanes(hn::IfThenElse(condition, yes.v, no.v));
}
HWY_INLINE CostLanes wholePart(CostLanes a) {
  return CostLanes(hn::Floor(a.v));
}

HWY_INLINE CostLanes powerOfTwo(CostLanes n) {
  const IndexTag di;
  const auto exponent = hn::Add(hn::ConvertTo(di, n.v), hn::Set(di, 1023));
  return CostLanes(hn::BitCast(Tag(), hn::ShiftLeft<52>(exponent)));
}

HWY_INLINE CostLanes rootGuess(CostLanes x) {
  const hn::RebindToUnsigned<Tag> du;
  const auto bits = hn::BitCast(du, x.v);
  return CostLanes(hn::BitCast(Tag(), hn::Sub(hn::Set(du, kRootGuess), hn::ShiftRight<1>(bits))));
}

HWY_INLINE void opacityEnds(CostLanes piece, CostLanes* ends) {
  const Tag d;
  const IndexTag di;
  const double* table = opacityTable().ends.data();
  const auto first = hn::ShiftLeft<1>(hn::ConvertTo(di, piece.v));
  for (int k = 0; k < 4; ++k) {
    ends[k] = CostLanes(hn::GatherIndex(d, table + k, first));
  }
}

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
