#include "motion/motion_kernel.h"

// moving_splat.h with lanes along the splats; products and sums are fused where the processor can,
// so targets differ by rounding.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "motion/motion_kernel_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;

struct Triple {
  Vec x, y, z;
};

struct Quadruple {
  Vec w, x, y, z;
};

HWY_INLINE Triple loadTriple(Tag d, const float* column, size_t row) {
  Triple t;
  hn::LoadInterleaved3(d, column + 3 * row, t.x, t.y, t.z);
  return t;
}

HWY_INLINE Quadruple loadQuadruple(Tag d, const float* column, size_t row) {
  Quadruple q;
  hn::LoadInterleaved4(d, column + 4 * row, q.w, q.x, q.y, q.z);
  return q;
}

HWY_INLINE Vec dot(const Quadruple& a, const Quadruple& b) {
  return hn::MulAdd(a.w, b.w, hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z))));
}

/// What stretchedOffset() says.
HWY_INLINE Vec offsetOf(Tag d, const TimeWindow& window, float time, Vec centre) {
  const Vec now = hn::Set(d, time);
  if (window.half <= 0) return hn::Sub(now, centre);
  const Vec whole = hn::Set(d, static_cast<float>(2 * window.half));
  const Vec latest = hn::Sub(hn::Set(d, 1.0f), whole);
  const Vec half = hn::Set(d, static_cast<float>(window.half));
  const Vec begin = hn::Min(hn::Max(hn::Sub(centre, half), hn::Zero(d)), latest);
  const Vec inside = hn::Min(hn::Max(now, begin), hn::Add(begin, whole));
  const Vec near = hn::Mul(hn::Sub(inside, centre), hn::Set(d, static_cast<float>(window.near)));
  return hn::MulAdd(hn::Sub(now, inside), hn::Set(d, static_cast<float>(window.far)), near);
}

struct Wave {
  Vec cosine, sine;
};

/// harmonicWave(). Half turns are taken off; what is left, at most a quarter turn, goes into the
/// Taylor series of both, whose next terms are below 1e-8 there. Whole numbers stay in float, since
/// a phase may be any.
HWY_INLINE Wave waveOf(Tag d, float k, Vec offset, Vec phase) {
  constexpr double kTurn = 2 * std::numbers::pi;
  const auto number = [d](double value) { return hn::Set(d, static_cast<float>(value)); };
  const Vec turns =
      hn::MulAdd(number(static_cast<double>(k)), offset, hn::Mul(phase, number(1 / kTurn)));
  const Vec halves = hn::Round(hn::Add(turns, turns));
  const Vec angle = hn::Mul(hn::NegMulAdd(halves, number(0.5), turns), number(kTurn));
  const Vec odd = hn::NegMulAdd(hn::Round(hn::Mul(halves, number(0.5))), number(2), halves);
  const Vec sign = hn::NegMulAdd(hn::Abs(odd), number(2), number(1));
  const Vec x2 = hn::Mul(angle, angle);
  Vec sine = number(1.0 / 6227020800);
  sine = hn::MulAdd(sine, x2, number(-1.0 / 39916800));
  sine = hn::MulAdd(sine, x2, number(1.0 / 362880));
  sine = hn::MulAdd(sine, x2, number(-1.0 / 5040));
  sine = hn::MulAdd(sine, x2, number(1.0 / 120));
  sine = hn::MulAdd(sine, x2, number(-1.0 / 6));
  sine = hn::MulAdd(hn::Mul(sine, x2), angle, angle);
  Vec cosine = number(1.0 / 479001600);
  cosine = hn::MulAdd(cosine, x2, number(-1.0 / 3628800));
  cosine = hn::MulAdd(cosine, x2, number(1.0 / 40320));
  cosine = hn::MulAdd(cosine, x2, number(-1.0 / 720));
  cosine = hn::MulAdd(cosine, x2, number(1.0 / 24));
  cosine = hn::MulAdd(cosine, x2, number(-0.5));
  cosine = hn::MulAdd(cosine, x2, number(1));
  return {hn::Mul(cosine, sign), hn::Mul(sine, sign)};
}

HWY_INLINE Vec phaseOf(const Quadruple& phases, size_t k) {
  return k == 1 ? phases.w : k == 2 ? phases.x : k == 3 ? phases.y : phases.z;
}

struct Turned {
  Quadruple unit;
  Vec inverse_length;
};

HWY_INLINE Turned turnedOf(Tag d, const Quadruple& rotation, const Quadruple& spin, Vec offset) {
  Quadruple turned = {
      hn::MulAdd(offset, spin.w, rotation.w), hn::MulAdd(offset, spin.x, rotation.x),
      hn::MulAdd(offset, spin.y, rotation.y), hn::MulAdd(offset, spin.z, rotation.z)};
  Vec length = hn::Sqrt(dot(turned, turned));
  const auto lost = hn::Lt(length, hn::Set(d, static_cast<float>(kNoRotation)));
  if (!hn::AllFalse(d, lost)) {
    turned = {
        hn::IfThenElse(lost, rotation.w, turned.w), hn::IfThenElse(lost, rotation.x, turned.x),
        hn::IfThenElse(lost, rotation.y, turned.y), hn::IfThenElse(lost, rotation.z, turned.z)};
    length = hn::Sqrt(dot(turned, turned));
  }
  const Vec inverse = hn::Div(hn::Set(d, 1.0f), length);
  return {{hn::Mul(turned.w, inverse), hn::Mul(turned.x, inverse), hn::Mul(turned.y, inverse),
           hn::Mul(turned.z, inverse)},
          inverse};
}

struct Fading {
  hn::Mask<Tag> before;
  Vec ratio, lifespan, share;
};

HWY_INLINE Fading fadingOf(Tag d, const float* lifespans, size_t row, Vec offset) {
  Vec left, right;
  hn::LoadInterleaved2(d, lifespans + 2 * row, left, right);
  Fading fading;
  fading.before = hn::Lt(offset, hn::Zero(d));
  fading.lifespan = hn::IfThenElse(fading.before, left, right);
  fading.ratio = hn::Div(offset, fading.lifespan);
  // Exp makes whole numbers of its argument, which those far below its range would trap.
  const Vec squared = hn::Min(hn::Mul(fading.ratio, fading.ratio), hn::Set(d, 110.0f));
  fading.share = hn::Exp(d, hn::Neg(squared));
  return fading;
}

/// A vector of rows from `row` on.
HWY_INLINE void momentLanes(Tag d, const MotionColumns<const float>& splats,
                            const TimeWindow& window, float time, size_t row,
                            const MomentColumns<float>& moments) {
  const Vec offset = offsetOf(d, window, time, hn::LoadU(d, splats.centres + row));
  const Quadruple phases = loadQuadruple(d, splats.phases, row);
  Triple place = loadTriple(d, splats.positions, row);
  for (size_t k = 1; k <= kMotionHarmonics; ++k) {
    const Wave wave = waveOf(d, static_cast<float>(k), offset, phaseOf(phases, k));
    const Triple a = loadTriple(d, splats.waves[2 * k - 2], row);
    const Triple b = loadTriple(d, splats.waves[2 * k - 1], row);
    place.x = hn::MulAdd(a.x, wave.cosine, hn::MulAdd(b.x, wave.sine, place.x));
    place.y = hn::MulAdd(a.y, wave.cosine, hn::MulAdd(b.y, wave.sine, place.y));
    place.z = hn::MulAdd(a.z, wave.cosine, hn::MulAdd(b.z, wave.sine, place.z));
  }
  hn::StoreInterleaved3(place.x, place.y, place.z, d, moments.positions + 3 * row);
  const Quadruple q = turnedOf(d, loadQuadruple(d, splats.rotations, row),
                               loadQuadruple(d, splats.spins, row), offset)
                          .unit;
  hn::StoreInterleaved4(q.w, q.x, q.y, q.z, d, moments.rotations + 4 * row);
  const Vec share = fadingOf(d, splats.lifespans, row, offset).share;
  hn::StoreU(hn::Mul(hn::LoadU(d, splats.opacities + row), share), d, moments.opacities + row);
}

HWY_INLINE void gradientLanes(Tag d, const MotionColumns<const float>& splats,
                              const TimeWindow& window, float time, size_t row,
                              const MomentColumns<const float>& by_moments,
                              const MotionColumns<float>& by_splats) {
  const Vec offset = offsetOf(d, window, time, hn::LoadU(d, splats.centres + row));
  const Quadruple phases = loadQuadruple(d, splats.phases, row);
  const Triple g = loadTriple(d, by_moments.positions, row);
  hn::StoreInterleaved3(g.x, g.y, g.z, d, by_splats.positions + 3 * row);
  Quadruple by_phase = {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  for (size_t k = 1; k <= kMotionHarmonics; ++k) {
    const Wave wave = waveOf(d, static_cast<float>(k), offset, phaseOf(phases, k));
    const Triple a = loadTriple(d, splats.waves[2 * k - 2], row);
    const Triple b = loadTriple(d, splats.waves[2 * k - 1], row);
    hn::StoreInterleaved3(hn::Mul(g.x, wave.cosine), hn::Mul(g.y, wave.cosine),
                          hn::Mul(g.z, wave.cosine), d, by_splats.waves[2 * k - 2] + 3 * row);
    hn::StoreInterleaved3(hn::Mul(g.x, wave.sine), hn::Mul(g.y, wave.sine), hn::Mul(g.z, wave.sine),
                          d, by_splats.waves[2 * k - 1] + 3 * row);
    const Vec along_a = hn::MulAdd(g.x, a.x, hn::MulAdd(g.y, a.y, hn::Mul(g.z, a.z)));
    const Vec along_b = hn::MulAdd(g.x, b.x, hn::MulAdd(g.y, b.y, hn::Mul(g.z, b.z)));
    const Vec by = hn::MulSub(along_b, wave.cosine, hn::Mul(along_a, wave.sine));
    (k == 1 ? by_phase.w : k == 2 ? by_phase.x : k == 3 ? by_phase.y : by_phase.z) = by;
  }
  hn::StoreInterleaved4(by_phase.w, by_phase.x, by_phase.y, by_phase.z, d,
                        by_splats.phases + 4 * row);

  const Turned turned = turnedOf(d, loadQuadruple(d, splats.rotations, row),
                                 loadQuadruple(d, splats.spins, row), offset);
  const Quadruple gq = loadQuadruple(d, by_moments.rotations, row);
  const Vec along = dot(turned.unit, gq);
  const Vec inverse = turned.inverse_length;
  const Quadruple by = {hn::Mul(hn::NegMulAdd(turned.unit.w, along, gq.w), inverse),
                        hn::Mul(hn::NegMulAdd(turned.unit.x, along, gq.x), inverse),
                        hn::Mul(hn::NegMulAdd(turned.unit.y, along, gq.y), inverse),
                        hn::Mul(hn::NegMulAdd(turned.unit.z, along, gq.z), inverse)};
  hn::StoreInterleaved4(by.w, by.x, by.y, by.z, d, by_splats.rotations + 4 * row);
  hn::StoreInterleaved4(hn::Mul(by.w, offset), hn::Mul(by.x, offset), hn::Mul(by.y, offset),
                        hn::Mul(by.z, offset), d, by_splats.spins + 4 * row);

  const Fading fading = fadingOf(d, splats.lifespans, row, offset);
  const Vec go = hn::Mul(hn::LoadU(d, by_moments.opacities + row), fading.share);
  hn::StoreU(go, d, by_splats.opacities + row);
  const Vec squared = hn::Mul(fading.ratio, fading.ratio);
  const Vec twice = hn::Div(hn::Add(squared, squared), fading.lifespan);
  const Vec by_lifespan = hn::Mul(hn::Mul(go, hn::LoadU(d, splats.opacities + row)), twice);
  hn::StoreInterleaved2(hn::IfThenElseZero(fading.before, by_lifespan),
                        hn::IfThenZeroElse(fading.before, by_lifespan), d,
                        by_splats.lifespans + 2 * row);
}

/// Room for one vector of all columns, for the last rows.
struct TailColumns {
  static constexpr size_t kLanes = HWY_MAX_BYTES / sizeof(float);
  static constexpr size_t kFloats = 3 + 4 + 1 + 3 * kMotionWaves + 4 + 4 + 2 + 1;
  HWY_ALIGN float numbers[kFloats * kLanes] = {};

  template <class Float>
  void place(MotionColumns<Float>& columns) {
    float* next = numbers;
    const auto room = [&](size_t width) {
      float* column = next;
      next += width * kLanes;
      return column;
    };
    columns.positions = room(3);
    columns.rotations = room(4);
    columns.opacities = room(1);
    for (auto& wave : columns.waves) wave = room(3);
    columns.phases = room(4);
    columns.spins = room(4);
    columns.lifespans = room(2);
    columns.centres = room(1);
  }
};

/// std::copy_n, of which GCC 16 says here that it may copy more than there is memory.
HWY_INLINE void copyFloats(const float* from, size_t count, float* to) {
  for (size_t i = 0; i < count; ++i) to[i] = from[i];
}

/// Calls visit(column of `from`, column of `to`, its width) for each column.
template <class From, class To, class Visit>
void eachColumn(const From& from, const To& to, const Visit& visit) {
  visit(from.positions, to.positions, 3);
  visit(from.rotations, to.rotations, 4);
  visit(from.opacities, to.opacities, 1);
  for (size_t wave = 0; wave < kMotionWaves; ++wave) visit(from.waves[wave], to.waves[wave], 3);
  visit(from.phases, to.phases, 4);
  visit(from.spins, to.spins, 4);
  visit(from.lifespans, to.lifespans, 2);
  if (from.centres != nullptr && to.centres != nullptr) visit(from.centres, to.centres, 1);
}

/// Rows [begin, begin + count) of splats, then ones, so that unused lanes divide by no 0.
MotionColumns<const float> tailOf(const MotionColumns<const float>& splats, size_t begin,
                                  size_t count, TailColumns& room) {
  std::fill(std::begin(room.numbers), std::end(room.numbers), 1.0f);
  MotionColumns<float> tail;
  room.place(tail);
  eachColumn(splats, tail, [&](const float* from, float* to, size_t width) {
    copyFloats(from + begin * width, count * width, to);
  });
  MotionColumns<const float> given;
  room.place(given);
  return given;
}

void momentsVector(const MotionColumns<const float>& splats, const TimeWindow& window, float time,
                   size_t begin, size_t end, const MomentColumns<float>& moments) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t row = begin;
  for (; row + lanes <= end; row += lanes) momentLanes(d, splats, window, time, row, moments);
  if (row == end) return;
  const size_t count = end - row;
  TailColumns room, made;
  const MotionColumns<const float> tail = tailOf(splats, row, count, room);
  MotionColumns<float> out;
  made.place(out);
  momentLanes(d, tail, window, time, 0, {out.positions, out.rotations, out.opacities});
  copyFloats(out.positions, 3 * count, moments.positions + 3 * row);
  copyFloats(out.rotations, 4 * count, moments.rotations + 4 * row);
  copyFloats(out.opacities, count, moments.opacities + row);
}

void gradientsVector(const MotionColumns<const float>& splats, const TimeWindow& window, float time,
                     size_t begin, size_t end, const MomentColumns<const float>& by_moments,
                     const MotionColumns<float>& by_splats) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t row = begin;
  for (; row + lanes <= end; row += lanes) {
    gradientLanes(d, splats, window, time, row, by_moments, by_splats);
  }
  if (row == end) return;
  const size_t count = end - row;
  TailColumns room, given, made;
  const MotionColumns<const float> tail = tailOf(splats, row, count, room);
  MotionColumns<float> by, out;
  given.place(by);
  made.place(out);
  copyFloats(by_moments.positions + 3 * row, 3 * count, by.positions);
  copyFloats(by_moments.rotations + 4 * row, 4 * count, by.rotations);
  copyFloats(by_moments.opacities + row, count, by.opacities);
  gradientLanes(d, tail, window, time, 0, {by.positions, by.rotations, by.opacities}, out);
  eachColumn(out, by_splats, [&](const float* from, float* to, size_t width) {
    copyFloats(from, count * width, to + row * width);
  });
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
MotionKernel namedMotionKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), momentsVector,
          gradientsVector};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedMotionKernel);

std::vector<MotionKernel> motionKernels() {
  return onEveryTarget(scalarMotionKernel(),
                       [] { return HWY_DYNAMIC_DISPATCH(namedMotionKernel)(); });
}

MotionKernel chosenMotionKernel() {
  static const MotionKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedMotionKernel)(), motionKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
