// Based on: Sandu, Pathak, Soundararajan, TAD-GS, arXiv 2606.23212, by its released program (state,
// initial values, learning rates). Differs: docs/methods/temporal.md has the list.

#include "train/loop/moving_splats.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "base/random.h"
#include "motion/lifespan.h"
#include "motion/motion_kernel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 12;

/// Extras of the motion, by their order.
constexpr size_t kPhases = kMotionWaves;
constexpr size_t kSpins = kMotionWaves + 1;
constexpr size_t kLifespans = kMotionWaves + 2;
constexpr size_t kCentres = kMotionWaves + 3;
constexpr size_t kExtraCount = kMotionWaves + 4;

/// Learning rates. Those of waves are shares of the position's of the same iteration; phases have a
/// constant one per metre of the cameras' extent.
constexpr double kWaveShare = 0.1 * 3.5;
constexpr double kPhaseRate = 0.02 * 3.5 * 2.6e-4;
constexpr double kSpinRate = 1e-4;
constexpr double kLifespanRate = 3e-3;

/// Frames from one moment that new splats may have to the next.
constexpr uint32_t kFramesBetweenMoments = 20;
constexpr float kStartLifespan = 1;  ///< raw

/// Seconds: a rate of frames is a number then, however many there are.
constexpr double kShortestClip = 1e-9;
constexpr double kLongestClip = 1e12;

/// out[i] = map(i) for i < count, by all threads.
template <class Map>
void fillInParallel(size_t count, float* out, const Map& map) {
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = map(i);
  });
}

/// Raw temporal scale with which a splat keeps kVisibleShare of its opacity at another time than
/// its moment.
float lifespanUpTo(const MotionClip& clip, double moment, double other) {
  const double offset = std::abs(stretchedOffset(clip.window(), other, moment));
  const double scale = std::max(offset / std::sqrt(-std::log(kVisibleShare)), kSmallestLifespan);
  return static_cast<float>(std::log(scale / lifespanUnit(clip.frame_count)));
}

/// Splats whose surface was at their place at one time have that as their moment, and are hardly
/// visible any more when others were looked at next. In: times [N] seconds, NaN for any time: such
/// a splat stays as it is. Changes: moments [N], raw temporal scales [N,2].
void beginAtTimes(const MotionClip& clip, std::span<const double> times,
                  std::vector<float>& moments, std::vector<float>& lifespans) {
  std::vector<double> known;
  for (const double time : times) {
    if (!std::isnan(time)) known.push_back(clip.partOf(time));
  }
  std::sort(known.begin(), known.end());
  known.erase(std::unique(known.begin(), known.end()), known.end());
  for (size_t i = 0; i < times.size(); ++i) {
    if (std::isnan(times[i])) continue;
    const double moment = clip.partOf(times[i]);
    const auto at = std::lower_bound(known.begin(), known.end(), moment);
    moments[i] = static_cast<float>(moment);
    if (at != known.begin()) lifespans[2 * i] = lifespanUpTo(clip, moment, *(at - 1));
    if (at + 1 != known.end()) lifespans[2 * i + 1] = lifespanUpTo(clip, moment, *(at + 1));
  }
}

}  // namespace

MotionClip clipOfViews(const ViewSource& views) {
  std::vector<double> times;
  for (size_t v = 0; v < views.count(); ++v) times.push_back(views.time(v));
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  if (times.size() < 2) {
    fail(
        ErrorCode::kInvalidArgument,
        "all views have the same time; splats that move need views of 2 times or more ('time' of a "
        "frame in transforms.json)");
  }
  MotionClip clip;
  clip.begin = times.front();
  clip.frame_count = static_cast<uint32_t>(times.size());
  const double seconds = times.back() - times.front();
  if (!(seconds >= kShortestClip && seconds <= kLongestClip)) {
    fail(ErrorCode::kInvalidArgument, "the views are of " + numberText(times.front()) + " to " +
                                          numberText(times.back()) + " s; clips of " +
                                          numberText(kShortestClip) + " to " +
                                          numberText(kLongestClip) + " s can be fitted");
  }
  clip.frames_per_second = (clip.frame_count - 1) / seconds;
  return clip;
}

std::vector<size_t> MovingParameterisation::extraLengths() {
  std::vector<size_t> lengths(kMotionWaves, 3);
  lengths.insert(lengths.end(), {4, 4, 2, 1});
  return lengths;
}

std::vector<double> MovingParameterisation::rates(double position_rate, double extent) {
  std::vector<double> rates(kExtraCount, kWaveShare * position_rate);
  rates[kPhases] = kPhaseRate * extent;
  rates[kSpins] = kSpinRate;
  rates[kLifespans] = kLifespanRate;
  rates[kCentres] = 0;
  return rates;
}

std::vector<std::vector<float>> MovingParameterisation::initialExtras(
    size_t count, uint64_t seed, std::span<const double> times) const {
  std::vector<std::vector<float>> extras;
  for (const size_t length : extraLengths()) extras.emplace_back(count * length, 0.0f);
  std::fill(extras[kLifespans].begin(), extras[kLifespans].end(), kStartLifespan);
  const uint32_t last = clip_.frame_count - 1;
  const uint32_t moments = (last + kFramesBetweenMoments - 1) / kFramesBetweenMoments + 1;
  for (size_t i = 0; i < count; ++i) {
    const double place = unitDouble(keyedBits(seed, RandomUse::kStartMoment, i)) * moments;
    const uint32_t frame = std::min(static_cast<uint32_t>(place) * kFramesBetweenMoments, last);
    extras[kCentres][i] = static_cast<float>(static_cast<double>(frame) / clip_.frame_count);
  }
  if (!times.empty()) beginAtTimes(clip_, times, extras[kCentres], extras[kLifespans]);
  return extras;
}

void MovingParameterisation::rest(const RawSplats& raw) const {
  const double unit = lifespanUnit(clip_.frame_count);
  const std::vector<float>& lifespans = raw.extras[first_extra_ + kLifespans];
  lifespans_.resize(lifespans.size());
  fillInParallel(lifespans.size(), lifespans_.data(),
                 [&](size_t i) { return lifespanOf(lifespans[i], unit); });
  rest_.opacities.resize(raw.size());
  fillInParallel(raw.size(), rest_.opacities.data(),
                 [&](size_t i) { return activatedOpacity(raw.logits[i]); });
  if (!how_) return;
  rest_.scales.resize(raw.log_scales.size());
  fillInParallel(raw.log_scales.size(), rest_.scales.data(),
                 [&](size_t i) { return activatedScale(raw.log_scales[i]); });
  rest_.sh_degree = raw.sh_degree;
  rest_.positions = raw.positions;
  rest_.rotations = raw.rotations;
  rest_.sh = raw.sh;
  how_->activate(raw, rest_);
}

MotionColumns<const float> MovingParameterisation::columnsOf(const RawSplats& raw) const {
  const auto* extras = &raw.extras[first_extra_];
  MotionColumns<const float> columns;
  columns.positions = how_ ? rest_.positions.data() : raw.positions.data();
  columns.rotations = how_ ? rest_.rotations.data() : raw.rotations.data();
  columns.opacities = rest_.opacities.data();
  for (size_t wave = 0; wave < kMotionWaves; ++wave) columns.waves[wave] = extras[wave].data();
  columns.phases = extras[kPhases].data();
  columns.spins = extras[kSpins].data();
  columns.lifespans = lifespans_.data();
  columns.centres = extras[kCentres].data();
  return columns;
}

void MovingParameterisation::lifespansInUse(const RawSplats& raw,
                                            std::vector<float>& lifespans) const {
  const double unit = lifespanUnit(clip_.frame_count);
  const auto time = static_cast<float>(clip_.partOf(seconds_));
  const std::vector<float>& both = raw.extras[first_extra_ + kLifespans];
  const std::vector<float>& centres = raw.extras[first_extra_ + kCentres];
  lifespans.resize(raw.size());
  // Stretching keeps the sign of an offset.
  fillInParallel(raw.size(), lifespans.data(), [&](size_t i) {
    return lifespanOf(both[2 * i + (time < centres[i] ? 0 : 1)], unit);
  });
}

MotionCloud MovingParameterisation::cloudOf(const RawSplats& raw) const {
  rest(raw);
  const auto* extras = &raw.extras[first_extra_];
  MotionCloud moving;
  moving.splats = activated(raw);
  if (how_) how_->activate(raw, moving.splats);
  moving.spins = extras[kSpins];
  for (size_t wave = 0; wave < kMotionWaves; ++wave) moving.waves[wave] = extras[wave];
  moving.phases = extras[kPhases];
  moving.lifespans = lifespans_;
  moving.centres = extras[kCentres];
  moving.clip = clip_;
  return moving;
}

void MovingParameterisation::activate(const RawSplats& raw, SplatCloud& cloud) const {
  rest(raw);
  if (how_) {
    cloud.scales = rest_.scales;
    cloud.sh = rest_.sh;
  }
  const MotionKernel kernel = chosenMotionKernel();
  const MotionColumns<const float> columns = columnsOf(raw);
  const MomentColumns<float> moments = {cloud.positions.data(), cloud.rotations.data(),
                                        cloud.opacities.data()};
  const TimeWindow window = clip_.window();
  const auto time = static_cast<float>(clip_.partOf(seconds_));
  parallelFor(raw.size(), kGrain, [&](size_t begin, size_t end) {
    kernel.moments(columns, window, time, begin, end, moments);
  });
}

void MovingParameterisation::adjoint(const RawSplats& raw, const SplatCloud&,
                                     const CloudGradient& by_cloud, RawSplats& by_raw) const {
  rest(raw);
  by_opacity_.resize(raw.size());
  auto* extras = &by_raw.extras[first_extra_];
  MotionColumns<float> by;
  by.positions = by_raw.positions.data();
  by.rotations = by_raw.rotations.data();
  by.opacities = by_opacity_.data();
  for (size_t wave = 0; wave < kMotionWaves; ++wave) by.waves[wave] = extras[wave].data();
  by.phases = extras[kPhases].data();
  by.spins = extras[kSpins].data();
  by.lifespans = extras[kLifespans].data();
  const MotionKernel kernel = chosenMotionKernel();
  const MotionColumns<const float> columns = columnsOf(raw);
  const MomentColumns<const float> by_moments = {
      by_cloud.positions.data(), by_cloud.rotations.data(), by_cloud.opacities.data()};
  const TimeWindow window = clip_.window();
  const auto time = static_cast<float>(clip_.partOf(seconds_));
  const double unit = lifespanUnit(clip_.frame_count);
  const std::vector<float>& lifespans = raw.extras[first_extra_ + kLifespans];
  parallelFor(raw.size(), kGrain, [&](size_t begin, size_t end) {
    kernel.gradients(columns, window, time, begin, end, by_moments, by);
    for (size_t k = 2 * begin; k < 2 * end; ++k) {
      by.lifespans[k] = rawLifespanGradient(lifespans[k], unit, by.lifespans[k]);
    }
    for (size_t i = begin; i < end; ++i) {
      const float opacity = rest_.opacities[i];
      by_raw.logits[i] = by_opacity_[i] * (opacity * (1.0f - opacity));
    }
  });
  if (!how_) return;
  std::copy(by_raw.positions.begin(), by_raw.positions.end(), by_cloud.positions.begin());
  std::copy(by_raw.rotations.begin(), by_raw.rotations.end(), by_cloud.rotations.begin());
  std::copy(by_opacity_.begin(), by_opacity_.end(), by_cloud.opacities.begin());
  how_->adjoint(raw, rest_, by_cloud, by_raw);
}

}  // namespace stipple
