#include "train/prior/swept_points.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "data/views/view_resample.h"
#include "train/prior/shared_volume.h"
#include "train/prior/silhouette.h"

// Based on: Collins, A Space-Sweep Approach to True Multi-Image Matching, CVPR 1996 (depths of a
// pixel are judged by what other views see there); Laurentini, The Visual Hull Concept for
// Silhouette-Based Image Understanding, PAMI 1994 (what a view sees through is empty); Kang,
// Szeliski, Chai, Handling Occlusions in Dense Multi-View Stereo, CVPR 2001 (the better half of the
// neighbours counts). Differs: single pixels at random instead of whole depth pictures.

namespace stipple {

namespace {

constexpr size_t kPictures = 64;
constexpr uint64_t kMostPlaces = 30000;
constexpr uint64_t kPixelsOfAPlace = 16;
constexpr double kMostSide = 256;  ///< pixels of a picture that is compared
constexpr size_t kNeighbours = 6;
constexpr size_t kDepths = 48;
constexpr size_t kRefinements = 3;  ///< halvings of the step around the best depth
/// Half a step of eight bits: pictures that differ by less tell nothing, and chance decides.
constexpr double kNoise = 0.5 / 255;
/// What the nearest depth must be better by than the farthest, where pictures show what is behind:
/// a blank wall or sky in front of what it belongs behind hides it, the other way round it does
/// not. Views with alpha have no need of it; on blank backdrops 2 to 8 steps of eight bits serve
/// alike.
constexpr double kFarPull = 4.0 / 255;
constexpr float kEmpty = 0.02f;  ///< alpha that nothing covers
constexpr float kOpaque = 0.5f;
constexpr size_t kChannels = 4;
using Pixel = Eigen::Array4f;
constexpr size_t kGrain = 64;
constexpr uint64_t kBlock = 4096;  ///< places between two looks at the progress
constexpr const char* kStage = "Looking for surfaces";
/// The patch that is compared: a pixel and those around it, this far away, pixels.
constexpr double kSpread = 1.5;
constexpr std::array<std::array<float, 2>, 9> kTaps = {
    {{0, 0}, {-1, -1}, {0, -1}, {1, -1}, {-1, 0}, {1, 0}, {-1, 1}, {0, 1}, {1, 1}}};
/// A certain depth: its difference beside the least one of depths that are more than so many steps
/// away.
constexpr double kRivalShare = 0.5;
constexpr double kApart = 3;
/// Of a place that no neighbour sees: worse than any that matches.
constexpr double kUnseenCost = 0.5;

/// A picture at a size that is quick to compare.
struct Look {
  Camera camera;
  bool has_alpha = false;
  std::vector<float> values;  ///< [H,W,4] premultiplied colour, alpha
  Silhouette silhouette;      ///< of views with alpha
  std::vector<uint32_t> neighbours;
  std::vector<uint32_t> pixels;  ///< where something is

  /// Value between pixel centres, held at the edges.
  Pixel sample(float x, float y) const {
    const float left = std::clamp(x - 0.5f, 0.0f, static_cast<float>(camera.width - 1));
    const float top = std::clamp(y - 0.5f, 0.0f, static_cast<float>(camera.height - 1));
    const size_t x0 = static_cast<size_t>(left), y0 = static_cast<size_t>(top);
    const size_t right = x0 + 1 < camera.width ? kChannels : 0;
    const size_t below = y0 + 1 < camera.height ? camera.width * kChannels : 0;
    const float u = left - static_cast<float>(x0), v = top - static_cast<float>(y0);
    const float* at = &values[(y0 * camera.width + x0) * kChannels];
    using Values = Eigen::Map<const Pixel>;
    const Pixel upper = Values(at) + u * (Values(at + right) - Values(at));
    const Pixel lower = Values(at + below) + u * (Values(at + below + right) - Values(at + below));
    return upper + v * (lower - upper);
  }
  /// Whether nothing covers the pixel and those around it.
  bool isEmpty(double x, double y) const {
    return !silhouette.showsAround(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
  }
};

std::vector<float> reduced(const std::vector<float>& values, const ViewPicture& picture,
                           const Camera& camera, uint32_t channels) {
  if (values.empty()) return {};
  Image image;
  image.width = picture.width;
  image.height = picture.height;
  image.channels = channels;
  image.pixels = values;
  return areaAverage(image, camera.width, camera.height).pixels;
}

std::vector<size_t> comparedViews(std::span<const size_t> training) {
  std::vector<size_t> views(std::min(training.size(), kPictures));
  for (size_t p = 0; p < views.size(); ++p) views[p] = training[p * training.size() / views.size()];
  return views;
}

Camera comparedCamera(const Camera& camera) {
  const double shrink = std::min(1.0, kMostSide / std::max(camera.width, camera.height));
  return resized(camera, std::max(1u, static_cast<uint32_t>(std::lround(camera.width * shrink))),
                 std::max(1u, static_cast<uint32_t>(std::lround(camera.height * shrink))));
}

Look lookOf(const Camera& camera, const ViewPicture& picture) {
  Look look;
  look.camera = comparedCamera(camera);
  look.has_alpha = !picture.alpha.empty();
  const std::vector<float> colour = reduced(picture.colour, picture, look.camera, 3);
  const std::vector<float> alpha = reduced(picture.alpha, picture, look.camera, 1);
  const std::vector<float> weights = reduced(picture.weights, picture, look.camera, 1);
  if (look.has_alpha) {
    look.silhouette = Silhouette(look.camera.width, look.camera.height, alpha, weights, 1, kEmpty);
  }
  const size_t count = size_t{look.camera.width} * look.camera.height;
  look.values.resize(count * kChannels);
  for (size_t i = 0; i < count; ++i) {
    std::copy_n(&colour[i * 3], 3, &look.values[i * kChannels]);
    // Where a mask hides the picture nobody knows whether it is empty.
    const bool is_known = weights.empty() || weights[i] > 0;
    look.values[i * kChannels + 3] = look.has_alpha && is_known ? alpha[i] : 1.0f;
    if (is_known && look.values[i * kChannels + 3] > kOpaque) {
      look.pixels.push_back(static_cast<uint32_t>(i));
    }
  }
  return look;
}

/// The views that are most alike, but not from the same place.
void findNeighbours(std::vector<Look>& looks, double unit) {
  for (Look& look : looks) {
    std::vector<std::pair<double, uint32_t>> others;
    const Vec3d place = placeOf(look.camera), axis = axisOf(look.camera);
    for (uint32_t i = 0; i < looks.size(); ++i) {
      const double distance = (placeOf(looks[i].camera) - place).norm();
      if (distance < 1e-3 * unit) continue;
      others.emplace_back(distance / unit + 1 - axis.dot(axisOf(looks[i].camera)), i);
    }
    std::sort(others.begin(), others.end());
    for (size_t k = 0; k < std::min(others.size(), kNeighbours); ++k) {
      look.neighbours.push_back(others[k].second);
    }
  }
}

/// The depths, in a parameter from 0 to 1, along which the pictures of a place move evenly.
struct DepthRange {
  double near = 0, far = 1;
  bool is_inverse = true;
  double at(double t) const {
    return is_inverse ? 1 / ((1 - t) / near + t / far) : near + t * (far - near);
  }
};

constexpr double kAround = 1.5;    ///< radii of the volume where something may be
constexpr double kNearest = 0.05;  ///< of the distance to the volume's middle
constexpr double kFarthest = 20;   ///< of the same, where pictures show what is behind

DepthRange rangeOf(const Look& look, const SharedVolume& volume) {
  const Camera& camera = look.camera;
  const Vec3d middle = camera.world_to_camera.topLeftCorner<3, 3>() * volume.centre +
                       camera.world_to_camera.topRightCorner<3, 1>();
  const double distance =
      volume.is_around ? volume.radius / 3 : std::max(middle[2], 1e-3 * volume.radius);
  DepthRange range;
  range.is_inverse = camera.model == CameraModel::kPerspective;
  range.near = std::max(distance - kAround * volume.radius, kNearest * distance);
  range.far = distance + kAround * volume.radius;
  if (!look.has_alpha && range.is_inverse) range.far = std::max(range.far, kFarthest * distance);
  range.near = std::max(range.near, camera.near_plane);
  range.far = std::max(range.far, 2 * range.near);
  return range;
}

/// Where the ray of a pixel runs in another camera: origin + depth * step, metres.
struct Path {
  Vec3d origin, step;
};

Path pathOf(const Camera& from, double x, double y, const Camera& to) {
  const auto at = [&](double depth) -> Vec3d {
    return to.world_to_camera.topLeftCorner<3, 3>() * unproject(from, x, y, depth) +
           to.world_to_camera.topRightCorner<3, 1>();
  };
  return {at(0), at(1) - at(0)};
}

class Sweep {
 public:
  Sweep(const std::vector<Look>& looks, const Look& look, uint32_t pixel)
      : looks_(looks),
        look_(look),
        x_(pixel % look.camera.width + 0.5),
        y_(pixel / look.camera.width + 0.5) {
    const Camera& camera = look.camera;
    for (size_t n = 0; n < look.neighbours.size(); ++n) {
      const Camera& other = looks[look.neighbours[n]].camera;
      paths_[n][0] = pathOf(camera, x_, y_, other);
      paths_[n][1] = pathOf(camera, x_ + kSpread, y_, other);
      paths_[n][2] = pathOf(camera, x_, y_ + kSpread, other);
    }
    for (size_t k = 0; k < kTaps.size(); ++k) {
      patch_[k] = look.sample(static_cast<float>(x_) + static_cast<float>(kSpread) * kTaps[k][0],
                              static_cast<float>(y_) + static_cast<float>(kSpread) * kTaps[k][1]);
    }
  }

  Vec3d place(double depth) const { return unproject(look_.camera, x_, y_, depth); }

  /// Mean difference of the patch in the better half of the neighbours; infinite where one of them
  /// sees through it.
  double cost(double depth) const {
    std::array<float, kNeighbours> costs{};
    size_t count = 0;
    for (size_t n = 0; n < look_.neighbours.size(); ++n) {
      const Look& other = looks_[look_.neighbours[n]];
      double at[3][2];
      bool is_seen = true;
      for (size_t k = 0; k < 3 && is_seen; ++k) {
        const Vec3d place = paths_[n][k].origin + depth * paths_[n][k].step;
        is_seen = projectLocal(other.camera, place, at[k][0], at[k][1]);
        if (k == 0 && is_seen && other.has_alpha && other.isEmpty(at[0][0], at[0][1]))
          return HUGE_VAL;
      }
      if (!is_seen) continue;
      const float x = static_cast<float>(at[0][0]), y = static_cast<float>(at[0][1]);
      const float right[2] = {static_cast<float>(at[1][0]) - x, static_cast<float>(at[1][1]) - y};
      const float below[2] = {static_cast<float>(at[2][0]) - x, static_cast<float>(at[2][1]) - y};
      Pixel sum = Pixel::Zero();
      for (size_t k = 0; k < kTaps.size(); ++k) {
        const float u = kTaps[k][0], v = kTaps[k][1];
        sum += (other.sample(x + u * right[0] + v * below[0], y + u * right[1] + v * below[1]) -
                patch_[k])
                   .abs();
      }
      const float cost = sum.sum() / static_cast<float>(kTaps.size() * kChannels);
      // Lowest first.
      size_t rank = count++;
      for (; rank > 0 && costs[rank - 1] > cost; --rank) costs[rank] = costs[rank - 1];
      costs[rank] = cost;
    }
    if (count == 0) return kUnseenCost;
    const size_t half = (count + 1) / 2;
    float sum = 0;
    for (size_t k = 0; k < half; ++k) sum += costs[k];
    return static_cast<double>(sum) / static_cast<double>(half);
  }

  bool isSeenThrough(const Vec3d& point) const {
    double x = 0, y = 0;
    for (const Look& look : looks_) {
      if (look.has_alpha && project(look.camera, point, x, y) && look.isEmpty(x, y)) return true;
    }
    return false;
  }

 private:
  const std::vector<Look>& looks_;
  const Look& look_;
  double x_, y_;
  std::array<std::array<Path, 3>, kNeighbours> paths_;
  std::array<Pixel, kTaps.size()> patch_;
};

/// A pixel's place on a surface.
struct Found {
  bool is_one = false;
  Vec3d place = Vec3d::Zero();
  float colour[3] = {0, 0, 0};
};

/// In: tries of a ray, by rising cost.
bool isToldApart(std::span<const std::pair<double, double>> tries,
                 const std::pair<double, double>& best) {
  const auto rival = std::find_if(tries.begin(), tries.end(), [&](const auto& each) {
    return std::abs(each.second - best.second) * kDepths > kApart;
  });
  return rival == tries.end() || best.first < kRivalShare * rival->first - kNoise;
}

/// In: chance, of which 2 + kDepths numbers are used.
template <typename Chance>
Found findPlace(const std::vector<Look>& looks, const Look& look, const SharedVolume& volume,
                uint32_t pixel, bool must_be_certain, const Chance& chance) {
  const Sweep sweep(looks, look, pixel);
  const DepthRange range = rangeOf(look, volume);
  const double pull = look.has_alpha || look.neighbours.empty() ? 0 : kFarPull;
  std::array<std::pair<double, double>, kDepths> tries;  // cost, parameter
  for (size_t k = 0; k < kDepths; ++k) {
    const double t = (static_cast<double>(k) + chance(0)) / kDepths;
    tries[k] = {sweep.cost(range.at(t)) + kNoise * chance(2 + k) + pull * (1 - t), t};
  }
  std::sort(tries.begin(), tries.end());
  const auto stands = [&](const auto& each) {
    return each.first < HUGE_VAL && !sweep.isSeenThrough(sweep.place(range.at(each.second)));
  };
  const auto first = std::find_if(tries.begin(), tries.end(), stands);
  if (first == tries.end()) return {};
  if (must_be_certain && !isToldApart(tries, *first)) return {};
  double t = first->second;
  double best = sweep.cost(range.at(t));
  double step = 0.5 / kDepths;
  for (size_t k = 0; k < kRefinements; ++k, step *= 0.5) {
    const double at = t;
    for (const double tried : {at - step, at + step}) {
      if (tried < 0 || tried > 1) continue;
      const double cost = sweep.cost(range.at(tried));
      if (cost >= best) continue;
      best = cost;
      t = tried;
    }
  }
  Found found;
  found.is_one = true;
  found.place = sweep.place(range.at(t));
  const float* value = &look.values[pixel * kChannels];
  for (size_t c = 0; c < 3; ++c) found.colour[c] = value[c] / value[3];
  return found;
}

}  // namespace

uint64_t placesOfPictures(const ViewSource& views, std::span<const size_t> training) {
  uint64_t pixels = 0;
  for (const size_t view : comparedViews(training)) {
    const Camera small = comparedCamera(views.camera(view));
    pixels += uint64_t{small.width} * small.height;
  }
  return std::clamp<uint64_t>(pixels / kPixelsOfAPlace, 1, kMostPlaces);
}

StartPoints sweptPoints(const ViewSource& views, std::span<const size_t> training,
                        const SweepOptions& options, Progress* progress) {
  const uint64_t count = options.count;
  std::vector<Look> looks;
  const std::vector<size_t> compared = comparedViews(training);
  for (size_t p = 0; p < compared.size(); ++p) {
    advance(progress, static_cast<double>(p) / static_cast<double>(compared.size()), kStage);
    const size_t view = compared[p];
    Look look = lookOf(views.camera(view), views.load(view));
    // A picture of nothing is a mistake more often than a proof that there is nothing.
    if (!look.pixels.empty()) looks.push_back(std::move(look));
  }
  if (looks.empty()) return {};
  std::vector<Camera> cameras;
  for (const Look& look : looks) cameras.push_back(look.camera);
  const SharedVolume volume = sharedVolume(cameras);
  findNeighbours(looks, volume.radius);

  StartPoints points;
  std::vector<Found> found;
  for (uint64_t first = 0; first < count; first += kBlock) {
    advance(progress, static_cast<double>(first) / static_cast<double>(count), kStage);
    found.assign(std::min(kBlock, count - first), {});
    parallelFor(found.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t k = begin; k < end; ++k) {
        const uint64_t i = first + k;
        const auto chance = [&](uint64_t what) {
          return unitDouble(
              keyedBits(options.seed, RandomUse::kStartPoint, i * (2 + kDepths) + what));
        };
        // Views in turn, each one's pixels in as many runs as it has turns.
        const Look& look = looks[i % looks.size()];
        const uint64_t turns = (count - i % looks.size() + looks.size() - 1) / looks.size();
        const double along =
            (static_cast<double>(i / looks.size()) + chance(1)) / static_cast<double>(turns);
        const size_t at = static_cast<size_t>(along * static_cast<double>(look.pixels.size()));
        found[k] = findPlace(looks, look, volume, look.pixels[std::min(at, look.pixels.size() - 1)],
                             options.only_certain, chance);
      }
    });
    for (const Found& each : found) {
      if (each.is_one) points.add(each.place, each.colour);
    }
  }
  return points;
}

}  // namespace stipple
