#include "splat/cpu/back_projector.h"

// Lanes are splats, in double; harmonics' coefficients have lanes = colours.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/cpu/back_projector_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "math/affine.h"
#include "splat/blend_backward.h"
#include "splat/cpu/lanes-inl.h"
#include "splat/projection_backward.h"
#include "splat/scene_backward.h"

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

template <typename T>
HWY_INLINE size_t laneCount() {
  return hn::Lanes(Doubles());
}

#include "math/harmonic_basis-inl.h"
#include "math/harmonic_basis_gradient-inl.h"
#include "splat/projection_steps-inl.h"
// After the steps that it takes back.
#include "splat/projection_backward_steps-inl.h"

template <typename T>
HWY_INLINE void takeFootprintBack(const View<double>& view, const Mat3d& linear, const T* centre,
                                  const SplatGeometry<T>& splat, LowPass low_pass,
                                  const FootprintGradient<T>& by, ProjectionGradient<T>& out) {
  HWY_NAMESPACE::projectBackwardSteps(view, linear, centre, splat, low_pass, by, out);
}

void takeHarmonicsBack(const PlacedCloud& placed, const double* basis, const double* slopes,
                       const float* sh, const float* by_colour, float* by_sh, double* along);

#include "splat/cpu/back_projector-inl.h"

/// As in cpu/back_projector_scalar.cpp.
HWY_INLINE void harmonicsOfColour(const PlacedCloud& placed, const double* basis,
                                  const double* slopes, const float* sh, double* sums) {
  const size_t coefficients = shCoefficientCount(placed.sh_degree);
  for (size_t c = 0; c < 3; ++c) {
    double* own = sums + c;
    own[0] = 0.5 + basis[0] * static_cast<double>(sh[c]);
    for (size_t axis = 1; axis < 4; ++axis) own[axis * 4] = 0;
    for (size_t k = 1; k < coefficients; ++k) {
      const double value = static_cast<double>(sh[k * 3 + c]);
      own[0] += basis[k * kMaxLanes] * value;
      for (size_t axis = 0; axis < 3; ++axis) {
        own[(axis + 1) * 4] += slopes[(k * 3 + axis) * kMaxLanes] * value;
      }
    }
  }
}

void takeHarmonicsBack(const PlacedCloud& placed, const double* basis, const double* slopes,
                       const float* sh, const float* by_colour, float* by_sh, double* along) {
  const size_t coefficients = shCoefficientCount(placed.sh_degree);
  // Rows: colour, then its derivatives by the axes of the direction.
  HWY_ALIGN double sums[16];
  constexpr bool kHasQuads = hn::MaxLanes(Quad()) == 4;
  const hn::Rebind<float, Quad> floats;
  const Quad d;
  if constexpr (kHasQuads) {
    // Each coefficient is loaded with the number behind it, so the last one goes by itself.
    auto colour = hn::Zero(d), by_x = colour, by_y = colour, by_z = colour;
    if (coefficients > 1) {
      const auto value = hn::PromoteTo(d, hn::LoadU(floats, sh));
      colour = hn::Add(hn::Set(d, 0.5), hn::Mul(hn::Set(d, basis[0]), value));
    }
    for (size_t k = 1; k + 1 < coefficients; ++k) {
      const auto value = hn::PromoteTo(d, hn::LoadU(floats, sh + k * 3));
      const double* slope = slopes + k * 3 * kMaxLanes;
      colour = hn::Add(colour, hn::Mul(hn::Set(d, basis[k * kMaxLanes]), value));
      by_x = hn::Add(by_x, hn::Mul(hn::Set(d, slope[0]), value));
      by_y = hn::Add(by_y, hn::Mul(hn::Set(d, slope[kMaxLanes]), value));
      by_z = hn::Add(by_z, hn::Mul(hn::Set(d, slope[2 * kMaxLanes]), value));
    }
    hn::Store(colour, d, sums);
    hn::Store(by_x, d, sums + 4);
    hn::Store(by_y, d, sums + 8);
    hn::Store(by_z, d, sums + 12);
    const size_t k = coefficients - 1;
    for (size_t c = 0; c < 3; ++c) {
      const double value = static_cast<double>(sh[k * 3 + c]);
      if (k == 0) {
        sums[c] = 0.5 + basis[0] * value;
        continue;
      }
      sums[c] += basis[k * kMaxLanes] * value;
      for (size_t axis = 0; axis < 3; ++axis) {
        sums[(axis + 1) * 4 + c] += slopes[(k * 3 + axis) * kMaxLanes] * value;
      }
    }
  } else {
    harmonicsOfColour(placed, basis, slopes, sh, sums);
  }

  HWY_ALIGN double by_sum[4] = {};
  for (size_t c = 0; c < 3; ++c)
    by_sum[c] = colourSumBackward(placed, sums[c], static_cast<double>(by_colour[c]));
  for (size_t axis = 0; axis < 3; ++axis) {
    const double* own = sums + (axis + 1) * 4;
    along[axis * kMaxLanes] = by_sum[0] * own[0] + by_sum[1] * own[1] + by_sum[2] * own[2];
  }
  size_t k = 0;
  if constexpr (kHasQuads) {
    // The number behind each coefficient is overwritten by the next; the last goes by itself.
    const auto by = hn::Load(d, by_sum);
    const auto most = hn::Set(d, kLargestStored);
    const auto least = hn::Set(d, -kLargestStored);
    for (; k + 1 < coefficients; ++k) {
      const auto value = hn::Mul(hn::Set(d, basis[k * kMaxLanes]), by);
      hn::StoreU(hn::DemoteTo(floats, hn::Max(hn::Min(value, most), least)), floats, by_sh + k * 3);
    }
  }
  for (; k < coefficients; ++k) {
    const double value = basis[k * kMaxLanes];
    for (size_t c = 0; c < 3; ++c) {
      by_sh[k * 3 + c] =
          static_cast<float>(std::clamp(value * by_sum[c], -kLargestStored, kLargestStored));
    }
  }
  std::fill(by_sh + coefficients * 3, by_sh + placed.cloud->shStride(), 0.0f);
}

NamedBackProjector namedBackProjector() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET),
          takeBackRows<Double>};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <strings.h>

#include <cstdlib>

namespace stipple {

HWY_EXPORT(namedBackProjector);

namespace {

BackProjector chooseBackProjector() {
  // A name that no target has is refused by chosenTileKernel.
  if (const char* forced = std::getenv("STIPPLE_FORCE_TARGET")) {
    for (const NamedBackProjector& named : backProjectors()) {
      if (strcasecmp(named.target, forced) == 0) return named.take_back;
    }
  }
  return HWY_DYNAMIC_DISPATCH(namedBackProjector)().take_back;
}

}  // namespace

std::vector<NamedBackProjector> backProjectors() {
  std::vector<NamedBackProjector> list = {{"scalar", takeBackScalar}};
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    list.push_back(HWY_DYNAMIC_DISPATCH(namedBackProjector)());
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return list;
}

BackProjector chosenBackProjector() {
  static const BackProjector projector = chooseBackProjector();
  return projector;
}

}  // namespace stipple

#endif  // HWY_ONCE
