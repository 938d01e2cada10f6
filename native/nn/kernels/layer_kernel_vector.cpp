#include <algorithm>
#include <cstring>

#include "nn/kernels/layer_kernel.h"

// Lanes are numbers beside each other. What layer_kernel_scalar.cpp does in double is done in
// float32 by forms that lose nothing where two numbers nearly cancel.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/layer_kernel_vector.cpp"
#include <hwy/foreach_target.h>
// After it, as each target includes the rest anew.
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;

/// 1 / (1 + exp(-z)). exp(-z) stays finite: beyond 87 the logistic is 0 or 1 to float32 but for
/// numbers below the smallest normal one.
HWY_INLINE Vec logisticOf(Tag d, Vec z) {
  const Vec held = hn::Min(hn::Max(z, hn::Set(d, -87.0f)), hn::Set(d, 87.0f));
  const Vec one = hn::Set(d, 1.0f);
  return hn::Div(one, hn::Add(one, hn::Exp(d, hn::Neg(held))));
}

/// Slopes are 0 or 1 to float32 beyond it, and squares of it are far from the greatest float.
HWY_INLINE Vec heldForSlope(Tag d, Vec x) {
  return hn::Min(hn::Max(x, hn::Set(d, -30.0f)), hn::Set(d, 30.0f));
}

struct Silu {
  static HWY_INLINE Vec of(Tag d, Vec x) { return hn::Mul(x, logisticOf(d, x)); }
  static HWY_INLINE Vec slope(Tag d, Vec given) {
    const Vec one = hn::Set(d, 1.0f), x = heldForSlope(d, given), share = logisticOf(d, x);
    return hn::Mul(share, hn::MulAdd(x, hn::Sub(one, share), one));
  }
};

struct Relu {
  static HWY_INLINE Vec of(Tag d, Vec x) { return hn::Max(x, hn::Zero(d)); }
  static HWY_INLINE Vec slope(Tag d, Vec x) {
    return hn::IfThenElseZero(hn::Gt(x, hn::Zero(d)), hn::Set(d, 1.0f));
  }
};

/// (1 + tanh(u)) / 2 is the logistic of 2 u, which has no difference of nearly equal numbers.
struct GeluTanh {
  static HWY_INLINE Vec of(Tag d, Vec x) {
    // 2 sqrt(2 / pi), and that times 0.044715.
    const Vec slope =
        hn::MulAdd(hn::Mul(x, x), hn::Set(d, 0.0713548162726f), hn::Set(d, 1.5957691216057308f));
    return hn::Mul(x, logisticOf(d, hn::Mul(x, slope)));
  }
  static HWY_INLINE Vec slope(Tag d, Vec given) {
    const Vec one = hn::Set(d, 1.0f), x = heldForSlope(d, given), squared = hn::Mul(x, x);
    const Vec first = hn::Set(d, 1.5957691216057308f), third = hn::Set(d, 0.0713548162726f);
    const Vec share = logisticOf(d, hn::Mul(x, hn::MulAdd(squared, third, first)));
    const Vec inner = hn::MulAdd(squared, hn::Mul(hn::Set(d, 3.0f), third), first);
    const Vec bend = hn::Mul(hn::Mul(x, inner), hn::Sub(one, share));
    return hn::Mul(share, hn::Add(one, bend));
  }
};

/// erfc(y) exp(y^2) for y in 0..9.5, by t = 1 / (1 + y / 2): a polynomial with the smallest
/// greatest relative error (4.3e-8; 3e-7 with the rounding of its float32 steps), fitted by
/// weighted least squares whose weights follow the error.
HWY_INLINE Vec scaledErfc(Tag d, Vec y) {
  const Vec one = hn::Set(d, 1.0f);
  const Vec t = hn::Div(one, hn::MulAdd(y, hn::Set(d, 0.5f), one));
  Vec sum = hn::Set(d, -5.889064696e-02f);
  sum = hn::MulAdd(sum, t, hn::Set(d, 2.837013275e-01f));
  sum = hn::MulAdd(sum, t, hn::Set(d, -4.853823570e-01f));
  sum = hn::MulAdd(sum, t, hn::Set(d, 2.759765778e-01f));
  sum = hn::MulAdd(sum, t, hn::Set(d, -2.517657379e-02f));
  sum = hn::MulAdd(sum, t, hn::Set(d, 2.020693558e-01f));
  sum = hn::MulAdd(sum, t, hn::Set(d, 2.432611299e-01f));
  sum = hn::MulAdd(sum, t, hn::Set(d, 2.823534672e-01f));
  sum = hn::MulAdd(sum, t, hn::Set(d, 2.820876774e-01f));
  return hn::Mul(sum, t);
}

/// x erfc(-x / sqrt(2)) / 2: for x > 0 what erfc(x / sqrt(2)) leaves of x.
struct GeluErf {
  static HWY_INLINE Vec of(Tag d, Vec x) {
    // Beyond 13 (9.2 sqrt(2)) erfc is 0 to float32.
    const Vec magnitude = hn::Min(hn::Abs(x), hn::Set(d, 13.0f));
    const Vec y = hn::Mul(magnitude, hn::Set(d, 0.70710678f));
    const Vec fall = hn::Exp(d, hn::Mul(hn::Mul(magnitude, magnitude), hn::Set(d, -0.5f)));
    const Vec tail = hn::Mul(hn::Mul(hn::Set(d, 0.5f), magnitude), hn::Mul(fall, scaledErfc(d, y)));
    return hn::Sub(hn::Max(x, hn::Zero(d)), tail);
  }
  static HWY_INLINE Vec slope(Tag d, Vec given) {
    const Vec one = hn::Set(d, 1.0f),
              x = hn::Min(hn::Max(given, hn::Set(d, -13.0f)), hn::Set(d, 13.0f));
    const Vec magnitude = hn::Abs(x);
    const Vec fall = hn::Exp(d, hn::Mul(hn::Mul(magnitude, magnitude), hn::Set(d, -0.5f)));
    const Vec rest = hn::Mul(hn::Mul(hn::Set(d, 0.5f), fall),
                             scaledErfc(d, hn::Mul(magnitude, hn::Set(d, 0.70710678f))));
    const Vec share = hn::IfThenElse(hn::Gt(x, hn::Zero(d)), hn::Sub(one, rest), rest);
    return hn::MulAdd(hn::Mul(x, fall), hn::Set(d, 0.39894228f), share);
  }
};

/// values[i] = Function(values[i]); what is left of a vector goes through one of its own, so that a
/// number becomes the same wherever it lies.
template <class Function>
void activateAll(size_t count, float* values) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(Function::of(d, hn::LoadU(d, values + i)), d, values + i);
  }
  if (i == count) return;
  HWY_ALIGN float rest[hn::MaxLanes(d)] = {};
  std::copy(values + i, values + count, rest);
  hn::Store(Function::of(d, hn::Load(d, rest)), d, rest);
  std::copy_n(rest, count - i, values + i);
}

void activateVector(Activation activation, size_t count, float* values) {
  switch (activation) {
    case Activation::kSilu:
      return activateAll<Silu>(count, values);
    case Activation::kRelu:
      return activateAll<Relu>(count, values);
    case Activation::kGeluTanh:
      return activateAll<GeluTanh>(count, values);
    case Activation::kGeluErf:
      return activateAll<GeluErf>(count, values);
  }
}

template <class Function>
void scaleBySlopes(size_t count, const float* in, float* gradient) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const Vec slope = Function::slope(d, hn::LoadU(d, in + i));
    hn::StoreU(hn::Mul(slope, hn::LoadU(d, gradient + i)), d, gradient + i);
  }
  if (i == count) return;
  HWY_ALIGN float rest[hn::MaxLanes(d)] = {};
  HWY_ALIGN float factor[hn::MaxLanes(d)] = {};
  std::copy(in + i, in + count, rest);
  std::copy(gradient + i, gradient + count, factor);
  hn::Store(hn::Mul(Function::slope(d, hn::Load(d, rest)), hn::Load(d, factor)), d, rest);
  std::copy_n(rest, count - i, gradient + i);
}

void scaleBySlopeVector(Activation activation, size_t count, const float* in, float* gradient) {
  switch (activation) {
    case Activation::kSilu:
      return scaleBySlopes<Silu>(count, in, gradient);
    case Activation::kRelu:
      return scaleBySlopes<Relu>(count, in, gradient);
    case Activation::kGeluTanh:
      return scaleBySlopes<GeluTanh>(count, in, gradient);
    case Activation::kGeluErf:
      return scaleBySlopes<GeluErf>(count, in, gradient);
  }
}

void siluGateVector(size_t count, const float* gate, const float* up, float* out) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const Vec silu = Silu::of(d, hn::LoadU(d, gate + i));
    hn::StoreU(hn::Mul(silu, hn::LoadU(d, up + i)), d, out + i);
  }
  if (i == count) return;
  HWY_ALIGN float rest[hn::MaxLanes(d)] = {};
  HWY_ALIGN float factor[hn::MaxLanes(d)] = {};
  std::copy(gate + i, gate + count, rest);
  std::copy(up + i, up + count, factor);
  hn::Store(hn::Mul(Silu::of(d, hn::Load(d, rest)), hn::Load(d, factor)), d, rest);
  std::copy_n(rest, count - i, out + i);
}

/// exp(t) for t <= 0, to 2e-7 (1 + |t|) of itself; 0 below -87, where float32 has no normal number:
/// 2^n times a polynomial for 2^r, r in -1/2..1/2, of the smallest greatest relative error
/// (1.9e-9), fitted as in scaledErfc(). Half of what hn::Exp takes, which is right for large t too.
template <class D>
HWY_INLINE hn::Vec<D> expOfNotPositive(D d, hn::Vec<D> t) {
  const hn::RebindToSigned<D> whole;
  const auto power = hn::Mul(t, hn::Set(d, 1.44269504f));
  const auto lowest = hn::Set(d, -126.0f);
  const auto held = hn::Max(power, lowest);
  const auto n = hn::Round(held);
  const auto r = hn::Sub(held, n);
  auto sum = hn::Set(d, 1.534581195e-04f);
  sum = hn::MulAdd(sum, r, hn::Set(d, 1.339993122e-03f));
  sum = hn::MulAdd(sum, r, hn::Set(d, 9.618488957e-03f));
  sum = hn::MulAdd(sum, r, hn::Set(d, 5.550328777e-02f));
  sum = hn::MulAdd(sum, r, hn::Set(d, 2.402264689e-01f));
  sum = hn::MulAdd(sum, r, hn::Set(d, 6.931472057e-01f));
  sum = hn::MulAdd(sum, r, hn::Set(d, 1.0f));
  const auto bits = hn::Add(hn::BitCast(whole, sum), hn::ShiftLeft<23>(hn::ConvertTo(whole, n)));
  return hn::IfThenElseZero(hn::Ge(power, lowest), hn::BitCast(d, bits));
}

using Half = hn::Rebind<uint16_t, Tag>;

/// To the nearest bfloat16, of two as near the even one.
HWY_INLINE hn::Vec<Half> narrowOf(Tag, Vec values) {
  const hn::RebindToUnsigned<Tag> whole;
  const auto bits = hn::BitCast(whole, values);
  const auto is_odd = hn::And(hn::ShiftRight<16>(bits), hn::Set(whole, 1u));
  const auto rounded = hn::Add(hn::Add(bits, hn::Set(whole, 0x7fffu)), is_odd);
  return hn::TruncateTo(Half(), hn::ShiftRight<16>(rounded));
}

void narrowVector(size_t count, const float* from, uint16_t* to) {
  const Tag d;
  const Half half;
  const size_t lanes = hn::Lanes(d);
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(narrowOf(d, hn::LoadU(d, from + i)), half, to + i);
  }
  if (i == count) return;
  HWY_ALIGN float rest[hn::MaxLanes(d)] = {};
  HWY_ALIGN uint16_t halves[hn::MaxLanes(d)];
  std::copy(from + i, from + count, rest);
  hn::Store(narrowOf(d, hn::Load(d, rest)), half, halves);
  std::copy_n(halves, count - i, to + i);
}

void softmaxVector(SoftmaxRow& row) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  const Vec scale = hn::Set(d, row.scale);
  HWY_ALIGN float edge[hn::MaxLanes(d)];
  const size_t whole = row.keys / lanes * lanes;
  const size_t rest = row.keys - whole;
  const auto scored = [&](Vec score, const float* bias) {
    return hn::MulAdd(scale, score, bias == nullptr ? hn::Zero(d) : hn::LoadU(d, bias));
  };
  Vec peaks = hn::Set(d, row.peak);
  for (size_t i = 0; i < whole; i += lanes) {
    const float* bias = row.key_bias == nullptr ? nullptr : row.key_bias + i;
    peaks = hn::Max(peaks, scored(hn::LoadU(d, row.scores + i), bias));
  }
  Vec last = hn::Zero(d);
  if (rest > 0) {
    std::fill_n(edge, lanes, 0.0f);
    if (row.key_bias != nullptr) std::copy_n(row.key_bias + whole, rest, edge);
    const Vec bias = hn::Load(d, edge);
    // Lanes without a key have the score of one that has.
    std::fill_n(edge, lanes, row.scores[whole]);
    std::copy_n(row.scores + whole, rest, edge);
    last = hn::MulAdd(scale, hn::Load(d, edge), bias);
    hn::Store(last, d, edge);
    for (size_t i = rest; i < lanes; ++i) edge[i] = edge[0];
    last = hn::Load(d, edge);
    peaks = hn::Max(peaks, last);
  }
  const Vec peak = hn::MaxOfLanes(d, peaks);
  Vec sums = hn::Zero(d);
  for (size_t i = 0; i < whole; i += lanes) {
    const float* bias = row.key_bias == nullptr ? nullptr : row.key_bias + i;
    const Vec power =
        expOfNotPositive(d, hn::Sub(scored(hn::LoadU(d, row.scores + i), bias), peak));
    sums = hn::Add(sums, power);
    if (row.narrow != nullptr) {
      hn::StoreU(narrowOf(d, power), Half(), row.narrow + i);
    } else {
      hn::StoreU(power, d, row.scores + i);
    }
  }
  if (rest > 0) {
    hn::Store(expOfNotPositive(d, hn::Sub(last, peak)), d, edge);
    std::copy_n(edge, rest, row.scores + whole);
    if (row.narrow != nullptr) narrowVector(rest, edge, row.narrow + whole);
    std::fill(edge + rest, edge + lanes, 0.0f);
    sums = hn::Add(sums, hn::Load(d, edge));
  }
  const Vec shrink = expOfNotPositive(d, hn::Sub(hn::Set(d, row.peak), peak));
  const float factor = hn::GetLane(shrink);
  row.peak = hn::GetLane(peak);
  row.sum = row.sum * factor + hn::GetLane(hn::SumOfLanes(d, sums));
  if (factor == 1.0f) return;
  size_t i = 0;
  for (; i + lanes <= row.width; i += lanes) {
    hn::StoreU(hn::Mul(hn::LoadU(d, row.out + i), shrink), d, row.out + i);
  }
  for (; i < row.width; ++i) row.out[i] *= factor;
}

/// The columns of one vector.
template <class D>
HWY_INLINE void softmaxLanes(D d, const SoftmaxColumns& tile, size_t column) {
  using V = hn::Vec<D>;
  const size_t stride = tile.columns;
  float* scores = tile.scores + column;
  const V before = hn::LoadU(d, tile.peaks + column);
  V peak = before;
  for (size_t i = 0; i < tile.keys; ++i) {
    peak = hn::Max(peak, hn::Mul(hn::Set(d, tile.rates[i]), hn::LoadU(d, scores + i * stride)));
  }
  V sum = hn::Zero(d);
  for (size_t i = 0; i < tile.keys; ++i) {
    const V score = hn::Mul(hn::Set(d, tile.rates[i]), hn::LoadU(d, scores + i * stride));
    const V power = expOfNotPositive(d, hn::Sub(score, peak));
    sum = hn::Add(sum, power);
    hn::StoreU(power, d, scores + i * stride);
  }
  const V shrink = expOfNotPositive(d, hn::Sub(before, peak));
  hn::StoreU(peak, d, tile.peaks + column);
  hn::StoreU(hn::MulAdd(hn::LoadU(d, tile.sums + column), shrink, sum), d, tile.sums + column);
  for (size_t i = 0; i < tile.width; ++i) {
    float* out = tile.out + i * stride + column;
    hn::StoreU(hn::Mul(hn::LoadU(d, out), shrink), d, out);
  }
}

void softmaxColumnsVector(const SoftmaxColumns& tile) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t column = 0;
  for (; column + lanes <= tile.columns; column += lanes) softmaxLanes(d, tile, column);
  for (; column < tile.columns; ++column) softmaxLanes(hn::CappedTag<float, 1>(), tile, column);
}

/// Numbers of 16 bits, `lanes` of them from an address that need not be even.
HWY_INLINE hn::Vec<Half> loadHalves(const uint8_t* bytes) {
  const Half half;
#if HWY_TARGET == HWY_SCALAR
  uint16_t number;
  std::memcpy(&number, bytes, sizeof(number));
  return hn::Set(half, number);
#else
  return hn::BitCast(half, hn::LoadU(hn::Repartition<uint8_t, Half>(), bytes));
#endif
}

struct FromHalf {
  static HWY_INLINE Vec of(Tag d, hn::Vec<Half> halves) {
    const hn::Rebind<hwy::float16_t, Tag> narrow;
    return hn::PromoteTo(d, hn::BitCast(narrow, halves));
  }
};

struct FromBfloat16 {
  static HWY_INLINE Vec of(Tag d, hn::Vec<Half> halves) {
    const hn::RebindToUnsigned<Tag> whole;
    return hn::BitCast(d, hn::ShiftLeft<16>(hn::PromoteTo(whole, halves)));
  }
};

template <class From>
void widenHalves(size_t count, const uint8_t* bytes, float* to) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(From::of(d, loadHalves(bytes + 2 * i)), d, to + i);
  }
  if (i == count) return;
  HWY_ALIGN uint8_t rest[2 * hn::MaxLanes(d)] = {};
  HWY_ALIGN float wide[hn::MaxLanes(d)];
  std::copy(bytes + 2 * i, bytes + 2 * count, rest);
  hn::Store(From::of(d, loadHalves(rest)), d, wide);
  std::copy_n(wide, count - i, to + i);
}

void widenVector(WeightType type, size_t count, const uint8_t* bytes, float* to) {
  switch (type) {
    case WeightType::kFloat16:
      return widenHalves<FromHalf>(count, bytes, to);
    case WeightType::kBfloat16:
      return widenHalves<FromBfloat16>(count, bytes, to);
    default:
      if (count > 0) std::memcpy(to, bytes, count * sizeof(float));
  }
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
LayerKernel namedLayerKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET),
          activateVector,
          scaleBySlopeVector,
          siluGateVector,
          softmaxVector,
          softmaxColumnsVector,
          narrowVector,
          widenVector};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedLayerKernel);

std::vector<LayerKernel> layerKernels() {
  return onEveryTarget(scalarLayerKernel(),
                       [] { return HWY_DYNAMIC_DISPATCH(namedLayerKernel)(); });
}

const LayerKernel& chosenLayerKernel() {
  static const LayerKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedLayerKernel)(), layerKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
