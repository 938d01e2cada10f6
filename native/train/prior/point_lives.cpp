#include "train/prior/point_lives.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/parallel.h"
#include "train/prior/shared_volume.h"

namespace stipple {

namespace {

constexpr size_t kMostCameras = 5;
constexpr size_t kMostTimes = 48;
/// Largest difference of a channel of one colour, of two images.
constexpr float kLikeness = 0.12f;
/// A point is always there that is seen at so large a share of the times at which cameras say
/// something.
constexpr double kSteadyShare = 0.7;
constexpr float kOpaque = 0.5f;
constexpr size_t kGrain = 1 << 12;
/// Of the entries of a camera's matrix, in metres and in sines: cameras that stand still are often
/// written with few digits.
constexpr double kStill = 1e-5;

bool isSameCamera(const Camera& a, const Camera& b) {
  const double reach = 1 + a.world_to_camera.cwiseAbs().maxCoeff();
  return a.model == b.model && a.width == b.width && a.height == b.height &&
         std::abs(a.fx - b.fx) <= kStill * a.fx && std::abs(a.fy - b.fy) <= kStill * a.fy &&
         (a.world_to_camera - b.world_to_camera).cwiseAbs().maxCoeff() <= kStill * reach;
}

/// `most` of them, spread evenly, in order.
template <class T>
std::vector<T> spread(const std::vector<T>& all, size_t most) {
  if (all.size() <= most) return all;
  std::vector<T> chosen;
  for (size_t i = 0; i < most; ++i) chosen.push_back(all[i * (all.size() - 1) / (most - 1)]);
  return chosen;
}

/// Views of one camera that stands still, in the order of their times.
using Still = std::vector<size_t>;

/// Those cameras that have at least two views.
std::vector<Still> stillCameras(const ViewSource& views, std::span<const size_t> training) {
  std::vector<Still> cameras;
  for (const size_t view : training) {
    const auto same = [&](const Still& still) {
      return isSameCamera(views.camera(still.front()), views.camera(view));
    };
    const auto found = std::find_if(cameras.begin(), cameras.end(), same);
    if (found != cameras.end()) {
      found->push_back(view);
    } else if (cameras.size() < 256) {  // cameras that move have one for each view
      cameras.push_back({view});
    }
  }
  std::erase_if(cameras, [](const Still& still) { return still.size() < 2; });
  for (Still& still : cameras) {
    std::stable_sort(still.begin(), still.end(),
                     [&](size_t a, size_t b) { return views.time(a) < views.time(b); });
  }
  return cameras;
}

/// What a camera says of a point at a time.
enum class Answer : uint8_t { kNothing = 0, kAlike = 1, kOther = 2 };

Answer answerOf(const ViewPicture& picture, const Camera& camera, const StartPoints& points,
                size_t point) {
  const float* place = &points.positions[point * 3];
  double x = 0, y = 0;
  if (!project(camera, Vec3f(place[0], place[1], place[2]).cast<double>(), x, y)) {
    return Answer::kNothing;
  }
  const size_t pixel = static_cast<size_t>(y) * picture.width + static_cast<size_t>(x);
  if (!picture.weights.empty() && !(picture.weights[pixel] > 0)) return Answer::kNothing;
  const float alpha = picture.alpha.empty() ? 1.0f : picture.alpha[pixel];
  if (alpha < kOpaque) return Answer::kOther;
  float difference = 0;
  for (size_t c = 0; c < 3; ++c) {
    const float seen = picture.colour[pixel * 3 + c] / alpha;
    difference = std::max(difference, std::abs(seen - points.colours[point * 3 + c]));
  }
  return difference <= kLikeness ? Answer::kAlike : Answer::kOther;
}

/// How long a point lives, from what the cameras answer. In: answers [cameras][times] of all
/// points; own: its time among the times.
void liveOf(const std::vector<std::vector<std::vector<Answer>>>& answers,
            const std::vector<double>& times, size_t point, size_t own, double at, float* life) {
  std::vector<int> votes(times.size(), 0);
  std::vector<bool> is_said(times.size(), false);
  bool is_seen = false;
  for (const auto& camera : answers) {
    if (camera[own][point] != Answer::kAlike) continue;  // hidden, or outside of the image
    is_seen = true;
    for (size_t t = 0; t < times.size(); ++t) {
      if (camera[t][point] == Answer::kNothing) continue;
      is_said[t] = true;
      votes[t] += camera[t][point] == Answer::kAlike ? 1 : -1;
    }
  }
  if (!is_seen) return;
  size_t said = 0, alike = 0;
  for (size_t t = 0; t < times.size(); ++t) {
    said += is_said[t];
    alike += is_said[t] && votes[t] >= 0;
  }
  life[0] = life[1] = kWholeLife;
  if (static_cast<double>(alike) >= kSteadyShare * static_cast<double>(said)) return;
  const auto ends = [&](size_t t) { return is_said[t] && votes[t] < 0; };
  // Half-way between the last time at which it is there and the first at which it is not.
  for (size_t t = own; t > 0; --t) {
    if (!ends(t - 1)) continue;
    life[0] = static_cast<float>(std::max(0.0, at - (times[t - 1] + times[t]) / 2));
    break;
  }
  for (size_t t = own; t + 1 < times.size(); ++t) {
    if (!ends(t + 1)) continue;
    life[1] = static_cast<float>(std::max(0.0, (times[t] + times[t + 1]) / 2 - at));
    break;
  }
}

void keepDistinct(std::vector<double>& times) {
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
}

/// Which of the times is nearest.
size_t nearest(const std::vector<double>& times, double at) {
  const auto after = std::lower_bound(times.begin(), times.end(), at);
  const auto next = static_cast<size_t>(after - times.begin());
  const bool is_before =
      next == times.size() || (next > 0 && at - times[next - 1] < times[next] - at);
  return next - (is_before ? 1 : 0);
}

/// Half-way to the moments before and after.
void liveUntilNext(const std::vector<double>& moments, double at, float* life) {
  const auto own = std::lower_bound(moments.begin(), moments.end(), at);
  life[0] = own == moments.begin() ? kWholeLife : static_cast<float>((at - *(own - 1)) / 2);
  life[1] = own + 1 == moments.end() ? kWholeLife : static_cast<float>((*(own + 1) - at) / 2);
}

}  // namespace

std::vector<float> pointLives(const ViewSource& views, std::span<const size_t> training,
                              const StartPoints& points, Progress* progress) {
  if (points.times.empty()) return {};
  const std::vector<Still> cameras = spread(stillCameras(views, training), kMostCameras);
  std::vector<double> moments;
  for (const double time : points.times) {
    if (!std::isnan(time)) moments.push_back(time);
  }
  const bool tells_what_moves = moments.size() < points.times.size();
  keepDistinct(moments);
  std::vector<double> times;
  for (const Still& still : cameras) {
    for (const size_t view : still) times.push_back(views.time(view));
  }
  keepDistinct(times);
  times = spread(times, kMostTimes);

  std::vector<std::vector<std::vector<Answer>>> answers(cameras.size());
  for (size_t c = 0; c < cameras.size(); ++c) {
    for (size_t t = 0; t < times.size(); ++t) {
      advance(progress,
              static_cast<double>(c * times.size() + t) /
                  static_cast<double>(cameras.size() * times.size()),
              "Looking for what moves");
      answers[c].emplace_back(points.size(), Answer::kNothing);
      const auto view = std::find_if(cameras[c].begin(), cameras[c].end(),
                                     [&](size_t v) { return views.time(v) == times[t]; });
      if (view == cameras[c].end()) continue;  // a frame that this camera lacks
      const ViewPicture picture = views.load(*view);
      parallelFor(points.size(), kGrain, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
          answers[c][t][i] = answerOf(picture, views.camera(*view), points, i);
        }
      });
    }
  }
  std::vector<float> lives(points.size() * 2, kUnknownLife);
  parallelFor(points.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double at = points.times[i];
      float* life = &lives[i * 2];
      if (std::isnan(at)) life[0] = life[1] = kWholeLife;
      if (std::isnan(at)) continue;
      if (!times.empty()) liveOf(answers, times, i, nearest(times, at), at, life);
      if (life[0] < 0 && tells_what_moves) liveUntilNext(moments, at, life);
    }
  });
  return lives;
}

}  // namespace stipple
