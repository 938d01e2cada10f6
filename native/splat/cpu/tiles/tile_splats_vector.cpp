#include "splat/cpu/tiles/tile_splats.h"

// Lanes are splats. Their fields are first copied into columns, since splats of a tile lie far
// apart in memory; then the steps of tile_splat_steps-inl.h in double.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/cpu/tiles/tile_splats_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "splat/cpu/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, 8>;
using Floats = hn::Rebind<float, Doubles>;
using Ints = hn::Rebind<int32_t, Doubles>;
using Double = Lanes<Doubles>;

constexpr size_t kMaxLanes = 8;

#include "splat/cpu/tiles/tile_splat_steps-inl.h"

HWY_INLINE hn::Vec<Floats> narrowed(Double value) {
  return hn::DemoteTo(Floats(), value.v);
}

float makeSplats(const VisibleSplat* visible, const Tile& tile, size_t begin, size_t count,
                 TileSplat* out) {
  const Doubles d;
  const Floats floats;
  const Ints ints;
  const size_t lanes = hn::Lanes(d);
  HWY_ALIGN TileSplatColumns columns;
  gatherTileSplats(visible, tile, begin, count, columns, out);
  for (size_t i = count; i % lanes != 0; ++i) {
    for (auto& column : columns) column[i] = column[count - 1];
  }
  // Four or two fields of a splat at a time, as they lie in a TileSplat.
  static_assert(offsetof(TileSplat, g0) == 0 && offsetof(TileSplat, l10) == 12 &&
                offsetof(TileSplat, doubt_high) == offsetof(TileSplat, l11) + 8 &&
                offsetof(TileSplat, row_end) == offsetof(TileSplat, row_begin) + 4);
  HWY_ALIGN float first[4 * kMaxLanes], second[4 * kMaxLanes];
  HWY_ALIGN int32_t rows[2 * kMaxLanes];
  const Double x0(tile.x0 + 0.5), y0(tile.y0 + 0.5);
  const Double most(static_cast<double>(kMaxFloatReach)), never(static_cast<double>(kFinished));
  const auto side = hn::Set(ints, static_cast<int32_t>(kTileSide));
  const double reach = static_cast<double>(tile.cut_off.reach);
  Double largest;
  for (size_t i = 0; i < count; i += lanes) {
    Double fields[kTileSplatFields];
    for (size_t k = 0; k < kTileSplatFields; ++k) fields[k] = Double(hn::Load(d, columns[k] + i));
    TileSplatSteps<Double> made;
    tileSplatSteps(fields, x0, y0, reach, made);
    largest = max(largest, made.largest);
    hn::StoreInterleaved4(narrowed(made.g0), narrowed(made.g1), narrowed(made.l00),
                          narrowed(made.l10), floats, first);
    const Double doubt_high = pick(made.largest > most, never, made.doubt_low);
    hn::StoreInterleaved4(narrowed(made.l11), narrowed(made.doubt_low), narrowed(doubt_high),
                          hn::Zero(floats), floats, second);
    hn::StoreInterleaved2(hn::Sub(side, hn::DemoteTo(ints, made.below.v)),
                          hn::DemoteTo(ints, made.above.v), ints, rows);
    const size_t here = std::min(lanes, count - i);
    for (size_t lane = 0; lane < here; ++lane) {
      char* to = reinterpret_cast<char*>(out + i + lane);
      std::memcpy(to, first + lane * 4, 4 * sizeof(float));
      std::memcpy(to + offsetof(TileSplat, l11), second + lane * 4, 4 * sizeof(float));
      std::memcpy(to + offsetof(TileSplat, row_begin), rows + lane * 2, 2 * sizeof(int32_t));
    }
  }
  HWY_ALIGN double each[kMaxLanes];
  hn::Store(largest.v, d, each);
  return static_cast<float>(*std::max_element(each, each + lanes));
}

NamedTileSplatMaker namedMaker() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), makeSplats};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedMaker);

namespace {

NamedTileSplatMaker dispatched() {
  return HWY_DYNAMIC_DISPATCH(namedMaker)();
}

}  // namespace

std::vector<NamedTileSplatMaker> tileSplatMakers() {
  return onEveryTarget(NamedTileSplatMaker{"scalar", makeTileSplatsScalar}, dispatched);
}

TileSplatMaker chosenTileSplatMaker() {
  static const TileSplatMaker chosen = chooseKernel(dispatched(), tileSplatMakers).make;
  return chosen;
}

}  // namespace stipple

#endif  // HWY_ONCE
