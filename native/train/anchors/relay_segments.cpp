// Based on: Kwak et al., MoRel, CVPR 2026 (arXiv 2512.09270): stages, windows, levels by variance.
#include "train/anchors/relay_segments.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "decode/anchors/scaffold.h"

namespace stipple {

namespace {

constexpr double kGlobalShare = 0.4;
constexpr double kKeyFrameShare = 0.05;
constexpr double kBlendShare = 0.05;
/// A window draws a view at its key frame so often while it draws one at the next key frame once,
/// and those that no other key frame shows as often.
constexpr double kMostDraws = 4;
/// A window begins with what is so near to its key frame, in units of the spacing, and reaches all
/// that it has after this share of its steps.
constexpr double kFirstReach = 0.12;
constexpr double kReachesAllAt = 0.7;

/// In units of the spacing.
double distanceOf(double time, const RelaySegment& segment, const KeyFrameClip& clip) {
  return std::abs(time - clip.timeOf(segment.key)) * clip.frames_per_second / clip.spacing;
}

/// Whether no other key frame shows what is so far behind this one.
bool isAlone(double apart, const RelaySegment& segment, const KeyFrameClip& clip) {
  return (apart < 0 && segment.key == 0) || (apart > 0 && segment.key + 1 == clip.keyCount());
}

}  // namespace

FitMoment RelaySegment::local(const FitMoment& moment) const {
  FitMoment own = moment;
  own.iteration = moment.iteration - begin;
  own.iterations = end - begin;
  return own;
}

std::vector<RelaySegment> relaySegments(uint64_t iterations, const KeyFrameClip& clip) {
  const uint32_t keys = clip.keyCount();
  const bool blends = isLearned(clip.blend) && keys > 1;
  const double blend_share = blends ? kBlendShare : 0;
  const double window_share = 1 - kGlobalShare - kKeyFrameShare - blend_share;
  std::vector<RelaySegment> segments;
  double done = 0;
  uint64_t begin = 0;
  const auto add = [&](RelayStage stage, uint32_t key, double share) {
    done += share;
    RelaySegment segment{stage, key, begin, begin};
    const auto end = static_cast<uint64_t>(std::llround(done * static_cast<double>(iterations)));
    segment.end = std::max(begin + 1, end);
    begin = segment.end;
    segments.push_back(segment);
  };
  add(RelayStage::kGlobal, 0, kGlobalShare);
  for (uint32_t key = 0; key < keys; ++key) {
    add(RelayStage::kKeyFrame, key, kKeyFrameShare / keys);
    add(RelayStage::kWindow, key, window_share / keys);
  }
  for (uint32_t key = 0; blends && key + 1 < keys; ++key) {
    add(RelayStage::kBlend, key, blend_share / (keys - 1));
  }
  return segments;
}

std::vector<size_t> viewsOfSegment(const RelaySegment& segment, const KeyFrameClip& clip,
                                   std::span<const double> times) {
  const double frame = 1 / clip.frames_per_second;
  const double middle = clip.timeOf(segment.key);
  double before = kFramesAboutKey * frame, behind = before;
  if (segment.stage == RelayStage::kGlobal) before = behind = INFINITY;
  if (segment.stage == RelayStage::kWindow) before = behind = (clip.spacing + 0.5) * frame;
  if (segment.stage == RelayStage::kBlend) {
    before = 0.5 * frame;
    behind = (clip.spacing + 0.5) * frame;
  }
  const bool is_window = segment.stage == RelayStage::kWindow;
  std::vector<size_t> views;
  double nearest = INFINITY;
  for (size_t v = 0; v < times.size(); ++v) {
    const double apart = times[v] - middle;
    if (apart >= -before && apart <= behind) {
      const double nearness =
          isAlone(apart, segment, clip) ? 1 : 1 - distanceOf(times[v], segment, clip);
      const double draws = is_window ? std::ceil(kMostDraws * nearness) : 1;
      views.insert(views.end(), static_cast<size_t>(std::max(1.0, draws)), v);
    }
    nearest = std::min(nearest, std::abs(apart));
  }
  for (size_t v = 0; views.empty() && v < times.size(); ++v) {
    if (std::abs(times[v] - middle) <= nearest) views.push_back(v);
  }
  if (is_window) {
    std::stable_sort(views.begin(), views.end(), [&](size_t a, size_t b) {
      return distanceOf(times[a], segment, clip) < distanceOf(times[b], segment, clip);
    });
  }
  return views;
}

size_t viewsInReach(const RelaySegment& segment, const KeyFrameClip& clip,
                    std::span<const double> times, std::span<const size_t> views, double done) {
  if (segment.stage != RelayStage::kWindow || done >= kReachesAllAt) return views.size();
  const double reach = std::max(kFirstReach, done / kReachesAllAt);
  const auto beyond = std::upper_bound(views.begin(), views.end(), reach, [&](double at, size_t v) {
    return at < distanceOf(times[v], segment, clip);
  });
  return std::max<size_t>(1, static_cast<size_t>(beyond - views.begin()));
}

std::vector<uint8_t> levelsOfFeatures(std::span<const float> features,
                                      const std::array<double, 2>& quantiles) {
  const size_t count = features.size() / kScaffoldFeatures;
  if (count == 0) return {};
  std::vector<double> variances(count);
  for (size_t a = 0; a < count; ++a) {
    const float* own = &features[a * kScaffoldFeatures];
    double sum = 0, squares = 0;
    for (size_t i = 0; i < kScaffoldFeatures; ++i) {
      sum += static_cast<double>(own[i]);
      squares += static_cast<double>(own[i]) * static_cast<double>(own[i]);
    }
    const double mean = sum / kScaffoldFeatures;
    variances[a] = squares / kScaffoldFeatures - mean * mean;
  }
  std::vector<uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t one, uint32_t other) { return variances[one] < variances[other]; });
  std::vector<uint8_t> levels(count);
  for (size_t rank = 0; rank < count; ++rank) {
    const double share = static_cast<double>(rank) / static_cast<double>(count);
    levels[order[rank]] = share < quantiles[0] ? 0 : share < quantiles[1] ? 1 : 2;
  }
  return levels;
}

}  // namespace stipple
