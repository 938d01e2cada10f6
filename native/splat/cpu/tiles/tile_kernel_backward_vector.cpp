#include "splat/cpu/tiles/tile_kernel_backward.h"

// Lanes are pixels of one tile row. The same steps as tile_kernel_backward_scalar.cpp with masks in
// place of branches; products and sums are fused where the processor can, so targets differ by
// rounding. Alpha is 0 in dead lanes, which leaves their pixel as it is.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/cpu/tiles/tile_kernel_backward_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <limits>

#include "splat/cpu/exp2-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, kTileSide>;
using Vec = hn::Vec<Tag>;
using IntTag = hn::RebindToSigned<Tag>;

alignas(64) constexpr float kRows[kTileSide] = {0, 1, 2,  3,  4,  5,  6,  7,
                                                8, 9, 10, 11, 12, 13, 14, 15};

HWY_INLINE float sumOfLanes(Tag d, Vec v) {
  return hn::GetLane(hn::SumOfLanes(d, v));
}

#if HWY_HAVE_SCALABLE || HWY_TARGET == HWY_SCALAR
/// Sums of four vectors over their lanes.
HWY_INLINE void sumFour(Tag d, Vec a, Vec b, Vec c, Vec e, float* out) {
  out[0] = sumOfLanes(d, a);
  out[1] = sumOfLanes(d, b);
  out[2] = sumOfLanes(d, c);
  out[3] = sumOfLanes(d, e);
}
#else
template <class D>
HWY_INLINE void storeSumOfBlocks(D d, hn::Vec<D> v, float* out) {
  if constexpr (hn::MaxLanes(D()) > 4) {
    const hn::Half<D> half;
    storeSumOfBlocks(half, hn::Add(hn::LowerHalf(half, v), hn::UpperHalf(half, v)), out);
  } else {
    hn::StoreU(v, d, out);
  }
}

/// Sums of four vectors over their lanes: a quarter of the shuffles of four sums.
HWY_INLINE void sumFour(Tag d, Vec a, Vec b, Vec c, Vec e, float* out) {
  const hn::Repartition<double, Tag> pairs;
  const auto ab =
      hn::BitCast(pairs, hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b)));
  const auto ce =
      hn::BitCast(pairs, hn::Add(hn::InterleaveLower(d, c, e), hn::InterleaveUpper(d, c, e)));
  storeSumOfBlocks(d,
                   hn::Add(hn::BitCast(d, hn::InterleaveLower(pairs, ab, ce)),
                           hn::BitCast(d, hn::InterleaveUpper(pairs, ab, ce))),
                   out);
}
#endif

/// sqrt(a^2 + b^2) for a, b >= 0, as lengthOf in splat/render/blend_backward.h.
HWY_INLINE Vec lengthOfLanes(Tag d, Vec a, Vec b) {
  const Vec larger = hn::Max(a, b);
  const Vec least = hn::Set(d, std::numeric_limits<float>::min());
  const Vec ratio = hn::Div(hn::Min(a, b), hn::Max(larger, least));
  return hn::Mul(larger, hn::Sqrt(hn::MulAdd(ratio, ratio, hn::Set(d, 1.0f))));
}

/// Hands the lanes of `unclear` to the judge. In: first, the pixel of lane 0.
HWY_NOINLINE void judgeLanes(Tag d, hn::Mask<Tag> unclear, size_t splat, size_t first,
                             const TakeOffOptions& options, BackwardPixels& pixels, float* sums) {
  HWY_ALIGN float asked[kTileSide];
  hn::Store(hn::IfThenElseZero(unclear, hn::Set(d, 1.0f)), d, asked);
  for (size_t lane = 0; lane < hn::Lanes(d); ++lane) {
    if (asked[lane] == 0.0f) continue;
    options.judge(options.judge_context, splat, static_cast<uint32_t>(first + lane), pixels, sums);
  }
}

template <BackwardMode kMode, bool kDepth, TileCulling kCulling = TileCulling::kAll>
void takeOffSplats(const TileSplat* splats, size_t count, const TakeOffOptions& options,
                   BackwardPixels& pixels, float* sums) {
  constexpr bool kStatistics = kMode == BackwardMode::kStatistics;
  constexpr bool kContributions = kStatistics || kMode == BackwardMode::kContributions;
  constexpr bool kEdges = kMode == BackwardMode::kEdges;
  constexpr bool kWeights = kMode == BackwardMode::kWeights;
  constexpr bool kCullsRows = kCulling != TileCulling::kNothing;
  constexpr bool kCullsLanes = kCulling == TileCulling::kAll;
  constexpr size_t kFieldCount = backwardFieldCount({kMode, kDepth});
  const Tag d;
  const IntTag di;
  const size_t lanes = hn::Lanes(d);
  const Vec zero = hn::Zero(d);
  const Vec one = hn::Set(d, 1.0f);
  const Vec max_alpha = hn::Set(d, static_cast<float>(kMaxAlpha));
  const Vec lowest = hn::Set(d, -9.0f);  // dead lanes may hold -1e12
  const Vec squared_g_scale = hn::Set(d, static_cast<float>(kSquaredGScale));
  float judged[kFieldCount];

  for (size_t k = count; k-- > 0;) {
    const TileSplat& splat = splats[k];
    if (k < options.next.count) {
      __builtin_prefetch(&options.next.visible[options.next.slots[k]]);
    }
    float* out = sums + k * kFieldCount;
    const int32_t place = options.first + static_cast<int32_t>(k);
    bool is_judged = false;
    const auto this_place = hn::Set(di, place);
    const Vec low = hn::Set(d, kLog2MinAlpha - splat.doubt_low);
    const Vec high = hn::Set(d, kLog2MinAlpha + splat.doubt_high);
    const Vec l11 = hn::Set(d, splat.l11);
    const Vec red = hn::Set(d, splat.colour[0]);
    const Vec green = hn::Set(d, splat.colour[1]);
    const Vec blue = hn::Set(d, splat.colour[2]);
    Vec sum_g0 = zero, sum_g00 = zero, sum_g01 = zero;
    Vec sum_s = zero, sum_g1 = zero, sum_g11 = zero;
    Vec sum_red = zero, sum_green = zero, sum_blue = zero;
    Vec sum_contribution = zero, sum_weight = zero, sum_edge = zero, sum_error = zero;
    Vec sum_x = zero, sum_y = zero, sum_norm = zero, largest_error = zero;
    Vec sum_pixels = zero, sum_pixel_errors = zero, sum_distances = zero;
    Vec sum_depth = zero;
    constexpr float kLeast = static_cast<float>(kLeastSlope);
    const Vec inverse_l00 = hn::Set(d, kStatistics ? 1.0f / std::max(splat.l00, kLeast) : 0.0f);
    const Vec inverse_l11 = hn::Set(d, kStatistics ? 1.0f / std::max(splat.l11, kLeast) : 0.0f);
    const Vec most_offset = hn::Set(d, static_cast<float>(kMostOffset));
    const Vec least_offset = hn::Neg(most_offset);
    for (size_t column = 0; column < kTileSide; column += lanes) {
      const Vec x = hn::Iota(d, static_cast<float>(column));
      const Vec g0 = hn::MulAdd(hn::Set(d, splat.l00), x, hn::Set(d, splat.g0));
      const Vec most = hn::NegMulAdd(g0, g0, hn::Set(d, splat.log2_opacity));
      if (kCullsLanes && hn::AllFalse(d, hn::Gt(most, low))) continue;
      const Vec g1_first = hn::MulAdd(hn::Set(d, splat.l10), x, hn::Set(d, splat.g1));
      // g0 is that of the column: it is multiplied in once the rows are summed.
      Vec column_s = zero, column_g1 = zero;
      const uint32_t first_row = kCullsRows ? splat.row_begin : 0;
      const uint32_t end_row = kCullsRows ? splat.row_end : kTileSide;
      for (uint32_t y = first_row; y < end_row; ++y) {
        if (kCullsLanes && place >= pixels.row_end[y]) continue;
        const size_t i = static_cast<size_t>(y) * kTileSide + column;
        const Vec g1 = hn::MulAdd(l11, hn::Set(d, kRows[y]), g1_first);
        const Vec exponent = hn::NegMulAdd(g1, g1, most);
        const auto reached = hn::Gt(hn::Load(di, pixels.end + i), this_place);
        auto shows = hn::And(hn::Gt(exponent, low), hn::RebindMask(d, reached));
        if (kCullsLanes && hn::AllFalse(d, shows)) continue;
        const auto unclear = hn::And(shows, hn::Lt(exponent, high));
        if (HWY_UNLIKELY(!hn::AllFalse(d, unclear))) {
          if (!is_judged) std::fill(judged, judged + kFieldCount, 0.0f);
          is_judged = true;
          judgeLanes(d, unclear, k, i, options, pixels, judged);
          shows = hn::AndNot(unclear, shows);
        }

        const Vec free_alpha = exp2Small(d, hn::Max(exponent, lowest));
        const Vec alpha = hn::IfThenElseZero(shows, hn::Min(max_alpha, free_alpha));
        const Vec transmittance =
            hn::Div(hn::Load(d, pixels.transmittance + i), hn::Sub(one, alpha));
        hn::Store(transmittance, d, pixels.transmittance + i);
        const Vec weight = hn::Mul(transmittance, alpha);
        if constexpr (kWeights) {
          sum_weight = hn::Add(sum_weight, weight);
          continue;
        }
        const Vec by_red = hn::Load(d, pixels.gradient[0] + i);
        const Vec by_green = hn::Load(d, pixels.gradient[1] + i);
        const Vec by_blue = hn::Load(d, pixels.gradient[2] + i);
        Vec own = hn::MulAdd(red, by_red, hn::Load(d, pixels.gradient[3] + i));
        own = hn::MulAdd(green, by_green, own);
        own = hn::MulAdd(blue, by_blue, own);
        if constexpr (kDepth) {
          const Vec by_depth = hn::Load(d, pixels.depth_gradient + i);
          const Vec over = hn::Sub(hn::Set(d, splat.depth), hn::Load(d, pixels.depth + i));
          own = hn::MulAdd(over, by_depth, own);
          sum_depth = hn::MulAdd(weight, by_depth, sum_depth);
        }
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
            const Vec behind_c = hn::Load(d, pixels.signed_behind[c] + i);
            const Vec over = hn::MulSub(hn::Load(d, pixels.signed_weight[c] + i), colour, behind_c);
            hn::Store(hn::MulAdd(alpha, over, behind_c), d, pixels.signed_behind[c] + i);
            const Vec other = hn::NegMulAdd(weight, over, hn::Load(d, pixels.room[c] + i));
            return hn::Min(hn::Mul(weight, over), other);
          };
          Vec contribution = channel(0, red);
          contribution = hn::Add(contribution, channel(1, green));
          contribution = hn::Add(contribution, channel(2, blue));
          sum_contribution = hn::Add(sum_contribution, contribution);
        }
        if constexpr (kEdges) {
          sum_edge = hn::MulAdd(weight, hn::Load(d, pixels.edge + i), sum_edge);
        }
        if constexpr (kStatistics) {
          const Vec scaled = hn::Mul(squared_g_scale, s);
          const Vec along =
              hn::MulAdd(g0, hn::Set(d, splat.l00), hn::Mul(g1, hn::Set(d, splat.l10)));
          const Vec by_x = hn::Abs(hn::Mul(scaled, along));
          const Vec by_y = hn::Abs(hn::Mul(scaled, hn::Mul(g1, l11)));
          const Vec pixel_error = hn::Load(d, pixels.error + i);
          const Vec error = hn::Mul(weight, pixel_error);
          // Lanes where nothing shows may hold any number.
          const Vec shown_g0 = hn::IfThenElseZero(shows, g0);
          const Vec shown_g1 = hn::IfThenElseZero(shows, g1);
          const Vec dx = hn::Clamp(hn::Mul(shown_g0, inverse_l00), least_offset, most_offset);
          const Vec across = hn::NegMulAdd(hn::Set(d, splat.l10), dx, shown_g1);
          const Vec dy = hn::Clamp(hn::Mul(across, inverse_l11), least_offset, most_offset);
          const Vec distance = lengthOfLanes(d, hn::Abs(dx), hn::Abs(dy));
          sum_pixels = hn::Add(sum_pixels, hn::IfThenElseZero(shows, one));
          sum_pixel_errors = hn::Add(sum_pixel_errors, hn::IfThenElseZero(shows, pixel_error));
          sum_distances = hn::Add(sum_distances, hn::IfThenElseZero(shows, distance));
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
    if constexpr (kWeights) {
      out[kFieldWeightAlone] = sumOfLanes(d, sum_weight);
    } else {
      sumFour(d, sum_s, sum_g0, sum_g1, sum_g00, out);
      sumFour(d, sum_g01, sum_g11, sum_red, sum_green, out + kFieldG01);
      float four[4];
      sumFour(d, sum_blue, sum_contribution, sum_weight, sum_edge, four);
      out[kFieldBlue] = four[0];
      if constexpr (kEdges) out[kFieldEdgeAlone] = four[3];
      if constexpr (kContributions) out[kFieldContribution] = four[1];
      if constexpr (kStatistics) std::copy(four + 2, four + 4, out + kFieldWeight);
    }
    if constexpr (kStatistics) {
      sumFour(d, sum_x, sum_y, sum_norm, sum_error, out + kFieldAbsoluteX);
      out[kFieldLargestError] = hn::GetLane(hn::MaxOfLanes(d, largest_error));
      float three[4];
      sumFour(d, sum_pixels, sum_pixel_errors, sum_distances, zero, three);
      std::copy(three, three + 3, out + kFieldPixels);
    }
    if constexpr (kDepth) out[kFieldCount - 1] = sumOfLanes(d, sum_depth);
    if (HWY_UNLIKELY(is_judged)) {
      for (size_t field = 0; field < kFieldCount; ++field) {
        out[field] = kStatistics && field == kFieldLargestError
                         ? std::max(out[field], judged[field])
                         : out[field] + judged[field];
      }
    }
  }
}

template <bool kDepth>
void takeOffInMode(const TileSplat* splats, size_t count, const TakeOffOptions& options,
                   BackwardPixels& pixels, float* sums) {
  switch (options.wants.mode) {
    case BackwardMode::kGradients:
      return takeOffSplats<BackwardMode::kGradients, kDepth>(splats, count, options, pixels, sums);
    case BackwardMode::kContributions:
      return takeOffSplats<BackwardMode::kContributions, kDepth>(splats, count, options, pixels,
                                                                 sums);
    case BackwardMode::kStatistics:
      return takeOffSplats<BackwardMode::kStatistics, kDepth>(splats, count, options, pixels, sums);
    case BackwardMode::kEdges:  // comes without depth
      return takeOffSplats<BackwardMode::kEdges, false>(splats, count, options, pixels, sums);
    case BackwardMode::kWeights:  // the same
      return takeOffSplats<BackwardMode::kWeights, false>(splats, count, options, pixels, sums);
  }
}

void takeOffTile(const TileSplat* splats, size_t count, const TakeOffOptions& options,
                 BackwardPixels& pixels, float* sums) {
  if (options.culling != TileCulling::kAll && !options.wants.depth &&
      options.wants.mode == BackwardMode::kGradients) {
    constexpr BackwardMode kMode = BackwardMode::kGradients;
    if (options.culling == TileCulling::kRows) {
      takeOffSplats<kMode, false, TileCulling::kRows>(splats, count, options, pixels, sums);
    } else {
      takeOffSplats<kMode, false, TileCulling::kNothing>(splats, count, options, pixels, sums);
    }
  } else if (options.wants.depth) {
    takeOffInMode<true>(splats, count, options, pixels, sums);
  } else {
    takeOffInMode<false>(splats, count, options, pixels, sums);
  }
}

/// Without its `blend`.
BackwardKernel backwardKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), nullptr,
          takeOffTile};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <string>

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(backwardKernel);

std::vector<BackwardKernel> backwardKernels() {
  std::vector<BackwardKernel> kernels =
      onEveryTarget(BackwardKernel{"scalar", nullptr, takeOffTileScalar},
                    [] { return HWY_DYNAMIC_DISPATCH(backwardKernel)(); });
  const std::vector<NamedTileKernel> forward = tileKernels();
  for (BackwardKernel& kernel : kernels) {
    const auto same = std::find_if(forward.begin(), forward.end(), [&](const NamedTileKernel& f) {
      return std::string(f.target) == kernel.target;
    });
    kernel.blend = same->kernel;  // both are compiled for the same targets
  }
  return kernels;
}

namespace {

BackwardKernel chooseBackwardKernel() {
  const TileKernel forward = chosenTileKernel();
  const std::vector<BackwardKernel> kernels = backwardKernels();
  return *std::find_if(kernels.begin(), kernels.end(),
                       [&](const BackwardKernel& kernel) { return kernel.blend == forward; });
}

}  // namespace

const BackwardKernel& chosenBackwardKernel() {
  static const BackwardKernel kernel = chooseBackwardKernel();
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
