#include "bench/nn/multiply_peak.h"

#include <cstddef>

#include "base/stopwatch.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bench/nn/multiply_peak.cpp"
#include <hwy/foreach_target.h>
// After it, as each target includes the rest anew.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple::bench {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Operations that `turns` turns make; out: something of the sums, so that they are made.
double multiplyInRegisters(size_t turns, float* out) {
  const hn::ScalableTag<float> d;
  const auto factor = hn::Set(d, 0.999f);
  const auto step = hn::Set(d, 0.001f);
  auto s0 = hn::Set(d, 0.0f), s1 = hn::Set(d, 0.1f), s2 = hn::Set(d, 0.2f), s3 = hn::Set(d, 0.3f);
  auto s4 = hn::Set(d, 0.4f), s5 = hn::Set(d, 0.5f), s6 = hn::Set(d, 0.6f), s7 = hn::Set(d, 0.7f);
  auto s8 = hn::Set(d, 0.8f), s9 = hn::Set(d, 0.9f), sa = hn::Set(d, 1.0f), sb = hn::Set(d, 1.1f);
  for (size_t i = 0; i < turns; ++i) {
    s0 = hn::MulAdd(s0, factor, step);
    s1 = hn::MulAdd(s1, factor, step);
    s2 = hn::MulAdd(s2, factor, step);
    s3 = hn::MulAdd(s3, factor, step);
    s4 = hn::MulAdd(s4, factor, step);
    s5 = hn::MulAdd(s5, factor, step);
    s6 = hn::MulAdd(s6, factor, step);
    s7 = hn::MulAdd(s7, factor, step);
    s8 = hn::MulAdd(s8, factor, step);
    s9 = hn::MulAdd(s9, factor, step);
    sa = hn::MulAdd(sa, factor, step);
    sb = hn::MulAdd(sb, factor, step);
  }
  const auto left = hn::Add(hn::Add(hn::Add(s0, s1), hn::Add(s2, s3)), hn::Add(s4, s5));
  const auto right = hn::Add(hn::Add(hn::Add(s6, s7), hn::Add(s8, s9)), hn::Add(sa, sb));
  *out = hn::GetLane(hn::SumOfLanes(d, hn::Add(left, right)));
  return 2.0 * 12.0 * static_cast<double>(turns * hn::Lanes(d));
}

const char* name() {
  return hwy::TargetName(HWY_TARGET);
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple::bench
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stipple::bench {

HWY_EXPORT(multiplyInRegisters);
HWY_EXPORT(name);

double peakOperationsPerSecond() {
  // A few milliseconds.
  constexpr size_t kTurns = 1000000;
  float out = 0.0f;
  const Stopwatch watch;
  const double operations = HWY_DYNAMIC_DISPATCH(multiplyInRegisters)(kTurns, &out);
  const double seconds = watch.seconds();
  // What is asked of the sums, which stay near 1, so that they are made.
  if (!(out > 0.0f)) return 0.0;
  return operations / seconds;
}

const char* peakTarget() {
  return HWY_DYNAMIC_DISPATCH(name)();
}

}  // namespace stipple::bench

#endif  // HWY_ONCE
