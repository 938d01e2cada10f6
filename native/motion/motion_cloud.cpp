#include "motion/motion_cloud.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "data/clouds/cloud_selection.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;

struct Bounds {
  float smallest, largest;
};

constexpr Bounds kAnyFinite = {-3e38f, 3e38f};

void requireColumn(const std::vector<float>& column, size_t count, Bounds bounds, const char* what,
                   const char* name) {
  if (column.size() != count) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + " has " + std::to_string(column.size()) +
                                          " numbers of " + name + "; " + std::to_string(count) +
                                          " are needed");
  }
  for (size_t i = 0; i < count; ++i) {
    if (column[i] >= bounds.smallest && column[i] <= bounds.largest) continue;
    fail(ErrorCode::kInvalidArgument,
         std::string(what) + " has " + numberText(static_cast<double>(column[i])) + " among its " +
             name + "; " + numberText(static_cast<double>(bounds.smallest)) + " to " +
             numberText(static_cast<double>(bounds.largest)) + " is allowed");
  }
}

void requireClip(const MotionClip& clip, const char* what) {
  const bool holds = std::isfinite(clip.begin) && std::isfinite(clip.frames_per_second) &&
                     clip.frames_per_second > 0 && clip.frame_count >= 1 &&
                     std::isfinite(clip.window_frames) && clip.window_frames >= 0 &&
                     clip.window_share > 0 && clip.window_share < 1;
  if (holds) return;
  fail(ErrorCode::kInvalidArgument,
       std::string(what) + " has a clip of " + std::to_string(clip.frame_count) + " frames at " +
           numberText(clip.frames_per_second) + " a second from " + numberText(clip.begin) +
           " s, with a window of " + numberText(clip.window_frames) + " frames and a share of " +
           numberText(clip.window_share) +
           "; it needs a frame, a rate above 0, a window of 0 or more and a share between 0 and 1");
}

/// Rows of a column whose mask is not 0. In: width, numbers in a row.
std::vector<float> keptRows(const std::vector<float>& column, size_t width,
                            std::span<const uint8_t> mask) {
  std::vector<float> rows;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (!mask[i]) continue;
    const auto first = column.begin() + static_cast<std::ptrdiff_t>(i * width);
    rows.insert(rows.end(), first, first + static_cast<std::ptrdiff_t>(width));
  }
  return rows;
}

}  // namespace

double MotionClip::partOf(double seconds) const {
  const double last = static_cast<double>(frame_count - 1);
  // Beyond the clip, times of any size: their product with a rate may be no number.
  if (seconds <= begin) return 0;
  if (seconds >= end()) return last / frame_count;
  return std::clamp((seconds - begin) * frames_per_second, 0.0, last) / frame_count;
}

MotionColumns<const float> MotionCloud::columns() const {
  MotionColumns<const float> given;
  given.positions = splats.positions.data();
  given.rotations = splats.rotations.data();
  given.opacities = splats.opacities.data();
  for (size_t wave = 0; wave < kMotionWaves; ++wave) given.waves[wave] = waves[wave].data();
  given.phases = phases.data();
  given.spins = spins.data();
  given.lifespans = lifespans.data();
  given.centres = centres.data();
  return given;
}

void validate(const MotionCloud& moving, const char* what) {
  validate(moving.splats, what);
  requireClip(moving.clip, what);
  const size_t count = moving.size();
  for (const auto& wave : moving.waves) requireColumn(wave, 3 * count, kAnyFinite, what, "waves");
  requireColumn(moving.phases, 4 * count, kAnyFinite, what, "phases");
  requireColumn(moving.spins, 4 * count, kAnyFinite, what, "spins");
  requireColumn(moving.lifespans, 2 * count,
                {static_cast<float>(kSmallestLifespan), static_cast<float>(kLargestLifespan)}, what,
                "lifespans");
  requireColumn(moving.centres, count, {0, 1}, what, "centres");
}

void momentsAt(const MotionCloud& moving, double seconds, const MomentColumns<float>& moments) {
  const MotionKernel kernel = chosenMotionKernel();
  const MotionColumns<const float> columns = moving.columns();
  const TimeWindow window = moving.clip.window();
  const auto time = static_cast<float>(moving.clip.partOf(seconds));
  parallelFor(moving.size(), kGrain, [&](size_t begin, size_t end) {
    kernel.moments(columns, window, time, begin, end, moments);
  });
}

MotionCloud kept(const MotionCloud& moving, std::span<const uint8_t> mask) {
  MotionCloud result;
  result.splats = kept(moving.splats, mask);
  for (size_t wave = 0; wave < kMotionWaves; ++wave) {
    result.waves[wave] = keptRows(moving.waves[wave], 3, mask);
  }
  result.phases = keptRows(moving.phases, 4, mask);
  result.spins = keptRows(moving.spins, 4, mask);
  result.lifespans = keptRows(moving.lifespans, 2, mask);
  result.centres = keptRows(moving.centres, 1, mask);
  result.clip = moving.clip;
  return result;
}

SplatCloud splatsAt(const MotionCloud& moving, double seconds) {
  SplatCloud cloud = moving.splats;
  momentsAt(moving, seconds,
            {cloud.positions.data(), cloud.rotations.data(), cloud.opacities.data()});
  return cloud;
}

}  // namespace stipple
