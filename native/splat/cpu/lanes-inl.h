// Lane code that the projector and its backward share. Included once per target, hence the guard
// that switches.

#if defined(STIPPLE_SPLAT_CPU_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef STIPPLE_SPLAT_CPU_LANES_INL_H_
#undef STIPPLE_SPLAT_CPU_LANES_INL_H_
#else
#define STIPPLE_SPLAT_CPU_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// A vector that looks like a number to the templates of projection.h and spherical_harmonics.h.
template <class D>
struct Lanes {
  using Scalar = hn::TFromD<D>;
  hn::Vec<D> v;

  Lanes() : v(hn::Zero(D())) {}
  explicit Lanes(hn::Vec<D> vector) : v(vector) {}
  explicit Lanes(double value) : v(hn::Set(D(), static_cast<Scalar>(value))) {}

  friend HWY_INLINE Lanes operator+(Lanes a, Lanes b) { return Lanes(hn::Add(a.v, b.v)); }
  friend HWY_INLINE Lanes operator-(Lanes a, Lanes b) { return Lanes(hn::Sub(a.v, b.v)); }
  friend HWY_INLINE Lanes operator*(Lanes a, Lanes b) { return Lanes(hn::Mul(a.v, b.v)); }
  friend HWY_INLINE Lanes operator/(Lanes a, Lanes b) { return Lanes(hn::Div(a.v, b.v)); }
  friend HWY_INLINE Lanes operator-(Lanes a) { return Lanes(hn::Neg(a.v)); }
  friend HWY_INLINE auto operator>(Lanes a, Lanes b) { return hn::Gt(a.v, b.v); }
  friend HWY_INLINE auto operator>=(Lanes a, Lanes b) { return hn::Ge(a.v, b.v); }
  friend HWY_INLINE Lanes sqrt(Lanes a) { return Lanes(hn::Sqrt(a.v)); }
  friend HWY_INLINE Lanes abs(Lanes a) { return Lanes(hn::Abs(a.v)); }
  friend HWY_INLINE Lanes min(Lanes a, Lanes b) { return Lanes(hn::Min(a.v, b.v)); }
  friend HWY_INLINE Lanes max(Lanes a, Lanes b) { return Lanes(hn::Max(a.v, b.v)); }
  friend HWY_INLINE Lanes log(Lanes a) { return Lanes(hn::Log(D(), a.v)); }
  friend HWY_INLINE Lanes pick(hn::Mask<D> mask, Lanes yes, Lanes no) {
    return Lanes(hn::IfThenElse(mask, yes.v, no.v));
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#endif
