#include "splat/voxels/voxelize_kernel.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "splat/voxels/voxelize_polylog.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/voxels/voxelize_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kSlice = kBrickSide * kBrickSide;
constexpr size_t kMostLanes = 16;
constexpr float kFar = 1e15f;  // of unit coordinates; its square stays finite
constexpr size_t kMaxSampleCount =
    size_t{kVoxelMaxSamples[0]} * kVoxelMaxSamples[1] * kVoxelMaxSamples[2];
// Sums of at most this many splats stay in float; float64 takes over from there.
constexpr size_t kFlushEvery = 64;

// exp(-x) for 0 <= x <= 87, relative error below 2e-7. Base 2 with the fraction in [-1/2, 1/2]; the
// coefficients are ln(2)^k / k!, degree 6: the first term left out is 1.2e-7 at most.
template <class D, class V>
HWY_INLINE V expOfMinus(D d, V x) {
  const hn::RebindToSigned<D> di;
  const V y = hn::Mul(x, hn::Set(d, -1.44269504088896341f));
  const V whole = hn::Round(y);
  const V f = hn::Sub(y, whole);
  V p = hn::Set(d, 1.54035303933816e-4f);
  p = hn::MulAdd(p, f, hn::Set(d, 1.33335581464284e-3f));
  p = hn::MulAdd(p, f, hn::Set(d, 9.61812910762848e-3f));
  p = hn::MulAdd(p, f, hn::Set(d, 5.55041086648216e-2f));
  p = hn::MulAdd(p, f, hn::Set(d, 2.40226506959101e-1f));
  p = hn::MulAdd(p, f, hn::Set(d, 6.93147180559945e-1f));
  p = hn::MulAdd(p, f, hn::Set(d, 1.0f));
  const auto bits = hn::ShiftLeft<23>(hn::Add(hn::ConvertTo(di, whole), hn::Set(di, 127)));
  return hn::Mul(p, hn::BitCast(d, bits));
}

// Li_1/2(exp(-x)) for x >= -ln(0.99).
template <class D, class V>
HWY_INLINE V polylogOfExp(D d, V x) {
  // Dead lanes may hold anything; 87 keeps the exponent inside float.
  const V z = expOfMinus(d, hn::Min(x, hn::Set(d, 87.0f)));
  const V s = hn::Sqrt(hn::Sub(hn::Set(d, 1.0f), z));
  V p = hn::Set(d, kPolylogCoefficients[kPolylogDegree]);
  for (int k = kPolylogDegree - 1; k >= 0; --k) {
    p = hn::MulAdd(p, s, hn::Set(d, kPolylogCoefficients[k]));
  }
  return hn::Div(hn::Mul(z, p), s);
}

struct SliceSteps {
  HWY_ALIGN float y[kSlice];
  HWY_ALIGN float z[kSlice];
};

constexpr SliceSteps makeSliceSteps() {
  SliceSteps steps = {};
  for (size_t i = 0; i < kSlice; ++i) {
    steps.y[i] = static_cast<float>(i / kBrickSide);
    steps.z[i] = static_cast<float>(i % kBrickSide);
  }
  return steps;
}

constexpr SliceSteps kSliceSteps = makeSliceSteps();

struct Sums {
  HWY_ALIGN float value[4][kBrickVoxelCount];  // density, then colour times density
};

// The part of a brick that a splat may reach along one axis, as voxels first..last; empty where
// last < first.
struct Span {
  int first;
  int last;

  size_t count() const { return static_cast<size_t>(last - first + 1); }
};

inline Span spanOf(double centre, double half_extent) {
  const double low = std::ceil(std::max(0.0, centre - half_extent));
  const double high = std::floor(std::min(kBrickSide - 1.0, centre + half_extent));
  return {static_cast<int>(low), static_cast<int>(high)};
}

// Sample positions of one voxel, as offsets in unit coordinates. Behind the last, up to a whole
// vector, are places that no splat reaches.
struct Samples {
  size_t count = 0;
  HWY_ALIGN float offset[3][kMaxSampleCount + kMostLanes];
  float reach = 0.0f;  // of the furthest one

  explicit Samples(const VoxelSplat& splat) {
    float width[3];  // of one sample
    float reach2 = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
      width[axis] = static_cast<float>(splat.to_unit.row(axis).norm()) / splat.samples[axis];
      const float furthest = 0.5f * (splat.samples[axis] - 1) * width[axis];
      reach2 += furthest * furthest;
    }
    reach = std::sqrt(reach2);
    for (int a = 0; a < splat.samples[0]; ++a) {
      const float x = (static_cast<float>(a) - 0.5f * (splat.samples[0] - 1)) * width[0];
      for (int b = 0; b < splat.samples[1]; ++b) {
        const float y = (static_cast<float>(b) - 0.5f * (splat.samples[1] - 1)) * width[1];
        for (int c = 0; c < splat.samples[2]; ++c) {
          offset[0][count] = x;
          offset[1][count] = y;
          offset[2][count] = (static_cast<float>(c) - 0.5f * (splat.samples[2] - 1)) * width[2];
          ++count;
        }
      }
    }
    for (auto& axis : offset) std::fill_n(axis + count, kMostLanes, kFar);
  }
};

// A splat in the coordinates of a brick. The unit coordinates of voxel 0 come from double; inside
// the brick float is enough.
struct PlacedSplat {
  const VoxelSplat& splat;
  Span spans[3];
  float start[3];
  float step[3][3];  // by grid axis, then unit axis
  float reach2;

  PlacedSplat(const BrickKey& brick, const VoxelSplat& of) : splat(of) {
    const Vec3d corner(brick[0] * double{kBrickSide}, brick[1] * double{kBrickSide},
                       brick[2] * double{kBrickSide});
    const Vec3d centre = of.centre - corner;
    const Vec3d base = of.to_unit * -centre;
    for (int axis = 0; axis < 3; ++axis) {
      spans[axis] = spanOf(centre[axis], of.half_extent[axis]);
      start[axis] = static_cast<float>(base[axis]);
      for (int unit = 0; unit < 3; ++unit) {
        step[axis][unit] = static_cast<float>(of.to_unit(unit, axis));
      }
    }
    reach2 = static_cast<float>(of.reach * of.reach);
  }

  bool isEmpty() const {
    for (const Span& span : spans) {
      if (span.last < span.first) return true;
    }
    return false;
  }
};

// Extinction at unit coordinates, without the amplitude; 0 outside the reach.
template <class D, class V>
HWY_INLINE V extinctionAt(D d, const VoxelSplat& splat, float reach2, V u0, V u1, V u2) {
  const auto distance2 = hn::MulAdd(u0, u0, hn::MulAdd(u1, u1, hn::Mul(u2, u2)));
  const auto inside = hn::Le(distance2, hn::Set(d, reach2));
  if (hn::AllFalse(d, inside)) return hn::Zero(d);
  const auto value =
      polylogOfExp(d, hn::MulAdd(distance2, hn::Set(d, 0.5f), hn::Set(d, splat.minus_log_opacity)));
  return hn::IfThenElseZero(inside, value);
}

// For a splat of many samples that meets few voxels: the lanes hold samples.
template <class D>
void addSamples(D d, const PlacedSplat& placed, const Samples& samples, float near2, Sums& sums) {
  const size_t lanes = hn::Lanes(d);
  const VoxelSplat& splat = placed.splat;
  const float amplitude = splat.amplitude / static_cast<float>(samples.count);
  const auto& [xs, ys, zs] = placed.spans;
  for (int x = xs.first; x <= xs.last; ++x) {
    for (int y = ys.first; y <= ys.last; ++y) {
      for (int z = zs.first; z <= zs.last; ++z) {
        float middle[3];
        float middle2 = 0.0f;
        for (int unit = 0; unit < 3; ++unit) {
          middle[unit] = placed.start[unit] + static_cast<float>(x) * placed.step[0][unit] +
                         static_cast<float>(y) * placed.step[1][unit] +
                         static_cast<float>(z) * placed.step[2][unit];
          middle2 += middle[unit] * middle[unit];
        }
        if (middle2 > near2) continue;
        auto sum = hn::Zero(d);
        for (size_t i = 0; i < samples.count; i += lanes) {
          const auto u0 = hn::Add(hn::Set(d, middle[0]), hn::Load(d, samples.offset[0] + i));
          const auto u1 = hn::Add(hn::Set(d, middle[1]), hn::Load(d, samples.offset[1] + i));
          const auto u2 = hn::Add(hn::Set(d, middle[2]), hn::Load(d, samples.offset[2] + i));
          sum = hn::Add(sum, extinctionAt(d, splat, placed.reach2, u0, u1, u2));
        }
        const float sigma = hn::GetLane(hn::SumOfLanes(d, sum)) * amplitude;
        const auto at = static_cast<size_t>((x * kBrickSide + y) * kBrickSide + z);
        sums.value[0][at] += sigma;
        for (size_t channel = 0; channel < 3; ++channel) {
          sums.value[channel + 1][at] += sigma * splat.colour[channel];
        }
      }
    }
  }
}

// The lanes hold voxels of a slice x, in the order y * 8 + z; begin, end: whole vectors that cover
// the rows the splat may reach.
template <class D>
void addSlices(D d, const PlacedSplat& placed, const Samples& samples, float near2, size_t begin,
               size_t end, Sums& sums) {
  const size_t lanes = hn::Lanes(d);
  const VoxelSplat& splat = placed.splat;
  HWY_ALIGN float plane[3][kSlice];  // y and z steps of a slice
  for (int unit = 0; unit < 3; ++unit) {
    const auto step_y = hn::Set(d, placed.step[1][unit]);
    const auto step_z = hn::Set(d, placed.step[2][unit]);
    for (size_t i = begin; i < end; i += lanes) {
      hn::Store(hn::MulAdd(hn::Load(d, kSliceSteps.y + i), step_y,
                           hn::Mul(hn::Load(d, kSliceSteps.z + i), step_z)),
                d, plane[unit] + i);
    }
  }
  const auto amplitude = hn::Set(d, splat.amplitude / static_cast<float>(samples.count));
  const auto red = hn::Set(d, splat.colour[0]);
  const auto green = hn::Set(d, splat.colour[1]);
  const auto blue = hn::Set(d, splat.colour[2]);
  for (int x = placed.spans[0].first; x <= placed.spans[0].last; ++x) {
    const auto fx = static_cast<float>(x);
    const auto x0 = hn::Set(d, placed.start[0] + fx * placed.step[0][0]);
    const auto x1 = hn::Set(d, placed.start[1] + fx * placed.step[0][1]);
    const auto x2 = hn::Set(d, placed.start[2] + fx * placed.step[0][2]);
    for (size_t i = begin; i < end; i += lanes) {
      const auto m0 = hn::Add(x0, hn::Load(d, plane[0] + i));
      const auto m1 = hn::Add(x1, hn::Load(d, plane[1] + i));
      const auto m2 = hn::Add(x2, hn::Load(d, plane[2] + i));
      const auto middle2 = hn::MulAdd(m0, m0, hn::MulAdd(m1, m1, hn::Mul(m2, m2)));
      if (hn::AllFalse(d, hn::Le(middle2, hn::Set(d, near2)))) continue;
      auto sigma = hn::Zero(d);
      for (size_t sample = 0; sample < samples.count; ++sample) {
        const auto u0 = hn::Add(m0, hn::Set(d, samples.offset[0][sample]));
        const auto u1 = hn::Add(m1, hn::Set(d, samples.offset[1][sample]));
        const auto u2 = hn::Add(m2, hn::Set(d, samples.offset[2][sample]));
        sigma = hn::Add(sigma, extinctionAt(d, splat, placed.reach2, u0, u1, u2));
      }
      sigma = hn::Mul(sigma, amplitude);
      const size_t at = static_cast<size_t>(x) * kSlice + i;
      hn::Store(hn::Add(hn::Load(d, sums.value[0] + at), sigma), d, sums.value[0] + at);
      hn::Store(hn::MulAdd(sigma, red, hn::Load(d, sums.value[1] + at)), d, sums.value[1] + at);
      hn::Store(hn::MulAdd(sigma, green, hn::Load(d, sums.value[2] + at)), d, sums.value[2] + at);
      hn::Store(hn::MulAdd(sigma, blue, hn::Load(d, sums.value[3] + at)), d, sums.value[3] + at);
    }
  }
}

template <class D>
void addSplat(D d, const BrickKey& brick, const VoxelSplat& splat, Sums& sums) {
  const PlacedSplat placed(brick, splat);
  if (placed.isEmpty()) return;
  const Samples samples(splat);
  const float near = static_cast<float>(splat.reach) + samples.reach;
  const size_t lanes = hn::Lanes(d);
  const auto& [xs, ys, zs] = placed.spans;
  const size_t begin = static_cast<size_t>(ys.first) * kBrickSide / lanes * lanes;
  const size_t end = static_cast<size_t>(ys.last + 1) * kBrickSide;
  // Evaluations of whole vectors, either way.
  const size_t by_slices = xs.count() * ((end - begin + lanes - 1) / lanes) * samples.count;
  const size_t by_samples =
      xs.count() * ys.count() * zs.count() * ((samples.count + lanes - 1) / lanes);
  if (by_samples < by_slices) {
    addSamples(d, placed, samples, near * near, sums);
  } else {
    addSlices(d, placed, samples, near * near, begin, end, sums);
  }
}

void sumBrickLanes(const BrickKey& brick, const VoxelSplat* splats, const uint32_t* list,
                   size_t count, BrickSums& totals) {
  const hn::CappedTag<float, 16> d;
  Sums sums;
  for (size_t begin = 0; begin < count; begin += kFlushEvery) {
    for (auto& channel : sums.value) std::fill_n(channel, kBrickVoxelCount, 0.0f);
    const size_t end = std::min(count, begin + kFlushEvery);
    for (size_t i = begin; i < end; ++i) addSplat(d, brick, splats[list[i]], sums);
    for (size_t channel = 0; channel < 4; ++channel) {
      for (size_t i = 0; i < kBrickVoxelCount; ++i) {
        totals[channel][i] += static_cast<double>(sums.value[channel][i]);
      }
    }
  }
}

}  // namespace

NamedBrickKernel namedBrickKernel() {
  return {hwy::TargetName(HWY_TARGET), sumBrickLanes};
}

}  // namespace stipple::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedBrickKernel);

std::vector<NamedBrickKernel> brickKernels() {
  return onEveryTarget(NamedBrickKernel{"scalar", sumBrickScalar},
                       [] { return HWY_DYNAMIC_DISPATCH(namedBrickKernel)(); });
}

BrickKernel chosenBrickKernel() {
  static const BrickKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedBrickKernel)(), brickKernels).kernel;
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
