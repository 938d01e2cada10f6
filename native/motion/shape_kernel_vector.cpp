#include "motion/shape_kernel.h"

// One-sided Jacobi with lanes along the splats (Hestenes, Inversion of Matrices by
// Biorthogonalization and Related Results, J. SIAM 1958). Products and sums are fused where the
// processor can, so targets differ by rounding.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "motion/shape_kernel_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;

struct Column {
  Vec x, y, z;
};

HWY_INLINE Vec dot(const Column& a, const Column& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}

HWY_INLINE Column scaled(const Column& a, Vec by) {
  return {hn::Mul(a.x, by), hn::Mul(a.y, by), hn::Mul(a.z, by)};
}

/// Cosine between two columns that counts as zero.
constexpr float kOrthogonal = 2e-7f;
/// Quadratic convergence: three are enough nearly always.
constexpr int kMostSweeps = 8;

/// Turns two columns so that they are orthogonal, by the smaller of the two angles. Returns whether
/// all of them were.
HWY_INLINE bool orthogonalise(Tag d, Column& p, Column& q) {
  const Vec pp = dot(p, p), qq = dot(q, q), pq = dot(p, q);
  const Vec slope = hn::Sqrt(hn::Mul(pp, qq));
  const auto turned = hn::Gt(hn::Abs(pq), hn::Mul(hn::Set(d, kOrthogonal), slope));
  if (hn::AllFalse(d, turned)) return true;
  const Vec difference = hn::Sub(qq, pp);
  const Vec twice = hn::Add(pq, pq);
  const Vec root = hn::Sqrt(hn::MulAdd(difference, difference, hn::Mul(twice, twice)));
  // In the other lanes there may be 0 over 0.
  const Vec below = hn::IfThenElse(turned, hn::Add(hn::Abs(difference), root), hn::Set(d, 1.0f));
  const Vec sign =
      hn::IfThenElse(hn::Lt(difference, hn::Zero(d)), hn::Set(d, -1.0f), hn::Set(d, 1.0f));
  const Vec t = hn::IfThenElseZero(turned, hn::Div(hn::Mul(sign, twice), below));
  const Vec c = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(hn::MulAdd(t, t, hn::Set(d, 1.0f))));
  const Vec s = hn::Mul(c, t);
  const Column old = p;
  p = {hn::NegMulAdd(s, q.x, hn::Mul(c, p.x)), hn::NegMulAdd(s, q.y, hn::Mul(c, p.y)),
       hn::NegMulAdd(s, q.z, hn::Mul(c, p.z))};
  q = {hn::MulAdd(s, old.x, hn::Mul(c, q.x)), hn::MulAdd(s, old.y, hn::Mul(c, q.y)),
       hn::MulAdd(s, old.z, hn::Mul(c, q.z))};
  return false;
}

struct Quaternion {
  Vec w, x, y, z;
};

/// The unit quaternion of a rotation whose columns are given: from the largest of its components.
HWY_INLINE Quaternion quaternionOf(Tag d, const Column& a, const Column& b, const Column& c) {
  const Vec one = hn::Set(d, 1.0f);
  const Vec ww = hn::Add(one, hn::Add(a.x, hn::Add(b.y, c.z)));
  const Vec xx = hn::Add(one, hn::Sub(a.x, hn::Add(b.y, c.z)));
  const Vec yy = hn::Add(one, hn::Sub(b.y, hn::Add(a.x, c.z)));
  const Vec zz = hn::Add(one, hn::Sub(c.z, hn::Add(a.x, b.y)));
  const Vec wx = hn::Sub(b.z, c.y), wy = hn::Sub(c.x, a.z), wz = hn::Sub(a.y, b.x);
  const Vec xy = hn::Add(a.y, b.x), xz = hn::Add(a.z, c.x), yz = hn::Add(b.z, c.y);
  Quaternion q = {ww, wx, wy, wz};
  Vec largest = ww;
  const auto take = [&](Vec size, const Quaternion& other) {
    const auto larger = hn::Gt(size, largest);
    q = {hn::IfThenElse(larger, other.w, q.w), hn::IfThenElse(larger, other.x, q.x),
         hn::IfThenElse(larger, other.y, q.y), hn::IfThenElse(larger, other.z, q.z)};
    largest = hn::Max(largest, size);
  };
  take(xx, {wx, xx, xy, xz});
  take(yy, {wy, xy, yy, yz});
  take(zz, {wz, xz, yz, zz});
  const Vec squared =
      hn::MulAdd(q.w, q.w, hn::MulAdd(q.x, q.x, hn::MulAdd(q.y, q.y, hn::Mul(q.z, q.z))));
  const Vec inverse = hn::Div(one, hn::Sqrt(squared));
  return {hn::Mul(q.w, inverse), hn::Mul(q.x, inverse), hn::Mul(q.y, inverse),
          hn::Mul(q.z, inverse)};
}

/// A column of F A, A the axes of a splat.
HWY_INLINE Column deformed(const Column* rows, const Column& axis) {
  return {dot(rows[0], axis), dot(rows[1], axis), dot(rows[2], axis)};
}

HWY_INLINE void deformLanes(Tag d, const ShapeColumns& splats, size_t row) {
  const Vec one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f);
  Vec w, x, y, z;
  hn::LoadInterleaved4(d, splats.rotations + 4 * row, w, x, y, z);
  const Column a = {hn::NegMulAdd(two, hn::MulAdd(y, y, hn::Mul(z, z)), one),
                    hn::Mul(two, hn::MulAdd(x, y, hn::Mul(w, z))),
                    hn::Mul(two, hn::MulSub(x, z, hn::Mul(w, y)))};
  const Column b = {hn::Mul(two, hn::MulSub(x, y, hn::Mul(w, z))),
                    hn::NegMulAdd(two, hn::MulAdd(x, x, hn::Mul(z, z)), one),
                    hn::Mul(two, hn::MulAdd(y, z, hn::Mul(w, x)))};
  const Column c = {hn::Mul(two, hn::MulAdd(x, z, hn::Mul(w, y))),
                    hn::Mul(two, hn::MulSub(y, z, hn::Mul(w, x))),
                    hn::NegMulAdd(two, hn::MulAdd(x, x, hn::Mul(y, y)), one)};
  const auto entry = [&](size_t i) {
    return hn::LoadU(d, splats.deformations + i * splats.stride + row);
  };
  const Column rows[3] = {{entry(0), entry(1), entry(2)},
                          {entry(3), entry(4), entry(5)},
                          {entry(6), entry(7), entry(8)}};
  Column scales;
  hn::LoadInterleaved3(d, splats.scales + 3 * row, scales.x, scales.y, scales.z);
  // Lengths are of the largest, so that their squares stay far from the ends of float32.
  Vec largest = hn::Max(scales.x, hn::Max(scales.y, scales.z));
  largest = hn::IfThenElse(hn::Gt(largest, hn::Zero(d)), largest, one);
  const Column relative = scaled(scales, hn::Div(one, largest));
  const Vec floor = hn::Set(d, kFlatness);
  const Column raised = {hn::Max(relative.x, floor), hn::Max(relative.y, floor),
                         hn::Max(relative.z, floor)};
  Column p = scaled(deformed(rows, a), raised.x);
  Column q = scaled(deformed(rows, b), raised.y);
  Column r = scaled(deformed(rows, c), raised.z);
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    const bool first = orthogonalise(d, p, q);
    const bool second = orthogonalise(d, p, r);
    const bool third = orthogonalise(d, q, r);
    if (first && second && third) break;
  }
  Column lengths = {hn::Sqrt(dot(p, p)), hn::Sqrt(dot(q, q)), hn::Sqrt(dot(r, r))};
  p = scaled(p, hn::Div(one, lengths.x));
  q = scaled(q, hn::Div(one, lengths.y));
  r = scaled(r, hn::Div(one, lengths.z));
  // Right-handed, since each step turned the columns of a right-handed frame by a rotation.
  const Quaternion turned = quaternionOf(d, p, q, r);
  hn::StoreInterleaved4(turned.w, turned.x, turned.y, turned.z, d, splats.out_rotations + 4 * row);
  // What was raised goes down again.
  lengths = {hn::Mul(lengths.x, hn::Div(relative.x, raised.x)),
             hn::Mul(lengths.y, hn::Div(relative.y, raised.y)),
             hn::Mul(lengths.z, hn::Div(relative.z, raised.z))};
  lengths = scaled(lengths, largest);
  hn::StoreInterleaved3(lengths.x, lengths.y, lengths.z, d, splats.out_scales + 3 * row);
}

void deformVector(const ShapeColumns& splats, size_t count) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t row = 0;
  for (; row + lanes <= count; row += lanes) deformLanes(d, splats, row);
  if (row == count) return;
  constexpr size_t kLanes = HWY_MAX_BYTES / sizeof(float);
  HWY_ALIGN float deformations[9 * kLanes], rotations[4 * kLanes], scales[3 * kLanes];
  HWY_ALIGN float out_rotations[4 * kLanes], out_scales[3 * kLanes];
  const size_t rest = count - row;
  for (size_t lane = 0; lane < lanes; ++lane) {
    const size_t from = row + (lane < rest ? lane : 0);
    for (size_t i = 0; i < 9; ++i) {
      deformations[i * kLanes + lane] = splats.deformations[i * splats.stride + from];
    }
    for (size_t i = 0; i < 4; ++i) rotations[4 * lane + i] = splats.rotations[4 * from + i];
    for (size_t i = 0; i < 3; ++i) scales[3 * lane + i] = splats.scales[3 * from + i];
  }
  deformLanes(d, {deformations, kLanes, rotations, scales, out_rotations, out_scales}, 0);
  for (size_t i = 0; i < 4 * rest; ++i) splats.out_rotations[4 * row + i] = out_rotations[i];
  for (size_t i = 0; i < 3 * rest; ++i) splats.out_scales[3 * row + i] = out_scales[i];
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
ShapeKernel namedShapeKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), deformVector};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedShapeKernel);

std::vector<ShapeKernel> shapeKernels() {
  return onEveryTarget(scalarShapeKernel(),
                       [] { return HWY_DYNAMIC_DISPATCH(namedShapeKernel)(); });
}

ShapeKernel chosenShapeKernel() {
  static const ShapeKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedShapeKernel)(), shapeKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
