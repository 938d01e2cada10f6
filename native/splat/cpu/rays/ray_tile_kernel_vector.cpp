#include "splat/cpu/rays/ray_tile_kernel.h"

// Lanes are pixels of one tile row. The steps of meetTileScalar; products and sums are fused where
// the processor can, so targets differ by rounding.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/cpu/rays/ray_tile_kernel_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "splat/cpu/exp2-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

size_t meetTile(const RayTileSplat& splat, float near_plane, float far_plane, const float* open,
                RayMetPixels& met) {
  const hn::CappedTag<float, kTileSide> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const size_t lanes = hn::Lanes(d);
  const auto low = hn::Set(d, splat.log2_least);
  const auto near = hn::Set(d, near_plane), far = hn::Set(d, far_plane);
  const auto zero = hn::Zero(d), lowest = hn::Set(d, -120.0f);
  size_t count = 0;
  for (size_t column = 0; column < kTileSide; column += lanes) {
    const auto x = hn::Iota(d, static_cast<float>(column));
    const auto g0 = hn::MulAdd(hn::Set(d, splat.l00), x, hn::Set(d, splat.g0));
    const auto g1_first = hn::MulAdd(hn::Set(d, splat.l10), x, hn::Set(d, splat.g1));
    const auto w0_first = hn::MulAdd(hn::Set(d, splat.w00), x, hn::Set(d, splat.w0));
    const auto n_first = hn::MulAdd(hn::Set(d, splat.nx), x, hn::Set(d, splat.n));
    const auto square_first = hn::Mul(g0, g0);
    for (uint32_t row = splat.row_begin; row < splat.row_end; ++row) {
      const size_t i = size_t{row} * kTileSide + column;
      const auto y = hn::Set(d, static_cast<float>(row));
      const auto g1 = hn::MulAdd(hn::Set(d, splat.l11), y, g1_first);
      const auto w0 = hn::MulAdd(hn::Set(d, splat.w01), y, w0_first);
      const auto w1 = hn::MulAdd(hn::Set(d, splat.w11), y, hn::Set(d, splat.w1));
      const auto length = hn::MulAdd(w0, w0, hn::MulAdd(w1, w1, hn::Set(d, splat.rest)));
      const auto inverse = hn::Div(hn::Set(d, 1.0f), length);
      const auto exponent =
          hn::NegMulAdd(hn::MulAdd(g1, g1, square_first), inverse, hn::Set(d, splat.log2_opacity));
      const auto place = hn::Mul(hn::MulAdd(hn::Set(d, splat.ny), y, n_first), inverse);
      auto shows = hn::And(hn::Gt(exponent, low), hn::Ne(hn::Load(d, open + i), zero));
      shows = hn::And(shows, hn::And(hn::Ge(place, near), hn::Le(place, far)));
      if (hn::AllFalse(d, shows)) continue;
      hn::CompressStore(exponent, shows, d, met.exponent + count);
      // A dead lane's exponent may be anything; exp2Small wants at least -126.
      const auto alpha = exp2Small(d, hn::Min(hn::Max(exponent, lowest), hn::Set(d, 1.0f)));
      hn::CompressStore(alpha, shows, d, met.alpha + count);
      hn::CompressStore(place, shows, d, met.place + count);
      const auto pixels = hn::Iota(du, static_cast<uint32_t>(i));
      count += hn::CompressStore(pixels, hn::RebindMask(du, shows), du, met.pixel + count);
    }
  }
  return count;
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
NamedRayTileKernel namedRayKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), meetTile};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedRayKernel);

namespace {

NamedRayTileKernel dispatched() {
  return HWY_DYNAMIC_DISPATCH(namedRayKernel)();
}

}  // namespace

std::vector<NamedRayTileKernel> rayTileKernels() {
  return onEveryTarget(NamedRayTileKernel{"scalar", meetTileScalar}, dispatched);
}

RayTileKernel chosenRayTileKernel() {
  static const RayTileKernel chosen = chooseKernel(dispatched(), rayTileKernels).kernel;
  return chosen;
}

}  // namespace stipple

#endif  // HWY_ONCE
