#include "train/optimiser/image_loss_kernel.h"

// The steps of image_loss_kernel_scalar.cpp with lanes along the row; products and sums are fused
// where the processor can, so targets differ by rounding. Working rows are read and written in
// whole vectors, into their slack; pictures are not.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "train/optimiser/image_loss_kernel_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, kRowSlack>;
using Vec = hn::Vec<Tag>;

/// A vector of each channel, from whole pixels in memory.
HWY_INLINE void loadPixels(Tag d, PixelRun<const float> run, size_t i, Vec& r, Vec& g, Vec& b) {
  if (run.layout == PixelLayout::kRgb) {
    hn::LoadInterleaved3(d, run.first + 3 * i, r, g, b);
  } else if (run.layout == PixelLayout::kRgba) {
    Vec alpha;
    hn::LoadInterleaved4(d, run.first + 4 * i, r, g, b, alpha);
  } else {
    r = hn::LoadU(d, run.first + i);
    g = hn::LoadU(d, run.first + run.plane_stride + i);
    b = hn::LoadU(d, run.first + 2 * run.plane_stride + i);
  }
}

HWY_INLINE void storePixels(Tag d, PixelRun<float> run, size_t i, Vec r, Vec g, Vec b) {
  if (run.layout == PixelLayout::kRgb) {
    hn::StoreInterleaved3(r, g, b, d, run.first + 3 * i);
  } else if (run.layout == PixelLayout::kRgba) {
    hn::StoreInterleaved4(r, g, b, hn::Zero(d), d, run.first + 4 * i);
  } else {
    hn::StoreU(r, d, run.first + i);
    hn::StoreU(g, d, run.first + run.plane_stride + i);
    hn::StoreU(b, d, run.first + 2 * run.plane_stride + i);
  }
}

size_t floatsPerPixel(PixelLayout layout) {
  return layout == PixelLayout::kRgb ? 3 : layout == PixelLayout::kRgba ? 4 : 1;
}

/// Copies the last `count` pixels, fewer than a vector, between a picture and a small buffer.
template <class From, class To>
void copyPixels(PixelRun<From> from, PixelRun<To> to, size_t count) {
  const size_t planes = from.layout == PixelLayout::kPlanar ? 3 : 1;
  for (size_t plane = 0; plane < planes; ++plane) {
    const float* source = from.first + plane * from.plane_stride;
    float* goal = to.first + plane * to.plane_stride;
    for (size_t i = 0; i < count * floatsPerPixel(from.layout); ++i) goal[i] = source[i];
  }
}

struct Tail {
  HWY_ALIGN float values[4 * kRowSlack] = {};
  PixelRun<float> run;
  explicit Tail(PixelLayout layout) : run{values, layout, kRowSlack} {}
  PixelRun<const float> read() const { return {values, run.layout, kRowSlack}; }
};

template <class Float>
PixelRun<Float> from(PixelRun<Float> run, size_t pixel) {
  run.first += pixel * floatsPerPixel(run.layout);
  return run;
}

/// The colour, or 0 with `bad` set where it is not finite or too large. As integers: comparing a
/// NaN as a number would trap.
HWY_INLINE Vec usable(Tag d, Vec colour, hn::Mask<Tag>& bad) {
  const hn::RebindToSigned<Tag> di;
  const auto bits = hn::BitCast(di, hn::Abs(colour));
  const auto limit = hn::BitCast(di, hn::Set(d, kLargestColour));
  const auto beyond = hn::RebindMask(d, hn::Gt(bits, limit));
  bad = hn::Or(bad, beyond);
  return hn::IfThenZeroElse(beyond, colour);
}

/// p and d of one channel.
HWY_INLINE void combine(Tag d, Vec rendered, Vec target, float* sum, float* difference,
                        hn::Mask<Tag>& bad) {
  const Vec x = usable(d, rendered, bad);
  const Vec y = usable(d, target, bad);
  hn::StoreU(hn::Add(x, y), d, sum);
  hn::StoreU(hn::Sub(x, y), d, difference);
}

bool readPixels(PixelRun<const float> rendered, PixelRun<const float> target, size_t count,
                float* const sums[3], float* const differences[3]) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  auto bad = hn::MaskFromVec(hn::Zero(d));
  Vec x0, x1, x2, y0, y1, y2;
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    loadPixels(d, rendered, i, x0, x1, x2);
    loadPixels(d, target, i, y0, y1, y2);
    combine(d, x0, y0, sums[0] + i, differences[0] + i, bad);
    combine(d, x1, y1, sums[1] + i, differences[1] + i, bad);
    combine(d, x2, y2, sums[2] + i, differences[2] + i, bad);
  }
  if (i < count) {
    Tail x(rendered.layout), y(target.layout);
    copyPixels(from(rendered, i), x.run, count - i);
    copyPixels(from(target, i), y.run, count - i);
    loadPixels(d, x.read(), 0, x0, x1, x2);
    loadPixels(d, y.read(), 0, y0, y1, y2);
    float sum[3][kRowSlack], difference[3][kRowSlack];
    combine(d, x0, y0, sum[0], difference[0], bad);
    combine(d, x1, y1, sum[1], difference[1], bad);
    combine(d, x2, y2, sum[2], difference[2], bad);
    for (size_t c = 0; c < 3; ++c) {
      for (size_t k = i; k < count; ++k) {
        sums[c][k] = sum[c][k - i];
        differences[c][k] = difference[c][k - i];
      }
    }
  }
  return hn::AllFalse(d, bad);
}

template <class Value>
HWY_INLINE Vec blurredAt(Tag d, const Value& value) {
  Vec sum = hn::Mul(hn::Set(d, kBlurWindow[kBlurReach]), value(kBlurReach));
  for (size_t k = 0; k < kBlurReach; ++k) {
    const Vec pair = hn::Add(value(k), value(kBlurTaps - 1 - k));
    sum = hn::MulAdd(hn::Set(d, kBlurWindow[k]), pair, sum);
  }
  return sum;
}

HWY_INLINE Vec blurredAlongRow(Tag d, const float* row) {
  return blurredAt(d, [&](size_t k) HWY_ATTR { return hn::LoadU(d, row + k); });
}

/// Adds an input row's share to the output row kOut of a block, if it has one.
template <size_t kRow, size_t kOut>
HWY_INLINE void addTap(Tag d, Vec value, Vec& sum) {
  if constexpr (kRow >= kOut && kRow - kOut < kBlurTaps) {
    sum = hn::MulAdd(hn::Set(d, kBlurWindow[kRow - kOut]), value, sum);
  }
}

template <size_t kRow>
HWY_INLINE void addTaps(Tag d, Vec value, Vec& sum0, Vec& sum1, Vec& sum2, Vec& sum3) {
  addTap<kRow, 0>(d, value, sum0);
  addTap<kRow, 1>(d, value, sum1);
  addTap<kRow, 2>(d, value, sum2);
  addTap<kRow, 3>(d, value, sum3);
}

template <size_t kRow>
HWY_INLINE void addRows(Tag d, const float* const* rows, size_t i, Vec& sum0, Vec& sum1, Vec& sum2,
                        Vec& sum3) {
  if constexpr (kRow < kBlockInputs) {
    addTaps<kRow>(d, hn::LoadU(d, rows[kRow] + i), sum0, sum1, sum2, sum3);
    addRows<kRow + 1>(d, rows, i, sum0, sum1, sum2, sum3);
  }
}

template <size_t kRow>
HWY_INLINE void addRowsAndSquares(Tag d, const float* const* rows, size_t i, Vec& sum0, Vec& sum1,
                                  Vec& sum2, Vec& sum3, Vec& square0, Vec& square1, Vec& square2,
                                  Vec& square3) {
  if constexpr (kRow < kBlockInputs) {
    const Vec value = hn::LoadU(d, rows[kRow] + i);
    addTaps<kRow>(d, value, sum0, sum1, sum2, sum3);
    addTaps<kRow>(d, hn::Mul(value, value), square0, square1, square2, square3);
    addRowsAndSquares<kRow + 1>(d, rows, i, sum0, sum1, sum2, sum3, square0, square1, square2,
                                square3);
  }
}

/// One of p and d: its blurred values are statistic `first`, its blurred squares two further on.
HWY_INLINE void blurWithSquares(Tag d, const float* const* rows, size_t i, float* const* statistics,
                                size_t first) {
  static_assert(kBlockRows == 4);
  Vec sum0 = hn::Zero(d), sum1 = hn::Zero(d), sum2 = hn::Zero(d), sum3 = hn::Zero(d);
  Vec square0 = hn::Zero(d), square1 = hn::Zero(d), square2 = hn::Zero(d), square3 = hn::Zero(d);
  addRowsAndSquares<0>(d, rows, i, sum0, sum1, sum2, sum3, square0, square1, square2, square3);
  hn::StoreU(sum0, d, statistics[first] + i);
  hn::StoreU(sum1, d, statistics[4 + first] + i);
  hn::StoreU(sum2, d, statistics[8 + first] + i);
  hn::StoreU(sum3, d, statistics[12 + first] + i);
  hn::StoreU(square0, d, statistics[first + 2] + i);
  hn::StoreU(square1, d, statistics[4 + first + 2] + i);
  hn::StoreU(square2, d, statistics[8 + first + 2] + i);
  hn::StoreU(square3, d, statistics[12 + first + 2] + i);
}

void blurStatistics(const float* const* sums, const float* const* differences, size_t count,
                    float* const* statistics) {
  const Tag d;
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    blurWithSquares(d, sums, i, statistics, 0);
    blurWithSquares(d, differences, i, statistics, 1);
  }
}

template <bool kMaps>
void evaluateSsimRow(const float* const statistics[4], const float* weights, size_t count,
                     float* errors, float* const maps[3]) {
  const Tag tag;
  const Vec c1 = hn::Set(tag, kSsimC1);
  const Vec c2 = hn::Set(tag, kSsimC2);
  const Vec half = hn::Set(tag, 0.5f);
  const Vec one = hn::Set(tag, 1.0f);
  for (size_t i = 0; i < count; i += hn::Lanes(tag)) {
    const Vec mean_p = blurredAlongRow(tag, statistics[0] + i);
    const Vec mean_d = blurredAlongRow(tag, statistics[1] + i);
    const Vec square_p = blurredAlongRow(tag, statistics[2] + i);
    const Vec square_d = blurredAlongRow(tag, statistics[3] + i);
    const Vec p = hn::Mul(half, hn::Mul(mean_p, mean_p));
    const Vec d = hn::Mul(half, hn::Mul(mean_d, mean_d));
    const Vec v = hn::Max(hn::Zero(tag), hn::Sub(hn::Mul(half, square_p), p));
    const Vec w = hn::Max(hn::Zero(tag), hn::Sub(hn::Mul(half, square_d), d));
    const Vec b1 = hn::Add(hn::Add(p, d), c1);
    const Vec b2 = hn::Add(hn::Add(v, w), c2);
    // One division for both: it is the slowest instruction here.
    const Vec inverse = hn::Div(one, hn::Mul(b1, b2));
    const Vec inverse_1 = hn::Mul(inverse, b2);
    const Vec inverse_2 = hn::Mul(inverse, b1);
    const Vec l = hn::Mul(hn::Add(hn::Sub(p, d), c1), inverse_1);
    const Vec s = hn::Mul(hn::Add(hn::Sub(v, w), c2), inverse_2);
    const Vec error_1 = hn::Mul(hn::Add(d, d), inverse_1);
    const Vec error_2 = hn::Mul(hn::Add(w, w), inverse_2);
    hn::StoreU(hn::MulAdd(l, error_2, error_1), tag, errors + i);
    if constexpr (kMaps) {
      const Vec weight = weights ? hn::LoadU(tag, weights + i) : one;
      const Vec twice = hn::Add(weight, weight);
      const Vec by_l = hn::Mul(hn::Mul(twice, s), hn::Mul(inverse_1, inverse_1));
      const Vec by_s = hn::Mul(hn::Mul(twice, l), hn::Mul(inverse_2, inverse_2));
      const Vec by_v = hn::Mul(by_s, w);
      const Vec by_w = hn::Neg(hn::Mul(by_s, hn::Add(v, c2)));
      const Vec by_p = hn::MulSub(by_l, d, by_v);
      const Vec by_d = hn::NegMulAdd(by_l, hn::Add(p, c1), hn::Neg(by_w));
      hn::StoreU(hn::MulAdd(mean_p, by_p, hn::Mul(mean_d, by_d)), tag, maps[0] + i);
      hn::StoreU(by_v, tag, maps[1] + i);
      hn::StoreU(by_w, tag, maps[2] + i);
    }
  }
}

void evaluateSsim(const float* const statistics[4], const float* weights, size_t count,
                  float* errors, float* const maps[3]) {
  if (maps[0]) {
    evaluateSsimRow<true>(statistics, weights, count, errors, maps);
  } else {
    evaluateSsimRow<false>(statistics, weights, count, errors, maps);
  }
}

void blurColumns(const float* const* rows, size_t count, float* const* out) {
  const Tag d;
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    Vec sum0 = hn::Zero(d), sum1 = hn::Zero(d), sum2 = hn::Zero(d), sum3 = hn::Zero(d);
    addRows<0>(d, rows, i, sum0, sum1, sum2, sum3);
    hn::StoreU(sum0, d, out[0] + i);
    hn::StoreU(sum1, d, out[1] + i);
    hn::StoreU(sum2, d, out[2] + i);
    hn::StoreU(sum3, d, out[3] + i);
  }
}

void combineGradient(const float* const blurred_maps[3], const float* sums,
                     const float* differences, const float* weights, size_t count, float l1_scale,
                     float ssim_scale, float* out) {
  const Tag d;
  const Vec zero = hn::Zero(d);
  const Vec l1_step = hn::Set(d, l1_scale);
  const Vec ssim_step = hn::Set(d, ssim_scale);
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const Vec difference = hn::LoadU(d, differences + i);
    Vec ssim = blurredAlongRow(d, blurred_maps[0] + i);
    ssim = hn::MulAdd(hn::LoadU(d, sums + i), blurredAlongRow(d, blurred_maps[1] + i), ssim);
    ssim = hn::MulAdd(difference, blurredAlongRow(d, blurred_maps[2] + i), ssim);
    const Vec step = weights ? hn::Mul(l1_step, hn::LoadU(d, weights + i)) : l1_step;
    const Vec l1 = hn::IfThenZeroElse(hn::Eq(difference, zero), hn::CopySign(step, difference));
    hn::StoreU(hn::NegMulAdd(ssim_step, ssim, l1), d, out + i);
  }
}

void writePixels(const float* const rows[3], size_t count, PixelRun<float> out) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  const auto write = [&](size_t i, PixelRun<float> run, size_t at) HWY_ATTR {
    storePixels(d, run, at, hn::LoadU(d, rows[0] + i), hn::LoadU(d, rows[1] + i),
                hn::LoadU(d, rows[2] + i));
  };
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) write(i, out, i);
  if (i < count) {
    Tail tail(out.layout);
    write(i, tail.run, 0);
    copyPixels(tail.read(), from(out, i), count - i);
  }
}

double sumMagnitudes(const float* values, const float* weights, size_t count) {
  const hn::ScalableTag<double> dd;
  const hn::Rebind<float, decltype(dd)> half;
  const size_t lanes = hn::Lanes(dd);
  auto sum_a = hn::Zero(dd);
  auto sum_b = hn::Zero(dd);
  const auto magnitude = [&](size_t i) HWY_ATTR {
    const auto value = hn::PromoteTo(dd, hn::Abs(hn::LoadU(half, values + i)));
    return weights ? hn::Mul(value, hn::PromoteTo(dd, hn::LoadU(half, weights + i))) : value;
  };
  size_t i = 0;
  for (; i + 2 * lanes <= count; i += 2 * lanes) {
    sum_a = hn::Add(sum_a, magnitude(i));
    sum_b = hn::Add(sum_b, magnitude(i + lanes));
  }
  for (; i < count; i += lanes) {
    const auto live = hn::FirstN(dd, count - i);
    sum_a = hn::Add(sum_a, hn::IfThenElseZero(live, magnitude(i)));
  }
  return hn::GetLane(hn::SumOfLanes(dd, hn::Add(sum_a, sum_b)));
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
LossKernel namedLossKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET),
          readPixels,
          blurStatistics,
          evaluateSsim,
          blurColumns,
          combineGradient,
          writePixels,
          sumMagnitudes};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedLossKernel);

std::vector<LossKernel> lossKernels() {
  return onEveryTarget(scalarLossKernel(), [] { return HWY_DYNAMIC_DISPATCH(namedLossKernel)(); });
}

LossKernel chosenLossKernel() {
  static const LossKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedLossKernel)(), lossKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
