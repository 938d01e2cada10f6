#include "train/optimiser/adam_kernel.h"

// The steps of adam_kernel_scalar.cpp with lanes along the elements; products and sums are fused
// where the processor can, so targets differ by rounding.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "train/optimiser/adam_kernel_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;

HWY_INLINE Vec withoutDenormals(Tag d, Vec moment) {
  return hn::IfThenZeroElse(hn::Lt(hn::Abs(moment), hn::Set(d, kSmallestMoment)), moment);
}

/// One vector of elements; `usable` gets the lanes whose gradient could be used. Others keep what
/// they had.
HWY_INLINE void stepLanes(Tag d, const AdamFactors& factors, Vec& p, Vec g, Vec& m, Vec& v,
                          hn::Mask<Tag>& unusable) {
  const hn::RebindToSigned<Tag> di;
  // As integers: comparing a NaN as a number would trap.
  const auto beyond = hn::RebindMask(
      d, hn::Gt(hn::BitCast(di, hn::Abs(g)), hn::BitCast(di, hn::Set(d, kLargestGradient))));
  unusable = hn::Or(unusable, beyond);
  g = hn::IfThenZeroElse(beyond, g);
  Vec next_m = hn::MulAdd(hn::Set(d, factors.first_share), hn::Sub(g, m), m);
  Vec next_v = hn::MulAdd(hn::Set(d, factors.second_share), hn::Sub(hn::Mul(g, g), v), v);
  next_m = withoutDenormals(d, next_m);
  next_v = withoutDenormals(d, next_v);
  const Vec root = hn::MulAdd(hn::Sqrt(next_v), hn::Set(d, factors.inverse_root_second),
                              hn::Set(d, factors.epsilon));
  const Vec next_p = hn::NegMulAdd(hn::Set(d, factors.rate), hn::Div(next_m, root), p);
  p = hn::IfThenElse(beyond, p, next_p);
  m = hn::IfThenElse(beyond, m, next_m);
  v = hn::IfThenElse(beyond, v, next_v);
}

/// The last elements, fewer than a vector. Short runs of visible rows consist of little else.
HWY_INLINE void stepTail(Tag d, const AdamFactors& factors, size_t count, float* parameters,
                         const float* gradients, float* first_moments, float* second_moments,
                         hn::Mask<Tag>& unusable) {
#if HWY_MEM_OPS_MIGHT_FAULT
  HWY_ALIGN float buffer[4][hn::MaxLanes(d)] = {};
  for (size_t k = 0; k < count; ++k) {
    buffer[0][k] = parameters[k];
    buffer[1][k] = gradients[k];
    buffer[2][k] = first_moments[k];
    buffer[3][k] = second_moments[k];
  }
  Vec p = hn::Load(d, buffer[0]);
  Vec m = hn::Load(d, buffer[2]);
  Vec v = hn::Load(d, buffer[3]);
  stepLanes(d, factors, p, hn::Load(d, buffer[1]), m, v, unusable);
  hn::Store(p, d, buffer[0]);
  hn::Store(m, d, buffer[2]);
  hn::Store(v, d, buffer[3]);
  for (size_t k = 0; k < count; ++k) {
    parameters[k] = buffer[0][k];
    first_moments[k] = buffer[2][k];
    second_moments[k] = buffer[3][k];
  }
#else
  const auto live = hn::FirstN(d, count);
  Vec p = hn::MaskedLoad(live, d, parameters);
  Vec m = hn::MaskedLoad(live, d, first_moments);
  Vec v = hn::MaskedLoad(live, d, second_moments);
  stepLanes(d, factors, p, hn::MaskedLoad(live, d, gradients), m, v, unusable);
  hn::BlendedStore(p, live, d, parameters);
  hn::BlendedStore(m, live, d, first_moments);
  hn::BlendedStore(v, live, d, second_moments);
#endif
}

bool stepVector(const AdamFactors& factors, size_t count, float* parameters, const float* gradients,
                float* first_moments, float* second_moments) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  auto unusable = hn::MaskFromVec(hn::Zero(d));
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    Vec p = hn::LoadU(d, parameters + i);
    Vec m = hn::LoadU(d, first_moments + i);
    Vec v = hn::LoadU(d, second_moments + i);
    stepLanes(d, factors, p, hn::LoadU(d, gradients + i), m, v, unusable);
    hn::StoreU(p, d, parameters + i);
    hn::StoreU(m, d, first_moments + i);
    hn::StoreU(v, d, second_moments + i);
  }
  if (i < count)
    stepTail(d, factors, count - i, parameters + i, gradients + i, first_moments + i,
             second_moments + i, unusable);
  return hn::AllFalse(d, unusable);
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
AdamKernel namedAdamKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), stepVector};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedAdamKernel);

std::vector<AdamKernel> adamKernels() {
  return onEveryTarget(scalarAdamKernel(), [] { return HWY_DYNAMIC_DISPATCH(namedAdamKernel)(); });
}

AdamKernel chosenAdamKernel() {
  static const AdamKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedAdamKernel)(), adamKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
