// Vectors of doubles for merges, without fused operations. Included inside the namespace of a
// Highway target.

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<double, 8>;
using IndexTag = hn::RebindToSigned<Tag>;

/// A vector that looks like a number to merge_steps-inl.h and moving_steps-inl.h.
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

constexpr size_t kLanes = hn::MaxLanes(Tag());

template <class T>
HWY_INLINE CostLanes loadLanes(const float* values) {
  return CostLanes(hn::PromoteTo(Tag(), hn::LoadU(hn::Rebind<float, Tag>(), values)));
}
template <class T>
HWY_INLINE CostLanes loadLanes(const double* values) {
  return CostLanes(hn::LoadU(Tag(), values));
}
HWY_INLINE void storeLanes(CostLanes lanes, double* values) {
  hn::StoreU(lanes.v, Tag(), values);
}

HWY_INLINE CostLanes wholeLogarithm(CostLanes x) {
  const IndexTag di;
  const auto exponent = hn::ShiftRight<52>(hn::BitCast(di, x.v));
  return CostLanes(hn::ConvertTo(Tag(), hn::Sub(exponent, hn::Set(di, 1023))));
}
HWY_INLINE CostLanes mantissa(CostLanes x) {
  const hn::RebindToUnsigned<Tag> du;
  const auto digits = hn::And(hn::BitCast(du, x.v), hn::Set(du, kMantissaBits));
  return CostLanes(hn::BitCast(Tag(), hn::Or(digits, hn::Set(du, kBitsOfOne))));
}
