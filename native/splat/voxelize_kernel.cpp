#include "splat/voxelize_kernel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "splat/voxelize_polylog.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/voxelize_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kSlice = kBrickSide * kBrickSide;
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
};

inline Span spanOf(double centre, double half_extent) {
  const double low = std::ceil(std::max(0.0, centre - half_extent));
  const double high = std::floor(std::min(kBrickSide - 1.0, centre + half_extent));
  return {static_cast<int>(low), static_cast<int>(high)};
}

// Sample positions of one voxel, as offsets in unit coordinates.
struct Samples {
  size_t count = 0;
  float offset[kMaxSampleCount][3];
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
          float* to = offset[count++];
          to[0] = x;
          to[1] = y;
          to[2] = (static_cast<float>(c) - 0.5f * (splat.samples[2] - 1)) * width[2];
        }
      }
    }
  }
};

template <class D>
void addSplat(D d, const BrickKey& brick, const VoxelSplat& splat, Sums& sums) {
  const size_t lanes = hn::Lanes(d);
  const Vec3d corner(brick[0] * double{kBrickSide}, brick[1] * double{kBrickSide},
                     brick[2] * double{kBrickSide});
  const Vec3d centre = splat.centre - corner;
  const Span xs = spanOf(centre[0], splat.half_extent[0]);
  const Span ys = spanOf(centre[1], splat.half_extent[1]);
  if (xs.last < xs.first || ys.last < ys.first) return;
  // A slice x holds its voxels as y * 8 + z; whole vectors cover the rows first..last.
  const size_t begin = static_cast<size_t>(ys.first) * kBrickSide / lanes * lanes;
  const size_t end = static_cast<size_t>(ys.last + 1) * kBrickSide;

  // The unit coordinates of voxel 0 in double; inside the brick float is enough.
  const Vec3d base = splat.to_unit * -centre;
  HWY_ALIGN float plane[3][kSlice];  // y and z steps of a slice
  float start[3];
  float step[3];
  for (int axis = 0; axis < 3; ++axis) {
    start[axis] = static_cast<float>(base[axis]);
    step[axis] = static_cast<float>(splat.to_unit(axis, 0));
    const auto step_y = hn::Set(d, static_cast<float>(splat.to_unit(axis, 1)));
    const auto step_z = hn::Set(d, static_cast<float>(splat.to_unit(axis, 2)));
    for (size_t i = begin; i < end; i += lanes) {
      hn::Store(hn::MulAdd(hn::Load(d, kSliceSteps.y + i), step_y,
                           hn::Mul(hn::Load(d, kSliceSteps.z + i), step_z)),
                d, plane[axis] + i);
    }
  }
  const Samples samples(splat);
  const auto near = static_cast<float>(splat.reach) + samples.reach;

  const auto log_term = hn::Set(d, splat.minus_log_opacity);
  const auto amplitude = hn::Set(d, splat.amplitude / static_cast<float>(samples.count));
  const auto reach2 = hn::Set(d, static_cast<float>(splat.reach * splat.reach));
  const auto near2 = hn::Set(d, near * near);
  const auto half = hn::Set(d, 0.5f);
  const auto red = hn::Set(d, splat.colour[0]);
  const auto green = hn::Set(d, splat.colour[1]);
  const auto blue = hn::Set(d, splat.colour[2]);
  for (int x = xs.first; x <= xs.last; ++x) {
    const auto fx = static_cast<float>(x);
    const auto x0 = hn::Set(d, start[0] + fx * step[0]);
    const auto x1 = hn::Set(d, start[1] + fx * step[1]);
    const auto x2 = hn::Set(d, start[2] + fx * step[2]);
    for (size_t i = begin; i < end; i += lanes) {
      const auto m0 = hn::Add(x0, hn::Load(d, plane[0] + i));
      const auto m1 = hn::Add(x1, hn::Load(d, plane[1] + i));
      const auto m2 = hn::Add(x2, hn::Load(d, plane[2] + i));
      const auto middle2 = hn::MulAdd(m0, m0, hn::MulAdd(m1, m1, hn::Mul(m2, m2)));
      if (hn::AllFalse(d, hn::Le(middle2, near2))) continue;
      auto sigma = hn::Zero(d);
      for (size_t sample = 0; sample < samples.count; ++sample) {
        const float* offset = samples.offset[sample];
        const auto u0 = hn::Add(m0, hn::Set(d, offset[0]));
        const auto u1 = hn::Add(m1, hn::Set(d, offset[1]));
        const auto u2 = hn::Add(m2, hn::Set(d, offset[2]));
        const auto distance2 = hn::MulAdd(u0, u0, hn::MulAdd(u1, u1, hn::Mul(u2, u2)));
        const auto inside = hn::Le(distance2, reach2);
        if (hn::AllFalse(d, inside)) continue;
        const auto value = polylogOfExp(d, hn::MulAdd(distance2, half, log_term));
        sigma = hn::Add(sigma, hn::IfThenElseZero(inside, value));
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

void sumBrickLanes(const BrickKey& brick, const VoxelSplat* splats, const uint32_t* list,
                   size_t count, float* density, float* colour) {
  const hn::CappedTag<float, 16> d;
  Sums sums;
  std::array<std::array<double, kBrickVoxelCount>, 4> totals = {};
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
  for (size_t i = 0; i < kBrickVoxelCount; ++i) {
    const double total = totals[0][i];
    density[i] = static_cast<float>(total);
    for (size_t channel = 0; channel < 3; ++channel) {
      colour[i * 3 + channel] =
          total > 0 ? static_cast<float>(totals[channel + 1][i] / total) : 0.0f;
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

#include <cctype>
#include <cstdlib>
#include <string>

#include "base/error.h"

namespace stipple {

HWY_EXPORT(namedBrickKernel);

namespace {

std::string lowerCase(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

BrickKernel chooseBrickKernel() {
  const char* forced = std::getenv("STIPPLE_FORCE_TARGET");
  if (!forced || !*forced) return HWY_DYNAMIC_DISPATCH(namedBrickKernel)().kernel;
  std::string names;
  for (const NamedBrickKernel& named : brickKernels()) {
    if (lowerCase(named.target) == lowerCase(forced)) return named.kernel;
    names += (names.empty() ? "" : ", ") + lowerCase(named.target);
  }
  fail(ErrorCode::kInvalidArgument,
       "STIPPLE_FORCE_TARGET is \"" + std::string(forced) + "\"; this machine has " + names);
}

}  // namespace

std::vector<NamedBrickKernel> brickKernels() {
  std::vector<NamedBrickKernel> kernels = {{"scalar", sumBrickScalar}};
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    kernels.push_back(HWY_DYNAMIC_DISPATCH(namedBrickKernel)());
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return kernels;
}

BrickKernel chosenBrickKernel() {
  static const BrickKernel kernel = chooseBrickKernel();
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
