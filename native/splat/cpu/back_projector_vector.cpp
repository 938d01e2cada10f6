#include "splat/cpu/back_projector.h"

// Lanes are splats, in double; harmonics' coefficients have lanes = colours.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/cpu/back_projector_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "math/affine.h"
#include "splat/cpu/lanes-inl.h"
#include "splat/cpu/load_geometry-inl.h"
#include "splat/render/blend_backward.h"
#include "splat/render/projection_backward.h"
#include "splat/render/scene_backward.h"

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, 8>;
using Double = Lanes<Doubles>;
using Quad = hn::CappedTag<double, 4>;

template <typename T>
HWY_INLINE T loadLanes(const double* values) {
  return T(hn::Load(Doubles(), values));
}

HWY_INLINE void storeLanes(Double value, double* out) {
  hn::Store(value.v, Doubles(), out);
}

HWY_INLINE void storeLanes(Double value, float* out) {
  const hn::Rebind<float, Doubles> d;
  hn::Store(hn::DemoteTo(d, value.v), d, out);
}

template <typename T>
HWY_INLINE size_t laneCount() {
  return hn::Lanes(Doubles());
}

#include "math/harmonic_basis-inl.h"
#include "math/harmonic_basis_gradient-inl.h"
#include "splat/render/projection_steps-inl.h"
// After the steps that it takes back.
#include "splat/render/projection_backward_steps-inl.h"

template <typename T>
HWY_INLINE void takeFootprintBack(const View<double>& view, const Mat3d& linear, const T* centre,
                                  const SplatGeometry<T>& splat, LowPass low_pass,
                                  const FootprintGradient<T>& by, ProjectionGradient<T>& out) {
  HWY_NAMESPACE::projectBackwardSteps(view, linear, centre, splat, low_pass, by, out);
}

HWY_INLINE void storeGradient(const ProjectionGradient<Double>& gradient, size_t row,
                              SplatGradients& out) {
  const hn::Rebind<float, Doubles> d;
  const auto narrow = [&](const Double& value) HWY_ATTR { return hn::DemoteTo(d, value.v); };
  const Double* position = gradient.position;
  hn::StoreInterleaved3(narrow(position[0]), narrow(position[1]), narrow(position[2]), d,
                        &out.positions[row * 3]);
  const Double* rotation = gradient.rotation;
  hn::StoreInterleaved4(narrow(rotation[0]), narrow(rotation[1]), narrow(rotation[2]),
                        narrow(rotation[3]), d, &out.rotations[row * 4]);
  const Double* scales = gradient.scales;
  hn::StoreInterleaved3(narrow(scales[0]), narrow(scales[1]), narrow(scales[2]), d,
                        &out.scales[row * 3]);
  hn::StoreU(narrow(gradient.opacity), d, &out.opacities[row]);
}

#include "splat/cpu/back_projector-inl.h"

/// Adds coefficient k of one lane to `sums`: a row of colours, then its derivatives by the axes of
/// the direction.
HWY_INLINE void addCoefficient(const HarmonicColumns& harmonics, size_t lane, size_t k,
                               const float* sh, double (&sums)[4][4]) {
  for (size_t c = 0; c < 3; ++c) {
    const double value = static_cast<double>(sh[k * 3 + c]);
    sums[0][c] += harmonics.basis[k][lane] * value;
    if (k == 0) continue;
    for (size_t axis = 0; axis < 3; ++axis) {
      sums[axis + 1][c] += harmonics.slopes[k][axis][lane] * value;
    }
  }
}

constexpr bool kHasQuads = hn::MaxLanes(Quad()) == 4;

/// Coefficients that go in vectors: each is loaded and stored with the number behind it, so the
/// last goes by itself.
constexpr size_t inQuads(size_t coefficients) {
  return kHasQuads ? coefficients - 1 : 0;
}

/// As in cpu/back_projector_scalar.cpp, in the same order for each colour.
template <size_t kCoefficients>
void sumCoefficientsBack(const PlacedCloud& placed, const HarmonicColumns& harmonics, size_t lane,
                         const float* sh, const float* by_colour, float* by_sum, double* along) {
  HWY_ALIGN double sums[4][4] = {{0.5, 0.5, 0.5}};
  constexpr size_t kInQuads = inQuads(kCoefficients);
  if constexpr (kInQuads > 0) {
    const Quad d;
    const hn::Rebind<float, Quad> floats;
    auto colour = hn::Set(d, 0.5), by_x = hn::Zero(d), by_y = by_x, by_z = by_x;
    for (size_t k = 0; k < kInQuads; ++k) {
      const auto value = hn::PromoteTo(d, hn::LoadU(floats, sh + k * 3));
      const auto times = [&](double factor) HWY_ATTR { return hn::Mul(hn::Set(d, factor), value); };
      colour = hn::Add(colour, times(harmonics.basis[k][lane]));
      if (k == 0) continue;
      by_x = hn::Add(by_x, times(harmonics.slopes[k][0][lane]));
      by_y = hn::Add(by_y, times(harmonics.slopes[k][1][lane]));
      by_z = hn::Add(by_z, times(harmonics.slopes[k][2][lane]));
    }
    hn::Store(colour, d, sums[0]);
    hn::Store(by_x, d, sums[1]);
    hn::Store(by_y, d, sums[2]);
    hn::Store(by_z, d, sums[3]);
  }
  for (size_t k = kInQuads; k < kCoefficients; ++k) addCoefficient(harmonics, lane, k, sh, sums);

  double by[3];
  colourSumsBackward(placed, sums[0], by_colour, by);
  for (size_t c = 0; c < 3; ++c) by_sum[c] = static_cast<float>(by[c]);
  for (size_t axis = 0; axis < 3; ++axis) {
    const double* own = sums[axis + 1];
    along[axis * kMaxLanes] = by[0] * own[0] + by[1] * own[1] + by[2] * own[2];
  }
}

template <size_t kCoefficients>
void storeCoefficientsBack(const PlacedCloud& placed, const HarmonicColumns& harmonics, size_t lane,
                           const float* by_sum, float* by_sh) {
  constexpr size_t kInQuads = inQuads(kCoefficients);
  if constexpr (kInQuads > 0) {
    const hn::Rebind<float, Quad> floats;
    const auto by = hn::Load(floats, by_sum);
    for (size_t k = 0; k < kInQuads; ++k) {
      hn::StoreU(hn::Mul(hn::Set(floats, harmonics.stored_basis[k][lane]), by), floats,
                 by_sh + k * 3);
    }
  }
  for (size_t k = kInQuads; k < kCoefficients; ++k) {
    for (size_t c = 0; c < 3; ++c) by_sh[k * 3 + c] = harmonics.stored_basis[k][lane] * by_sum[c];
  }
  std::fill(by_sh + kCoefficients * 3, by_sh + placed.cloud->shStride(), 0.0f);
}

/// Calls use(number of coefficients of the degree, as a constant).
template <typename Use>
void withCoefficients(int degree, const Use& use) {
  switch (degree) {
    case 0:
      return use(std::integral_constant<size_t, 1>());
    case 1:
      return use(std::integral_constant<size_t, 4>());
    case 2:
      return use(std::integral_constant<size_t, 9>());
    case 3:
      return use(std::integral_constant<size_t, 16>());
    default:
      return use(std::integral_constant<size_t, 25>());
  }
}

void sumHarmonicsBack(const PlacedCloud& placed, const HarmonicColumns& harmonics, size_t lane,
                      const float* sh, const float* by_colour, float* by_sum, double* along) {
  withCoefficients(placed.sh_degree, [&](auto count) HWY_ATTR {
    sumCoefficientsBack<decltype(count)::value>(placed, harmonics, lane, sh, by_colour, by_sum,
                                                along);
  });
}

void storeHarmonicsBack(const PlacedCloud& placed, const HarmonicColumns& harmonics, size_t lane,
                        const float* by_sum, float* by_sh) {
  withCoefficients(placed.sh_degree, [&](auto count) HWY_ATTR {
    storeCoefficientsBack<decltype(count)::value>(placed, harmonics, lane, by_sum, by_sh);
  });
}

NamedBackProjector namedBackProjector() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET),
          takeBackRows<Double>};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedBackProjector);

namespace {

NamedBackProjector dispatched() {
  return HWY_DYNAMIC_DISPATCH(namedBackProjector)();
}

}  // namespace

std::vector<NamedBackProjector> backProjectors() {
  return onEveryTarget(NamedBackProjector{"scalar", takeBackScalar}, dispatched);
}

BackProjector chosenBackProjector() {
  static const BackProjector chosen = chooseKernel(dispatched(), backProjectors).take_back;
  return chosen;
}

}  // namespace stipple

#endif  // HWY_ONCE
