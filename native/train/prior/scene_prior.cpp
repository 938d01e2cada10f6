#include "train/prior/scene_prior.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "base/random.h"
#include "decode/field/contraction.h"
#include "math/vec.h"
#include "train/prior/shared_volume.h"
#include "train/prior/swept_points.h"
#include "train/prior/visual_hull.h"

namespace stipple {

namespace {

/// A surface is known where this much of a pixel is covered.
constexpr float kCovered = 0.5f;
constexpr double kOutliers = 0.01;
/// Points that reach this much farther than all but the outliers are no outliers.
constexpr double kCompact = 1.3;
constexpr double kMargin = 0.1;
/// Pixels of one colour, of all: a backdrop. Skies of photographs are not as plain.
constexpr double kBlankShare = 0.1;
/// Most pixels' depth is not certain; where hardly any is, they tell nothing of the scene.
constexpr uint64_t kTriesOfAPlace = 3;
constexpr double kLeastCertain = 0.01;
/// Cameras that are asked whether they see a point.
constexpr size_t kWitnesses = 100;
/// Pictures that are asked what they show beyond the root, every so many-th pixel, and the share of
/// them that has to.
constexpr size_t kLooks = 4;
constexpr size_t kPixelStep = 7;
constexpr double kSeenBeyond = 0.05;
/// Weight of the shell beside that of all points, and places in it.
constexpr double kShellShare = 0.25;
constexpr size_t kShellPlaces = 20000;
/// How far out they go, in halves of the inner cube's side: out of doors, and behind walls that
/// hide all else, where they only have to stand behind the gaps between splats.
constexpr double kFarReach = 32;
constexpr double kNearReach = 2;

/// What pictures show outside the root.
enum class Beyond { kNothing, kWalls, kFarThings };

/// World place of a pixel's middle at a depth.
Vec3d unprojected(const Camera& camera, size_t x, size_t y, double depth) {
  return unproject(camera, static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5, depth);
}

void addPoint(ScenePrior& prior, const Vec3d& place, float weight) {
  for (int axis = 0; axis < 3; ++axis) prior.positions.push_back(static_cast<float>(place[axis]));
  prior.weights.push_back(weight);
}

/// Points of the source, weighted as it says, with a mean of 1.
void addPoints(const PointSet& points, ScenePrior& prior) {
  double sum = 0;
  for (const float weight : points.weights) sum += static_cast<double>(weight);
  const size_t count = points.positions.size() / 3;
  const double scale = sum > 0 ? static_cast<double>(count) / sum : 0;
  for (size_t i = 0; i < count; ++i) {
    const float* p = &points.positions[i * 3];
    const float weight =
        scale > 0 ? static_cast<float>(scale * static_cast<double>(points.weights[i])) : 1.0f;
    if (weight > 0) addPoint(prior, Vec3d(p[0], p[1], p[2]), weight);
  }
}

void addDepth(const ViewSource& views, std::span<const size_t> training,
              const ScenePriorOptions& options, ScenePrior& prior, Progress* progress) {
  const size_t view_count = std::min(training.size(), options.depth_views);
  const size_t per_view = options.depth_points / view_count;
  for (size_t v = 0; v < view_count; ++v) {
    advance(progress, static_cast<double>(v) / static_cast<double>(view_count),
            "Looking for surfaces");
    const size_t view = training[v * training.size() / view_count];
    const ViewPicture picture = views.load(view);
    if (picture.depth.empty()) return;  // the others have none either
    const Camera& camera = views.camera(view);
    const size_t pixels = size_t{picture.width} * picture.height;
    const auto known = [&](size_t i) {
      return picture.depth[i] > 0 && static_cast<double>(picture.depth[i]) < camera.far_plane &&
             (picture.alpha.empty() || picture.alpha[i] > kCovered);
    };
    size_t known_count = 0;
    for (size_t i = 0; i < pixels; ++i) known_count += known(i) ? 1 : 0;
    // Every pixel has the same chance, by its own number.
    const double chance = std::min(
        1.0, static_cast<double>(per_view) / std::max(1.0, static_cast<double>(known_count)));
    for (size_t i = 0; i < pixels; ++i) {
      if (!known(i)) continue;
      const uint64_t key = static_cast<uint64_t>(view) << 32 | i;
      if (unitDouble(keyedBits(options.seed, RandomUse::kPriorSample, key)) >= chance) continue;
      addPoint(prior,
               unprojected(camera, i % picture.width, i / picture.width,
                           static_cast<double>(picture.depth[i])),
               1.0f);
    }
  }
}

/// Whether pictures are of something before a backdrop of one colour, as renders without alpha are.
bool haveBlankBackdrop(const ViewSource& views, std::span<const size_t> training) {
  std::unordered_map<uint32_t, size_t> counts;
  size_t asked = 0, most = 0;
  const size_t looks = std::min(training.size(), kLooks);
  for (size_t v = 0; v < looks; ++v) {
    const ViewPicture picture = views.load(training[v * training.size() / looks]);
    for (size_t i = 0; i + 2 < picture.colour.size(); i += 3 * kPixelStep) {
      uint32_t key = 0;
      for (size_t c = 0; c < 3; ++c) {
        const float value = std::clamp(picture.colour[i + c], 0.0f, 1.0f);
        key = key << 8 | static_cast<uint32_t>(std::lround(value * 255));
      }
      most = std::max(most, ++counts[key]);
      ++asked;
    }
  }
  return static_cast<double>(most) > kBlankShare * static_cast<double>(asked);
}

/// Places whose depth opaque pictures tell for certain, as a reconstruction would. Before a blank
/// backdrop there are none: what is plain on both sides of an outline would get no density, and the
/// fog does better. Alpha tells more, and its hull has no wrong depths.
void addWherePicturesAgree(const ViewSource& views, std::span<const size_t> training,
                           const ScenePriorOptions& options, ScenePrior& prior,
                           Progress* progress) {
  if (!views.load(training[0]).alpha.empty() || haveBlankBackdrop(views, training)) return;
  SweepOptions sweep;
  sweep.count = kTriesOfAPlace * placesOfPictures(views, training);
  sweep.seed = options.seed;
  sweep.only_certain = true;
  const StartPoints found = sweptPoints(views, training, sweep, progress);
  if (static_cast<double>(found.size()) < kLeastCertain * static_cast<double>(sweep.count)) return;
  for (size_t i = 0; i < found.size(); ++i) {
    addPoint(prior, Eigen::Map<const Vec3f>(&found.positions[i * 3]).cast<double>(), 1.0f);
  }
}

/// Keeps points that at least two of the cameras see; all where none is.
void dropUnseen(const ViewSource& views, std::span<const size_t> training, ScenePrior& prior) {
  const size_t witnesses = std::min(training.size(), kWitnesses);
  const size_t needed = std::min<size_t>(2, witnesses);
  ScenePrior kept;
  for (size_t i = 0; i < prior.weights.size(); ++i) {
    const float* p = &prior.positions[i * 3];
    const Vec3d place(p[0], p[1], p[2]);
    size_t seen = 0;
    for (size_t w = 0; w < witnesses && seen < needed; ++w) {
      double x = 0, y = 0;
      seen += project(views.camera(training[w * training.size() / witnesses]), place, x, y) ? 1 : 0;
    }
    if (seen >= needed) addPoint(kept, place, prior.weights[i]);
  }
  if (kept.weights.empty()) return;
  prior.positions = std::move(kept.positions);
  prior.weights = std::move(kept.weights);
}

RootCube cubeAround(const Vec3d& low, const Vec3d& high, double margin) {
  const Vec3d middle = 0.5 * (low + high);
  const double least = 1e-3 + 1e-6 * middle.cwiseAbs().maxCoeff();
  const double side = std::max((high - low).maxCoeff() * (1 + margin), least);
  RootCube root;
  for (int axis = 0; axis < 3; ++axis) {
    root.origin[static_cast<size_t>(axis)] = middle[axis] - 0.5 * side;
  }
  root.side = side;
  return root;
}

RootCube cubeOfPoints(const std::vector<float>& positions) {
  const size_t count = positions.size() / 3;
  const size_t cut = static_cast<size_t>(kOutliers * static_cast<double>(count));
  Vec3d low, high;
  std::vector<double> places(count);
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < count; ++i) places[i] = static_cast<double>(positions[i * 3 + axis]);
    std::sort(places.begin(), places.end());
    low[static_cast<int>(axis)] = places[cut];
    high[static_cast<int>(axis)] = places[count - 1 - cut];
    const double inner = places[count - 1 - cut] - places[cut];
    if (places[count - 1] - places[0] > kCompact * inner) continue;
    low[static_cast<int>(axis)] = places[0];
    high[static_cast<int>(axis)] = places[count - 1];
  }
  return cubeAround(low, high, kMargin);
}

bool holds(const RootCube& root, const Vec3d& place) {
  for (int axis = 0; axis < 3; ++axis) {
    const double at = place[axis] - root.origin[static_cast<size_t>(axis)];
    if (at < 0 || at > root.side) return false;
  }
  return true;
}

/// Nothing where alpha says what belongs to the scene, walls where depth ends inside the root, far
/// things where it does not or nothing tells.
Beyond seenBeyond(const ViewSource& views, std::span<const size_t> training, const RootCube& root) {
  const size_t looks = std::min(training.size(), kLooks);
  size_t beyond = 0, asked = 0;
  for (size_t v = 0; v < looks; ++v) {
    const size_t view = training[v * training.size() / looks];
    const ViewPicture picture = views.load(view);
    if (!picture.alpha.empty()) return Beyond::kNothing;
    const Camera& camera = views.camera(view);
    for (size_t i = 0; i < picture.depth.size(); i += kPixelStep) {
      if (!picture.weights.empty() && picture.weights[i] <= 0) continue;
      ++asked;
      const auto depth = static_cast<double>(picture.depth[i]);
      const bool is_known = depth > 0 && depth < camera.far_plane;
      beyond += !is_known ||
                !holds(root, unprojected(camera, i % picture.width, i / picture.width, depth));
    }
  }
  const bool is_open =
      asked == 0 || static_cast<double>(beyond) > kSeenBeyond * static_cast<double>(asked);
  return is_open ? Beyond::kFarThings : Beyond::kWalls;
}

/// Makes the root the inner half of a contracted one, and sows places along rays behind it: evenly
/// in the contracted root, as nothing is known of distances, out to `reach`.
void addShell(const ViewSource& views, std::span<const size_t> training, uint64_t seed,
              double reach, ScenePrior& prior) {
  const double inner = prior.root.side;
  for (double& origin : prior.root.origin) origin -= 0.5 * inner;
  prior.root.side = 2 * inner;
  prior.contracted = true;
  prior.known_level = std::min(prior.known_level + 1, kMaxLeafLevel);
  if (prior.weights.empty()) return;  // the density is even, in the shell as well
  const Contraction contraction(prior.root);
  for (size_t i = 0; i < prior.weights.size(); ++i) {
    float* p = &prior.positions[i * 3];
    const Vec3d place = contraction.fromWorld(Vec3d(p[0], p[1], p[2]));
    for (int axis = 0; axis < 3; ++axis) p[axis] = static_cast<float>(place[axis]);
  }
  const Vec3d middle = Vec3d(prior.root.origin[0], prior.root.origin[1], prior.root.origin[2]) +
                       Vec3d::Constant(inner);
  const double sum = std::accumulate(prior.weights.begin(), prior.weights.end(), 0.0);
  const double weight = kShellShare * sum / static_cast<double>(kShellPlaces);
  for (size_t i = 0; i < kShellPlaces; ++i) {
    const auto drawn = [&](uint64_t what) {
      return unitDouble(
          keyedBits(seed, RandomUse::kPriorSample, (uint64_t{1} << 63) + 4 * i + what));
    };
    const Camera& camera = views.camera(training[i % training.size()]);
    const auto x = static_cast<size_t>(drawn(0) * camera.width);
    const auto y = static_cast<size_t>(drawn(1) * camera.height);
    const Vec3d eye = unprojected(camera, x, y, 0);
    const Vec3d along = unprojected(camera, x, y, 1) - eye;
    // The place of the ray whose largest coordinate is r halves of the inner cube from the middle.
    const double r = 0.5 * inner / (1 - drawn(2) * (1 - 1 / reach));
    double far = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double wall = (along[axis] < 0 ? -r : r) + middle[axis] - eye[axis];
      const double at = along[axis] == 0 ? 1e30 : wall / along[axis];
      far = axis == 0 ? at : std::min(far, at);
    }
    if (far <= 0) continue;  // the camera is farther out and looks away
    addPoint(prior, contraction.fromWorld(eye + far * along), static_cast<float>(weight));
  }
}

/// The ball that all cameras see, about: around the place nearest to all optical axes, out to the
/// nearest side of a picture; where cameras look away from each other, around them.
RootCube cubeOfCameras(const ViewSource& views, std::span<const size_t> training) {
  Mat3d sum = Mat3d::Identity() * 1e-6;
  Vec3d target = Vec3d::Zero();
  Vec3d centre = Vec3d::Zero();
  for (const size_t view : training) {
    const Camera& camera = views.camera(view);
    const Vec3d axis = camera.world_to_camera.block<1, 3>(2, 0).transpose();
    const Mat3d across = Mat3d::Identity() - axis * axis.transpose();
    sum += across;
    target += across * cameraCentre(camera);
    centre += cameraCentre(camera) / static_cast<double>(training.size());
  }
  target += 1e-6 * centre;
  const Vec3d middle = sum.ldlt().solve(target);
  double radius = 1e30;
  double extent = 0;
  for (const size_t view : training) {
    const Camera& camera = views.camera(view);
    extent = std::max(extent, (cameraCentre(camera) - centre).norm());
    const Vec3d p = (camera.world_to_camera * middle.homogeneous()).head<3>();
    const double half = 0.5 * std::min(camera.width / camera.fx, camera.height / camera.fy);
    const bool flat = camera.model == CameraModel::kOrthographic;
    if (!flat && p.z() <= camera.near_plane) continue;  // looks away
    radius = std::min(radius, flat ? half : p.z() * half / std::sqrt(1 + half * half));
  }
  const double least = 0.05 * extent;
  if (radius > 1e29 || radius < least) radius = std::max(2 * extent, 1.0);
  return cubeAround(middle - Vec3d::Constant(radius), middle + Vec3d::Constant(radius), kMargin);
}

}  // namespace

ScenePrior scenePrior(const ViewSource& views, std::span<const size_t> training,
                      const ScenePriorOptions& options, Progress* progress) {
  ScenePrior prior;
  addPoints(views.points(), prior);
  addDepth(views, training, options, prior, progress);
  if (prior.weights.empty()) addWherePicturesAgree(views, training, options, prior, progress);
  dropUnseen(views, training, prior);
  if (!prior.weights.empty()) {
    prior.root = cubeOfPoints(prior.positions);
    if (options.shell == ShellChoice::kOff) return prior;
    const Beyond beyond = seenBeyond(views, training, prior.root);
    if (beyond == Beyond::kNothing && options.shell == ShellChoice::kAuto) return prior;
    addShell(views, training, options.seed, beyond == Beyond::kWalls ? kNearReach : kFarReach,
             prior);
    return prior;
  }
  prior.root = cubeOfCameras(views, training);
  VisualHullOptions hull_options;
  hull_options.seed = options.seed;
  VisualHull hull = visualHull(views, training, prior.root, hull_options, progress);
  if (!hull.weights.empty()) {
    prior.positions = std::move(hull.positions);
    prior.weights = std::move(hull.weights);
    prior.root = cubeOfPoints(prior.positions);
    prior.known_level = hull_options.level;
  }
  if (options.shell == ShellChoice::kOn) {
    addShell(views, training, options.seed, kFarReach, prior);
  }
  return prior;
}

}  // namespace stipple
