#include "splat/cpu/tile_kernel_backward.h"

// Lanes are pixels of one tile row. The same steps as tile_kernel_backward_scalar.cpp with masks in
// place of branches; products and sums are fused where the processor can, so targets differ by
// rounding. Alpha is 0 in dead lanes, which leaves their pixel as it is.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/cpu/tile_kernel_backward_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <limits>

#include "splat/cpu/exp2-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, kTileSide>;
using Vec = hn::Vec<Tag>;
using IntTag = hn::RebindToSigned<Tag>;

HWY_INLINE float sumOfLanes(Tag d, Vec v) {
  return hn::GetLane(hn::SumOfLanes(d, v));
}

/// sqrt(a^2 + b^2) for a, b >= 0, as lengthOf in splat/blend_backward.h.
HWY_INLINE Vec lengthOfLanes(Tag d, Vec a, Vec b) {
  const Vec larger = hn::Max(a, b);
  const Vec least = hn::Set(d, std::numeric_limits<float>::min());
  const Vec ratio = hn::Div(hn::Min(a, b), hn::Max(larger, least));
  return hn::Mul(larger, hn::Sqrt(hn::MulAdd(ratio, ratio, hn::Set(d, 1.0f))));
}

void markTile(BackwardSplat* splats, size_t count, int32_t first, BackwardPixels& pixels) {
  const Tag d;
  const IntTag di;
  const size_t lanes = hn::Lanes(d);
  const Vec max_alpha = hn::Set(d, static_cast<float>(kMaxAlpha));
  const Vec min_transmittance = hn::Set(d, static_cast<float>(kMinTransmittance));
  const Vec finish_doubt = hn::Set(d, static_cast<float>(kMinTransmittance) * kFinishDoubt);
  const Vec finished = hn::Set(d, kFinished);
  const Vec lowest = hn::Set(d, -9.0f);  // dead lanes may hold -1e12

  for (size_t s = 0; s < count; ++s) {
    BackwardSplat& splat = splats[s];
    splat.rows = 0;
    if (pixels.unfinished == 0) continue;
    const auto place = hn::Set(di, first + static_cast<int32_t>(s));
    const Vec low = hn::Set(d, kLog2MinAlpha - splat.doubt_low);
    const Vec high = hn::Set(d, kLog2MinAlpha + splat.doubt_high);
    const Vec l11 = hn::Set(d, splat.l11);
    for (size_t column = 0; column < kTileSide; column += lanes) {
      const Vec x = hn::Iota(d, static_cast<float>(column));
      const Vec g0 = hn::MulAdd(hn::Set(d, splat.l00), x, hn::Set(d, splat.g0));
      const Vec most = hn::NegMulAdd(g0, g0, hn::Set(d, splat.log2_opacity));
      if (hn::AllFalse(d, hn::Gt(most, low))) continue;
      const Vec g1_first = hn::MulAdd(hn::Set(d, splat.l10), x, hn::Set(d, splat.g1));
      for (uint32_t y = splat.row_begin; y < splat.row_end; ++y) {
        const size_t i = static_cast<size_t>(y) * kTileSide + column;
        const Vec g1 = hn::MulAdd(l11, hn::Set(d, static_cast<float>(y)), g1_first);
        const Vec exponent = hn::NegMulAdd(g1, g1, most);
        const Vec cut = hn::Load(d, pixels.cut + i);
        const auto touched = hn::And(hn::Gt(exponent, low), hn::Lt(cut, finished));
        if (hn::AllFalse(d, touched)) continue;

        const auto unclear = hn::And(touched, hn::Lt(exponent, high));
        const auto shows = hn::AndNot(unclear, touched);
        const Vec alpha = hn::Min(max_alpha, exp2Small(d, hn::Max(exponent, lowest)));
        const Vec before = hn::Load(d, pixels.transmittance + i);
        const Vec next = hn::NegMulAdd(before, alpha, before);
        const auto near = hn::Lt(hn::Abs(hn::Sub(next, min_transmittance)), finish_doubt);
        const auto doubtful = hn::Or(unclear, hn::And(shows, near));
        const auto ends = hn::Or(doubtful, hn::And(shows, hn::Lt(next, min_transmittance)));
        const auto blends = hn::AndNot(ends, shows);

        hn::Store(hn::IfThenElse(blends, next, before), d, pixels.transmittance + i);
        const auto last = hn::Load(di, pixels.last + i);
        hn::Store(hn::IfThenElse(hn::RebindMask(di, blends), place, last), di, pixels.last + i);
        if (!hn::AllFalse(d, blends)) splat.rows |= 1u << y;
        if (!hn::AllFalse(d, ends)) {
          hn::Store(hn::IfThenElse(ends, finished, cut), d, pixels.cut + i);
          const Vec doubt = hn::Load(d, pixels.doubt + i);
          hn::Store(hn::IfThenElse(doubtful, hn::Set(d, 1.0f), doubt), d, pixels.doubt + i);
          pixels.unfinished -= static_cast<uint32_t>(hn::CountTrue(d, ends));
        }
      }
    }
  }
}

template <BackwardMode kMode>
void takeOffSplats(const BackwardSplat* splats, size_t count, int32_t first, BackwardPixels& pixels,
                   float* sums) {
  constexpr bool kContributions = kMode != BackwardMode::kGradients;
  constexpr bool kStatistics = kMode == BackwardMode::kStatistics;
  constexpr size_t kFieldCount = backwardFieldCount(kMode);
  const Tag d;
  const IntTag di;
  const size_t lanes = hn::Lanes(d);
  const Vec zero = hn::Zero(d);
  const Vec one = hn::Set(d, 1.0f);
  const Vec max_alpha = hn::Set(d, static_cast<float>(kMaxAlpha));
  const Vec lowest = hn::Set(d, -9.0f);
  const Vec squared_g_scale = hn::Set(d, static_cast<float>(kSquaredGScale));

  for (size_t k = count; k-- > 0;) {
    const BackwardSplat& splat = splats[k];
    float* out = sums + k * kFieldCount;
    if (splat.rows == 0) {
      std::fill(out, out + kFieldCount, 0.0f);
      continue;
    }
    const auto before = hn::Set(di, first + static_cast<int32_t>(k) - 1);
    const Vec low = hn::Set(d, kLog2MinAlpha - splat.doubt_low);
    const Vec l11 = hn::Set(d, splat.l11);
    const Vec red = hn::Set(d, splat.colour[0]);
    const Vec green = hn::Set(d, splat.colour[1]);
    const Vec blue = hn::Set(d, splat.colour[2]);
    Vec sum_g0 = zero, sum_g00 = zero, sum_g01 = zero;
    Vec sum_s = zero, sum_g1 = zero, sum_g11 = zero;
    Vec sum_red = zero, sum_green = zero, sum_blue = zero;
    Vec sum_contribution = zero, sum_weight = zero, sum_edge = zero, sum_error = zero;
    Vec sum_x = zero, sum_y = zero, sum_norm = zero, largest_error = zero;
    for (size_t column = 0; column < kTileSide; column += lanes) {
      const Vec x = hn::Iota(d, static_cast<float>(column));
      const Vec g0 = hn::MulAdd(hn::Set(d, splat.l00), x, hn::Set(d, splat.g0));
      const Vec most = hn::NegMulAdd(g0, g0, hn::Set(d, splat.log2_opacity));
      if (hn::AllFalse(d, hn::Gt(most, low))) continue;
      const Vec g1_first = hn::MulAdd(hn::Set(d, splat.l10), x, hn::Set(d, splat.g1));
      // g0 is that of the column: it is multiplied in once the rows are summed.
      Vec column_s = zero, column_g1 = zero;
      for (uint32_t rows = splat.rows; rows != 0; rows &= rows - 1) {
        const uint32_t y = static_cast<uint32_t>(std::countr_zero(rows));
        const size_t i = static_cast<size_t>(y) * kTileSide + column;
        const Vec g1 = hn::MulAdd(l11, hn::Set(d, static_cast<float>(y)), g1_first);
        const Vec exponent = hn::NegMulAdd(g1, g1, most);
        const auto reached = hn::Gt(hn::Load(di, pixels.last + i), before);
        const auto shows = hn::And(hn::Gt(exponent, low), hn::RebindMask(d, reached));
        if (hn::AllFalse(d, shows)) continue;

        const Vec free_alpha = exp2Small(d, hn::Max(exponent, lowest));
        const Vec alpha = hn::IfThenElseZero(shows, hn::Min(max_alpha, free_alpha));
        const Vec transmittance =
            hn::Div(hn::Load(d, pixels.transmittance + i), hn::Sub(one, alpha));
        hn::Store(transmittance, d, pixels.transmittance + i);
        const Vec weight = hn::Mul(transmittance, alpha);
        const Vec by_red = hn::Load(d, pixels.gradient[0] + i);
        const Vec by_green = hn::Load(d, pixels.gradient[1] + i);
        const Vec by_blue = hn::Load(d, pixels.gradient[2] + i);
        Vec own = hn::MulAdd(red, by_red, hn::Load(d, pixels.gradient[3] + i));
        own = hn::MulAdd(green, by_green, own);
        own = hn::MulAdd(blue, by_blue, own);
        const Vec behind = hn::Load(d, pixels.behind + i);
        const Vec difference = hn::Sub(own, behind);
        hn::Store(hn::MulAdd(alpha, difference, behind), d, pixels.behind + i);
        const Vec s =
            hn::IfThenElseZero(hn::Lt(free_alpha, max_alpha), hn::Mul(weight, difference));
        const Vec s_g1 = hn::Mul(s, g1);
        column_s = hn::Add(column_s, s);
        column_g1 = hn::Add(column_g1, s_g1);
        sum_g11 = hn::MulAdd(s_g1, g1, sum_g11);
        sum_red = hn::MulAdd(weight, by_red, sum_red);
        sum_green = hn::MulAdd(weight, by_green, sum_green);
        sum_blue = hn::MulAdd(weight, by_blue, sum_blue);

        if constexpr (kContributions) {
          const auto channel = [&](size_t c, Vec colour) {
            const Vec colour_behind = hn::Load(d, pixels.colour_behind[c] + i);
            const Vec over = hn::Sub(colour, colour_behind);
            const Vec change =
                hn::Mul(hn::Mul(weight, over), hn::Load(d, pixels.signed_weight[c] + i));
            const Vec other = hn::Sub(hn::Load(d, pixels.room[c] + i), change);
            hn::Store(hn::MulAdd(alpha, over, colour_behind), d, pixels.colour_behind[c] + i);
            return hn::Min(change, other);
          };
          Vec contribution = channel(0, red);
          contribution = hn::Add(contribution, channel(1, green));
          contribution = hn::Add(contribution, channel(2, blue));
          sum_contribution = hn::Add(sum_contribution, contribution);
        }
        if constexpr (kStatistics) {
          const Vec scaled = hn::Mul(squared_g_scale, s);
          const Vec along =
              hn::MulAdd(g0, hn::Set(d, splat.l00), hn::Mul(g1, hn::Set(d, splat.l10)));
          const Vec by_x = hn::Abs(hn::Mul(scaled, along));
          const Vec by_y = hn::Abs(hn::Mul(scaled, hn::Mul(g1, l11)));
          const Vec error = hn::Mul(weight, hn::Load(d, pixels.error + i));
          sum_weight = hn::Add(sum_weight, weight);
          sum_edge = hn::MulAdd(weight, hn::Load(d, pixels.edge + i), sum_edge);
          sum_x = hn::Add(sum_x, by_x);
          sum_y = hn::Add(sum_y, by_y);
          sum_norm = hn::Add(sum_norm, lengthOfLanes(d, by_x, by_y));
          sum_error = hn::Add(sum_error, error);
          largest_error = hn::Max(largest_error, error);
        }
      }
      const Vec s_g0 = hn::Mul(column_s, g0);
      sum_s = hn::Add(sum_s, column_s);
      sum_g0 = hn::Add(sum_g0, s_g0);
      sum_g1 = hn::Add(sum_g1, column_g1);
      sum_g00 = hn::MulAdd(s_g0, g0, sum_g00);
      sum_g01 = hn::MulAdd(column_g1, g0, sum_g01);
    }
    out[kFieldS] = sumOfLanes(d, sum_s);
    out[kFieldG0] = sumOfLanes(d, sum_g0);
    out[kFieldG1] = sumOfLanes(d, sum_g1);
    out[kFieldG00] = sumOfLanes(d, sum_g00);
    out[kFieldG01] = sumOfLanes(d, sum_g01);
    out[kFieldG11] = sumOfLanes(d, sum_g11);
    out[kFieldRed] = sumOfLanes(d, sum_red);
    out[kFieldGreen] = sumOfLanes(d, sum_green);
    out[kFieldBlue] = sumOfLanes(d, sum_blue);
    if constexpr (kContributions) out[kFieldContribution] = sumOfLanes(d, sum_contribution);
    if constexpr (kStatistics) {
      out[kFieldWeight] = sumOfLanes(d, sum_weight);
      out[kFieldEdge] = sumOfLanes(d, sum_edge);
      out[kFieldAbsoluteX] = sumOfLanes(d, sum_x);
      out[kFieldAbsoluteY] = sumOfLanes(d, sum_y);
      out[kFieldNorm] = sumOfLanes(d, sum_norm);
      out[kFieldError] = sumOfLanes(d, sum_error);
      out[kFieldLargestError] = hn::GetLane(hn::MaxOfLanes(d, largest_error));
    }
  }
}

void takeOffTile(const BackwardSplat* splats, size_t count, int32_t first, BackwardMode mode,
                 BackwardPixels& pixels, float* sums) {
  switch (mode) {
    case BackwardMode::kGradients:
      return takeOffSplats<BackwardMode::kGradients>(splats, count, first, pixels, sums);
    case BackwardMode::kContributions:
      return takeOffSplats<BackwardMode::kContributions>(splats, count, first, pixels, sums);
    case BackwardMode::kStatistics:
      return takeOffSplats<BackwardMode::kStatistics>(splats, count, first, pixels, sums);
  }
}

BackwardKernel backwardKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), markTile,
          takeOffTile};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <string>

namespace stipple {

HWY_EXPORT(backwardKernel);

std::vector<BackwardKernel> backwardKernels() {
  std::vector<BackwardKernel> kernels = {{"scalar", markTileScalar, takeOffTileScalar}};
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    kernels.push_back(HWY_DYNAMIC_DISPATCH(backwardKernel)());
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return kernels;
}

namespace {

BackwardKernel chooseBackwardKernel() {
  const TileKernel forward = chosenTileKernel();
  for (const NamedTileKernel& named : tileKernels()) {
    if (named.kernel != forward) continue;
    for (const BackwardKernel& kernel : backwardKernels()) {
      if (std::string(kernel.target) == named.target) return kernel;
    }
  }
  return HWY_DYNAMIC_DISPATCH(backwardKernel)();
}

}  // namespace

const BackwardKernel& chosenBackwardKernel() {
  static const BackwardKernel kernel = chooseBackwardKernel();
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
