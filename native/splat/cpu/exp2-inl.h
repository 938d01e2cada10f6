// Lane code that the forward and the backward kernel share: both must give the same alpha, bit for
// bit. Included once per target, hence the guard that switches.

#if defined(STIPPLE_SPLAT_CPU_EXP2_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef STIPPLE_SPLAT_CPU_EXP2_INL_H_
#undef STIPPLE_SPLAT_CPU_EXP2_INL_H_
#else
#define STIPPLE_SPLAT_CPU_EXP2_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

/// 2^x for x in -120..1, relative error below 3e-7: 2^f by its Taylor polynomial of degree 6 for
/// |f| <= 1/2 (remainder (f ln 2)^7/7! = 1.2e-7), then f's whole part added to the exponent.
template <class Tag, class Vec = hwy::HWY_NAMESPACE::Vec<Tag>>
HWY_INLINE Vec exp2Small(Tag d, Vec x) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::RebindToSigned<Tag> di;
  const auto whole = hn::NearestInt(x);
  const Vec f = hn::Sub(x, hn::ConvertTo(d, whole));
  Vec p = hn::Set(d, 1.5403530393381610e-4f);
  p = hn::MulAdd(p, f, hn::Set(d, 1.3333558146428443e-3f));
  p = hn::MulAdd(p, f, hn::Set(d, 9.6181291076284772e-3f));
  p = hn::MulAdd(p, f, hn::Set(d, 5.5504108664821580e-2f));
  p = hn::MulAdd(p, f, hn::Set(d, 2.4022650695910072e-1f));
  p = hn::MulAdd(p, f, hn::Set(d, 6.9314718055994531e-1f));
  p = hn::MulAdd(p, f, hn::Set(d, 1.0f));
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(whole)));
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#endif
