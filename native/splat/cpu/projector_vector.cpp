#include "splat/cpu/projector.h"

// Lanes are splats, in double: the steps of splat/render/projection.h on a vector type, so every lane gets
// the bits of the scalar code (no fused products). Harmonics go in float: their basis with lanes =
// splats, their sums with lanes = colours.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/cpu/projector_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "hwy/contrib/math/math-inl.h"
#include "splat/cpu/lanes-inl.h"
#include "splat/cpu/load_geometry-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, 8>;
using Floats = hn::Rebind<float, Doubles>;
using Quad = hn::CappedTag<float, 4>;

using Double = Lanes<Doubles>;
using Float = Lanes<Floats>;

constexpr size_t kMaxLanes = 8;
constexpr size_t kPrefetchGroups = 6;  // of lanes: 2 to 6 KB ahead

#include "math/harmonic_basis-inl.h"
#include "splat/render/projection_steps-inl.h"

HWY_INLINE Double wholePart(Double value) {
  return Double(hn::Trunc(value.v));
}

#include "splat/cpu/tiles/tile_span_steps-inl.h"

using Word = hn::Rebind<uint64_t, Doubles>;

/// A whole number of 0..2^51.
HWY_INLINE hn::Vec<Word> wordOf(Double value) {
  const Doubles d;
  const Word dw;
  const auto shift = hn::Set(d, 0x1p52);  // brings the number into the low bits
  return hn::Xor(hn::BitCast(dw, hn::Add(value.v, shift)), hn::BitCast(dw, shift));
}

/// As tileSpanOf.
HWY_INLINE hn::Vec<Word> tileSpans(const Projected<Double>& splat, const TileGrid& grid) {
  const Doubles d;
  const Word dw;
  const Double rows(grid.rows), columns(grid.columns), zero(0.0), one(1.0);
  SpanBox<Double> box;
  spanBox(splat.footprint, splat.half_x, splat.half_y, columns, rows, box);
  const Double row_count = box.last_row - box.first_row + one;
  const Double column_count = box.last_column - box.first_column + one;
  const auto fits = hn::And(Double(kSpanRows) >= row_count, Double(kSpanColumns) >= column_count);
  // One row or column of tiles: the box is exact.
  const auto is_box = hn::Or(one >= row_count, one >= column_count);
  const bool has_edges = !hn::AllTrue(d, hn::Or(is_box, hn::Not(fits)));
  auto mask = hn::Zero(dw);
  for (uint32_t k = 0; k < kSpanRows; ++k) {
    const auto present = hn::And(fits, row_count > Double(k));
    if (hn::AllFalse(d, present)) break;
    Double first = box.first_column, last = box.last_column;
    if (has_edges) {
      rowColumns(box, box.first_row + Double(k), columns, first, last);
      first = pick(is_box, box.first_column, first);
      last = pick(is_box, box.last_column, last);
    }
    const auto ones = hn::Set(dw, 1);
    const auto met = hn::Sub(hn::Shl(ones, wordOf(max(last - first + one, zero))), ones);
    const Double at =
        min(first - box.first_column, Double(kSpanColumns)) + Double(k * kSpanColumns);
    mask = hn::Or(mask, hn::IfThenElseZero(hn::RebindMask(dw, present), hn::Shl(met, wordOf(at))));
  }
  const auto place = hn::Or(hn::ShiftLeft<48>(wordOf(max(box.first_row, zero))),
                            hn::ShiftLeft<32>(wordOf(max(box.first_column, zero))));
  const auto meets = hn::Ne(mask, hn::Zero(dw));
  return hn::IfThenElse(hn::RebindMask(dw, fits), hn::IfThenElseZero(meets, hn::Or(mask, place)),
                        hn::Set(dw, kWideSpan));
}

/// Asks for the harmonics of rows [row, row + count), which may lie behind the end: they are much
/// longer than what the processor fetches ahead by itself.
HWY_INLINE void prefetchRows(const SplatCloud& cloud, size_t row, size_t count) {
  const size_t stride = cloud.shStride();
  const size_t end = std::min((row + count) * stride, cloud.sh.size());
  constexpr size_t kLineFloats = 16;
  for (size_t i = row * stride; i < end; i += kLineFloats) __builtin_prefetch(&cloud.sh[i]);
}

/// Harmonics in the direction of each lane. Out: basis [coefficient][lane]; lanes outside `shows`
/// are finite.
HWY_INLINE void directionBasis(const PlacedScene& scene, const PlacedCloud& placed,
                               const Double* position, hn::Mask<Doubles> shows, float* basis) {
  Double direction[3];
  for (int axis = 0; axis < 3; ++axis) {
    const Double eye(placed.eye[axis]);
    direction[axis] = scene.view.perspective ? position[axis] - eye : eye;
    direction[axis] = pick(shows, direction[axis], Double(1.0));
  }
  const Double inverse =
      Double(1.0) /
      sqrt(direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]);
  Float unit[3];
  for (int axis = 0; axis < 3; ++axis) {
    unit[axis] = Float(hn::DemoteTo(Floats(), (direction[axis] * inverse).v));
  }
  Float values[25];
  harmonicBasis(placed.sh_degree, unit[0], unit[1], unit[2], values);
  const size_t count = shCoefficientCount(placed.sh_degree);
  for (size_t k = 0; k < count; ++k) hn::Store(values[k].v, Floats(), basis + k * kMaxLanes);
}

#if HWY_TARGET != HWY_SCALAR
/// Sums of at least two coefficients; colours come in lanes 1..3: each row is loaded with the
/// number before it, which belongs to the splat, and none behind it, which may lie outside the
/// array. The first is moved up in a register: a vector that is loaded right after its numbers were
/// stored one by one waits for every store before them, to splats that are not in the cache yet.
HWY_INLINE void sumInQuads(size_t count, const float* sh, const float* basis, float (&sums)[4]) {
  const Quad d;
  const auto first = hn::ShiftLeftLanes<1>(d, hn::LoadU(d, sh));
  auto sum = hn::Add(hn::Set(d, 0.5f), hn::Mul(hn::Set(d, kShC0), first));
  for (size_t k = 1; k < count; ++k) {
    sum = hn::Add(sum, hn::Mul(hn::Set(d, basis[k * kMaxLanes]), hn::LoadU(d, sh + k * 3 - 1)));
  }
  hn::StoreU(sum, d, sums);
}
constexpr bool kHasQuads = true;
#else
HWY_INLINE void sumInQuads(size_t, const float*, const float*, float (&)[4]) {}
constexpr bool kHasQuads = false;
#endif

/// As splatColour<float>. In: basis of this lane, kMaxLanes apart.
HWY_INLINE void sumHarmonics(const PlacedCloud& placed, const float* sh, const float* basis,
                             float* colour) {
  float sums[4];
  const size_t count = shCoefficientCount(placed.sh_degree);
  if (kHasQuads && count > 1) {
    sumInQuads(count, sh, basis, sums);
  } else {
    for (size_t c = 0; c < 3; ++c) {
      float sum = 0.5f + kShC0 * sh[c];
      for (size_t k = 1; k < count; ++k) sum += basis[k * kMaxLanes] * sh[k * 3 + c];
      sums[c + 1] = sum;
    }
  }
  std::copy(sums + 1, sums + 4, colour);
  finishColour(placed, colour);
}

size_t projectRows(const PlacedScene& scene, const PlacedCloud& placed, size_t begin, size_t end,
                   const ProjectedSlots& to, size_t slot) {
  const TileGrid grid = gridOf(scene);
  const Doubles d;
  const size_t lanes = hn::Lanes(d);
  const View<double>& view = scene.view;
  const SplatCloud& cloud = *placed.cloud;
  const size_t sh_stride = cloud.shStride();
  const bool fades = placed.grade.opacity != 1.0;
  HWY_ALIGN double columns[9][kMaxLanes];
  HWY_ALIGN TileSpan spans[kMaxLanes];
  HWY_ALIGN float log2_opacity[kMaxLanes];
  HWY_ALIGN float depth[kMaxLanes];
  HWY_ALIGN float basis[25 * kMaxLanes];
  const Double one(1.0);

  size_t row = begin;
  for (; row + lanes <= end; row += lanes) {
    prefetchRows(cloud, row + kPrefetchGroups * lanes, lanes);
    SplatGeometry<Double> splat;
    loadGeometry(cloud, row, splat);
    if (fades) splat.opacity = splat.opacity * Double(placed.grade.opacity);
    Double centre[3];
    placePoint(placed.linear, placed.translation, splat.position, centre);
    auto shows =
        hn::And(splat.opacity >= Double(view.least_alpha),
                hn::And(centre[2] >= Double(view.near_plane), Double(view.far_plane) >= centre[2]));
    if (hn::AllFalse(d, shows)) continue;
    for (Double& value : centre) value = pick(shows, value, one);
    Projected<Double> out;
    const Double narrowest =
        HWY_NAMESPACE::projectSteps(view, placed.linear, centre, splat, placed.low_pass, out);
    const Footprint<Double>& f = out.footprint;
    const Double half_pixel(0.5);
    shows = hn::And(shows,
                    hn::And(narrowest > Double(kMinWidth), f.opacity >= Double(view.least_alpha)));
    shows = hn::And(shows, hn::And(f.mean_x + out.half_x >= half_pixel,
                                   Double(view.width) - half_pixel >= f.mean_x - out.half_x));
    shows = hn::And(shows, hn::And(f.mean_y + out.half_y >= half_pixel,
                                   Double(view.height) - half_pixel >= f.mean_y - out.half_y));
    if (hn::AllFalse(d, shows)) continue;

    const Double fields[9] = {f.mean_x,  f.mean_y,   f.l00,      f.l10,    f.l11,
                              f.opacity, out.half_x, out.half_y, out.depth};
    for (size_t k = 0; k < 9; ++k) hn::Store(fields[k].v, d, columns[k]);
    hn::Store(tileSpans(out, grid), Word(), spans);
    const Double log2e(1.4426950408889634);
    const Double log2o = log(pick(shows, f.opacity, one)) * log2e;
    hn::Store(hn::DemoteTo(Floats(), log2o.v), Floats(), log2_opacity);
    const Double held = min(pick(shows, out.depth, one), Double(1e38));
    hn::Store(hn::DemoteTo(Floats(), held.v), Floats(), depth);
    if (placed.sh_degree > 0) directionBasis(scene, placed, splat.position, shows, basis);

    HWY_ALIGN uint8_t bits[8] = {};
    hn::StoreMaskBits(d, shows, bits);
    for (uint32_t left = bits[0]; left != 0; left &= left - 1) {
      const size_t lane = static_cast<size_t>(__builtin_ctz(left));
      VisibleSplat& visible = to.splats[slot];
      visible.mean_x = columns[0][lane];
      visible.mean_y = columns[1][lane];
      visible.l00 = columns[2][lane];
      visible.l10 = columns[3][lane];
      visible.l11 = columns[4][lane];
      visible.half_y = heldHalf(columns[7][lane]);
      visible.log2_opacity = log2_opacity[lane];
      visible.depth = depth[lane];
      sumHarmonics(placed, &cloud.sh[(row + lane) * sh_stride], basis + lane, visible.colour);
      to.extras[slot] = {columns[5][lane], columns[6][lane],
                         static_cast<uint32_t>(placed.first_index + row + lane)};
      to.spans[slot] = spans[lane];
      to.items[slot] = depthItem(columns[8][lane], slot);
      ++slot;
    }
  }
  return projectScalar(scene, placed, row, end, to, slot);
}

NamedProjector namedProjector() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), projectRows};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedProjector);

namespace {

NamedProjector dispatched() {
  return HWY_DYNAMIC_DISPATCH(namedProjector)();
}

}  // namespace

std::vector<NamedProjector> projectors() {
  return onEveryTarget(NamedProjector{"scalar", projectScalar}, dispatched);
}

Projector chosenProjector() {
  static const Projector chosen = chooseKernel(dispatched(), projectors).project;
  return chosen;
}

}  // namespace stipple

#endif  // HWY_ONCE
