#include "splat/cpu/tiles/tile_kernel.h"

#include <cmath>

// Lanes are pixels of one tile row. The same steps as tile_kernel_scalar.cpp with masks in place of
// branches; products and sums are fused where the processor can, so targets differ by rounding.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/cpu/tiles/tile_kernel_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "splat/cpu/exp2-inl.h"
#include "splat/render/blend.h"
#include "splat/render/effects.h"

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, kTileSide>;
using Vec = hn::Vec<Tag>;

/// Puts the judge's alpha into the lanes of `unclear`. In: first, the pixel of lane 0.
HWY_NOINLINE Vec judgedAlpha(Tag d, hn::Mask<Tag> unclear, Vec alpha, size_t splat, size_t first,
                             const TileKernelOptions& options) {
  HWY_ALIGN float values[kTileSide];
  HWY_ALIGN float asked[kTileSide];
  hn::Store(alpha, d, values);
  hn::Store(hn::IfThenElseZero(unclear, hn::Set(d, 1.0f)), d, asked);
  for (size_t lane = 0; lane < hn::Lanes(d); ++lane) {
    if (asked[lane] == 0.0f) continue;
    values[lane] = static_cast<float>(
        options.judge(options.judge_context, splat, static_cast<uint32_t>(first + lane)));
  }
  return hn::Load(d, values);
}

/// Where splats end pixels, in `ends`; `doubtful` are those of them that float32 cannot decide.
template <typename Mask>
void endPixels(Tag d, Mask ends, Mask doubtful, int32_t place, size_t i, TilePixels& pixels) {
  const Vec cut = hn::Load(d, pixels.cut + i);
  hn::Store(hn::IfThenElse(ends, hn::Set(d, kFinished), cut), d, pixels.cut + i);
  const hn::RebindToSigned<Tag> di;
  hn::BlendedStore(hn::Set(di, place), hn::RebindMask(di, ends), di, pixels.end + i);
  const Vec doubt = hn::Load(d, pixels.doubt + i);
  hn::Store(hn::IfThenElse(doubtful, hn::Set(d, 1.0f), doubt), d, pixels.doubt + i);
  pixels.unfinished -= static_cast<uint32_t>(hn::CountTrue(d, ends));
}

/// The surfaces in the lanes of `behind`, whose splats are behind them: once for every pixel.
/// Returns the lanes that end.
template <bool kExtras>
HWY_NOINLINE hn::Mask<Tag> passSurfaces(Tag d, hn::Mask<Tag> behind, const TileSplat& splat,
                                        const TileKernelOptions& options, int32_t place, size_t i,
                                        TilePixels& pixels) {
  const Vec min_transmittance = hn::Set(d, static_cast<float>(kMinTransmittance));
  const Vec before = hn::Load(d, pixels.transmittance + i);
  const Vec next = hn::Mul(before, hn::Load(d, pixels.passes + i));
  const Vec wall = hn::Load(d, pixels.wall + i);
  hn::Store(hn::IfThenElse(behind, before, hn::Load(d, pixels.before + i)), d, pixels.before + i);
  hn::Store(hn::IfThenElse(behind, next, before), d, pixels.transmittance + i);
  hn::Store(hn::IfThenElse(behind, hn::Set(d, kNoSurface), wall), d, pixels.wall + i);
  const Vec finish_doubt = hn::Set(d, static_cast<float>(kMinTransmittance) * splat.finish_doubt);
  auto near = hn::Lt(hn::Abs(hn::Sub(next, min_transmittance)), finish_doubt);
  if constexpr (kExtras) {
    const Vec half = hn::Set(d, 0.5f), median_doubt = hn::Set(d, 0.5f * options.median_doubt);
    near = hn::Or(near, hn::Lt(hn::Abs(hn::Sub(next, half)), median_doubt));
    const Vec median = hn::Load(d, pixels.median_depth + i);
    const auto passes =
        hn::And(behind, hn::And(hn::Lt(next, half), hn::Eq(median, hn::Set(d, kNoMedian))));
    if (options.surface_shows) {
      hn::Store(hn::IfThenElse(passes, wall, median), d, pixels.median_depth + i);
    }
  }
  const auto doubtful = hn::And(behind, near);
  const auto ends = hn::Or(doubtful, hn::And(behind, hn::Lt(next, min_transmittance)));
  if (!hn::AllFalse(d, ends)) endPixels(d, ends, doubtful, place, i, pixels);
  return ends;
}

template <bool kDepth, bool kCoverage, bool kExtras, bool kSurface = false,
          TileCulling kCulling = TileCulling::kAll>
void blendSplats(const TileSplat* splats, size_t count, const TileKernelOptions& options,
                 TilePixels& pixels) {
  constexpr bool kCullsRows = kCulling != TileCulling::kNothing;
  constexpr bool kCullsLanes = kCulling == TileCulling::kAll;
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  const Vec max_alpha = hn::Set(d, static_cast<float>(kMaxAlpha));
  const Vec min_transmittance = hn::Set(d, static_cast<float>(kMinTransmittance));
  const Vec half = hn::Set(d, 0.5f);
  const Vec median_doubt = hn::Set(d, 0.5f * options.median_doubt);
  const Vec finished = hn::Set(d, kFinished);
  const float log2_least = options.log2_least;
  // A dead lane's exponent may be -1e12; exp2Small wants at least -120.
  const Vec lowest = hn::Set(d, std::floor(log2_least) - 1.0f);

  for (size_t s = 0; s < count && pixels.unfinished > 0; ++s) {
    const TileSplat& splat = splats[s];
    if (s < options.next.count) {
      __builtin_prefetch(&options.next.visible[options.next.slots[s]]);
    }
    const Vec low = hn::Set(d, log2_least - splat.doubt_low);
    const Vec high = hn::Set(d, log2_least + splat.doubt_high);
    const Vec finish_doubt = hn::Set(d, static_cast<float>(kMinTransmittance) * splat.finish_doubt);
    const Vec l11 = hn::Set(d, splat.l11);
    for (size_t column = 0; column < kTileSide; column += lanes) {
      const Vec x = hn::Iota(d, static_cast<float>(column));
      const Vec g0 = hn::MulAdd(hn::Set(d, splat.l00), x, hn::Set(d, splat.g0));
      const Vec most = hn::NegMulAdd(g0, g0, hn::Set(d, splat.log2_opacity));
      if (kCullsLanes && hn::AllFalse(d, hn::Gt(most, low))) continue;
      const Vec g1_first = hn::MulAdd(hn::Set(d, splat.l10), x, hn::Set(d, splat.g1));
      const uint32_t first_row = kCullsRows ? splat.row_begin : 0;
      const uint32_t end_row = kCullsRows ? splat.row_end : kTileSide;
      for (uint32_t y = first_row; y < end_row; ++y) {
        const size_t i = static_cast<size_t>(y) * kTileSide + column;
        const Vec g1 = hn::MulAdd(l11, hn::Set(d, static_cast<float>(y)), g1_first);
        const Vec exponent = hn::NegMulAdd(g1, g1, most);
        const Vec cut = hn::Load(d, pixels.cut + i);
        auto touched = hn::And(hn::Gt(exponent, low), hn::Lt(cut, finished));
        if (kCullsLanes && hn::AllFalse(d, touched)) continue;
        if constexpr (kSurface) {
          const auto behind =
              hn::And(touched, hn::Gt(hn::Set(d, splat.depth), hn::Load(d, pixels.wall + i)));
          if (HWY_UNLIKELY(!hn::AllFalse(d, behind))) {
            const auto ended = passSurfaces<kExtras>(
                d, behind, splat, options, options.first + static_cast<int32_t>(s), i, pixels);
            touched = hn::AndNot(ended, touched);
          }
        }

        auto unclear = hn::And(touched, hn::Lt(exponent, high));
        auto shows = hn::AndNot(unclear, touched);
        Vec alpha = hn::Min(max_alpha, exp2Small(d, hn::Max(exponent, lowest)));
        if (HWY_UNLIKELY(!hn::AllFalse(d, unclear)) && options.judge) {
          alpha = judgedAlpha(d, unclear, alpha, s, i, options);
          shows = hn::Or(shows, hn::And(unclear, hn::Gt(alpha, hn::Zero(d))));
          unclear = hn::AndNot(unclear, unclear);
        }
        const Vec before = hn::Load(d, pixels.transmittance + i);
        const Vec next = hn::NegMulAdd(before, alpha, before);
        auto near = hn::Lt(hn::Abs(hn::Sub(next, min_transmittance)), finish_doubt);
        if constexpr (kExtras) {
          near = hn::Or(near, hn::Lt(hn::Abs(hn::Sub(next, half)), median_doubt));
        }
        const auto doubtful = hn::Or(unclear, hn::And(shows, near));
        const auto ends = hn::Or(doubtful, hn::And(shows, hn::Lt(next, min_transmittance)));
        const auto blends = hn::AndNot(ends, shows);

        const Vec weight = hn::IfThenElseZero(blends, hn::Mul(before, alpha));
        const auto accumulate = [&](float* plane, float value) {
          hn::Store(hn::MulAdd(weight, hn::Set(d, value), hn::Load(d, plane + i)), d, plane + i);
        };
        hn::Store(hn::IfThenElse(blends, next, before), d, pixels.transmittance + i);
        accumulate(pixels.red, splat.colour[0]);
        accumulate(pixels.green, splat.colour[1]);
        accumulate(pixels.blue, splat.colour[2]);
        if constexpr (kDepth) accumulate(pixels.weighted_depth, splat.depth);
        if constexpr (kCoverage) {
          hn::Store(hn::Add(weight, hn::Load(d, pixels.coverage + i)), d, pixels.coverage + i);
        }
        if constexpr (kExtras) {
          const Vec median = hn::Load(d, pixels.median_depth + i);
          const auto passes =
              hn::And(blends, hn::And(hn::Lt(next, half), hn::Eq(median, hn::Set(d, kNoMedian))));
          hn::Store(hn::IfThenElse(passes, hn::Set(d, splat.depth), median), d,
                    pixels.median_depth + i);
          const Vec counted = hn::IfThenElseZero(blends, hn::Set(d, 1.0f));
          hn::Store(hn::Add(hn::Load(d, pixels.count + i), counted), d, pixels.count + i);
        }
        if (!hn::AllFalse(d, ends)) {
          endPixels(d, ends, doubtful, options.first + static_cast<int32_t>(s), i, pixels);
        }
      }
    }
  }
}

template <bool kExtras>
void blendWithExtras(const TileSplat* splats, size_t count, const TileKernelOptions& options,
                     TilePixels& pixels) {
  if (options.with_surface && options.with_depth) {
    blendSplats<true, false, kExtras, true>(splats, count, options, pixels);
  } else if (options.with_surface) {
    blendSplats<false, false, kExtras, true>(splats, count, options, pixels);
  } else if (!options.with_depth) {
    blendSplats<false, false, kExtras>(splats, count, options, pixels);
  } else if (!options.with_coverage) {
    blendSplats<true, false, kExtras>(splats, count, options, pixels);
  } else {
    blendSplats<true, true, kExtras>(splats, count, options, pixels);
  }
}

void blendTile(const TileSplat* splats, size_t count, TileKernelOptions options,
               TilePixels& pixels) {
  if constexpr (!kHasEffects) {
    blendSplats<false, false, false>(splats, count, options, pixels);
  } else if (options.culling != TileCulling::kAll && options.with_depth && !options.with_extras) {
    if (options.culling == TileCulling::kRows) {
      blendSplats<true, false, false, false, TileCulling::kRows>(splats, count, options, pixels);
    } else {
      blendSplats<true, false, false, false, TileCulling::kNothing>(splats, count, options, pixels);
    }
  } else if (options.with_extras) {
    blendWithExtras<true>(splats, count, options, pixels);
  } else {
    blendWithExtras<false>(splats, count, options, pixels);
  }
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
NamedTileKernel namedKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), blendTile};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedKernel);

std::vector<NamedTileKernel> tileKernels() {
  return onEveryTarget(NamedTileKernel{"scalar", blendTileScalar},
                       [] { return HWY_DYNAMIC_DISPATCH(namedKernel)(); });
}

TileKernel chosenTileKernel() {
  static const TileKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedKernel)(), tileKernels).kernel;
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
