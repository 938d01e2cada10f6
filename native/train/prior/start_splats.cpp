#include "train/prior/start_splats.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "decode/tree/merge_neighbours.h"
#include "math/colour.h"
#include "train/prior/point_lives.h"
#include "train/prior/shared_volume.h"
#include "train/prior/start_points.h"
#include "train/prior/swept_points.h"

// Based on: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting, SIGGRAPH 2023 (sizes
// from three neighbours, opacity 0.1). Differs: depth, the pictures and the cameras' volume serve
// where there are no points, and beside them where there are few; splats are smaller.

namespace stipple {

namespace {

constexpr float kStartOpacity = 0.1f;
constexpr size_t kNeighbours = 3;
/// A splat's size over the distance to its neighbours. As large as the distance, faint splats lie
/// over each other so often that a pixel shows hundreds of them, which takes most of a short fit.
constexpr double kSizeOfDistance = 0.7;
constexpr double kLeastSquaredSize = 1e-7;  ///< m^2
/// Of the distance to the nearest camera: the size of a point without any neighbour.
constexpr double kLonelyShare = 0.01;
constexpr size_t kDepthPictures = 64;
constexpr size_t kMostCameras = 64;
/// Of the longer side of a picture: a block that shows no known point is open.
constexpr double kBlocksPerSide = 16;
/// One of so many pixels must find a surface.
constexpr uint64_t kLeastSwept = 4;
constexpr float kOpaque = 0.5f;
constexpr size_t kGrain = 1024;

/// A number that is limited where there is a limit.
uint64_t capped(uint64_t count, uint64_t limit) {
  return limit == 0 ? count : std::min(count, limit);
}

/// `count` of the points, in their order, each with a chance in proportion to its weight; all of
/// weight 0 only where others do not suffice. Source: Efraimidis, Spirakis, Weighted Random
/// Sampling with a Reservoir, Information Processing Letters 2006.
std::vector<size_t> choosePoints(const PointSet& points, size_t count, uint64_t seed) {
  std::vector<size_t> chosen(points.size());
  std::iota(chosen.begin(), chosen.end(), size_t{0});
  if (count >= chosen.size()) return chosen;
  std::vector<double> keys(points.size());
  for (size_t i = 0; i < keys.size(); ++i) {
    const double wait = -std::log1p(-unitDouble(keyedBits(seed, RandomUse::kStartChoice, i)));
    const double weight = points.weights.empty() ? 1.0 : static_cast<double>(points.weights[i]);
    // 1e-30: any key of a positive weight is below any other.
    keys[i] = wait / std::max(weight, 1e-30);
  }
  const auto middle = chosen.begin() + static_cast<std::ptrdiff_t>(count);
  std::nth_element(chosen.begin(), middle, chosen.end(), [&](size_t a, size_t b) {
    return keys[a] != keys[b] ? keys[a] < keys[b] : a < b;
  });
  chosen.resize(count);
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

/// In: count: as many of the points at most.
StartPoints fromPoints(const ViewSource& views, uint64_t count, const StartOptions& options) {
  const PointSet& points = views.points();
  const bool is_display = views.colourSpace() == ColourSpace::kDisplay;
  StartPoints start;
  for (const size_t i : choosePoints(points, count, options.seed)) {
    float colour[3];
    for (size_t c = 0; c < 3; ++c) {
      const float linear = points.colours[i * 3 + c];
      colour[c] = is_display ? linearToSrgb(linear) : linear;
    }
    start.positions.insert(start.positions.end(), &points.positions[i * 3],
                           &points.positions[i * 3] + 3);
    start.colours.insert(start.colours.end(), colour, colour + 3);
    if (!points.times.empty()) start.times.push_back(points.times[i]);
  }
  return start;
}

/// Pixels of the picture where something is, in rows.
std::vector<uint32_t> seenPixels(const ViewPicture& picture) {
  std::vector<uint32_t> pixels;
  for (uint32_t i = 0; i < picture.depth.size(); ++i) {
    if (picture.depth[i] <= 0) continue;
    if (!picture.alpha.empty() && picture.alpha[i] < kOpaque) continue;
    if (!picture.weights.empty() && picture.weights[i] <= 0) continue;
    pixels.push_back(i);
  }
  return pixels;
}

/// One pixel of each of as many runs as are wanted.
StartPoints fromDepth(const ViewSource& views, std::span<const size_t> training, uint64_t wanted,
                      const StartOptions& options, Progress* progress) {
  const size_t picture_count = std::min(training.size(), kDepthPictures);
  StartPoints start;
  for (size_t p = 0; p < picture_count; ++p) {
    advance(progress, static_cast<double>(p) / static_cast<double>(picture_count),
            "Looking for surfaces");
    const size_t view = training[p * training.size() / picture_count];
    const ViewPicture picture = views.load(view);
    const std::vector<uint32_t> pixels = seenPixels(picture);
    const size_t quota = (p + 1) * wanted / picture_count - p * wanted / picture_count;
    const size_t count = std::min(pixels.size(), quota);
    for (size_t k = 0; k < count; ++k) {
      const uint64_t key = view * uint64_t{1} << 32 | k;
      const double inside = unitDouble(keyedBits(options.seed, RandomUse::kStartChoice, key));
      const double place = (static_cast<double>(k) + inside) * static_cast<double>(pixels.size()) /
                           static_cast<double>(count);
      const uint32_t pixel = pixels[std::min(static_cast<size_t>(place), pixels.size() - 1)];
      const float alpha = picture.alpha.empty() ? 1.0f : picture.alpha[pixel];
      float colour[3];
      for (size_t c = 0; c < 3; ++c) colour[c] = picture.colour[pixel * 3 + c] / alpha;
      start.add(unproject(views.camera(view), pixel % picture.width + 0.5,
                          pixel / picture.width + 0.5, static_cast<double>(picture.depth[pixel])),
                colour);
      start.times.push_back(views.time(view));
    }
  }
  return start;
}

/// Evenly of all training views.
std::vector<Camera> someCameras(const ViewSource& views, std::span<const size_t> training) {
  std::vector<Camera> cameras;
  const size_t count = std::min(training.size(), kMostCameras);
  for (size_t i = 0; i < count; ++i) {
    cameras.push_back(views.camera(training[i * training.size() / count]));
  }
  return cameras;
}

StartPoints fromVolume(const ViewSource& views, std::span<const size_t> training, uint64_t wanted,
                       const StartOptions& options) {
  const std::vector<Camera> cameras = someCameras(views, training);
  const SharedVolume ball = sharedVolume(cameras);
  constexpr float kGrey[3] = {0.5f, 0.5f, 0.5f};
  /// A ball fills 0.52 of its cube; most of it is seen.
  constexpr uint64_t kTriesPerPoint = 16;
  StartPoints start;
  for (uint64_t i = 0; i < wanted * kTriesPerPoint && start.size() < wanted; ++i) {
    Vec3d place;
    for (int k = 0; k < 3; ++k) {
      const uint64_t key = i * 3 + static_cast<uint64_t>(k);
      place[k] = 2 * unitDouble(keyedBits(options.seed, RandomUse::kStartPoint, key)) - 1;
    }
    if (place.squaredNorm() > 1) continue;
    const Vec3d point = ball.centre + ball.radius * place;
    size_t seen = 0;
    double x = 0, y = 0;
    for (const Camera& camera : cameras) seen += project(camera, point, x, y);
    // Few of so many tries are inside: then any place in the ball will do.
    if (seen >= ball.least_views || i >= wanted * kTriesPerPoint / 2) start.add(point, kGrey);
  }
  return start;
}

bool haveDepth(const ViewSource& views, std::span<const size_t> training) {
  return !views.load(training[0]).depth.empty();
}

/// Share of the pictures that shows no known point, by blocks.
double openShare(const ViewSource& views, std::span<const size_t> training) {
  const std::vector<float>& places = views.points().positions;
  const std::vector<Camera> cameras = someCameras(views, training);
  std::vector<double> open(cameras.size());
  parallelFor(cameras.size(), 1, [&](size_t begin, size_t end) {
    for (size_t c = begin; c < end; ++c) {
      const Camera& camera = cameras[c];
      const double side = std::max(camera.width, camera.height) / kBlocksPerSide;
      const size_t columns = static_cast<size_t>(std::ceil(camera.width / side));
      const size_t rows = static_cast<size_t>(std::ceil(camera.height / side));
      std::vector<uint8_t> shows(columns * rows, 0);
      for (size_t i = 0; i < places.size(); i += 3) {
        double x = 0, y = 0;
        const Vec3d point = Eigen::Map<const Vec3f>(&places[i]).cast<double>();
        if (!project(camera, point, x, y)) continue;
        const size_t column = std::min(static_cast<size_t>(x / side), columns - 1);
        const size_t row = std::min(static_cast<size_t>(y / side), rows - 1);
        shows[row * columns + column] = 1;
      }
      const double count = static_cast<double>(shows.size());
      open[c] = static_cast<double>(std::count(shows.begin(), shows.end(), 0)) / count;
    }
  });
  return std::accumulate(open.begin(), open.end(), 0.0) / static_cast<double>(open.size());
}

/// How many splats a start with points has of them, and how many beside them.
struct PointShares {
  uint64_t points;
  uint64_t others;
};

/// Reconstructions find places where pictures are rich in detail, and walls and skies stay open,
/// however many points there are. Where nothing is open, more than points makes fits no better.
PointShares sharesOf(const ViewSource& views, std::span<const size_t> training, bool has_depth,
                     const StartOptions& options) {
  const uint64_t known = views.points().size();
  if (options.count > 0) {
    const uint64_t all = capped(options.count, options.max_count);
    const uint64_t points = std::min(known, all);
    return {points, all - points};
  }
  // Samples of meshes come with depth, and tell of everything that is there. Where things move,
  // pictures of different times tell of no depth.
  if (options.with_lives || has_depth) return {capped(known, options.max_count), 0};
  const uint64_t places = placesOfPictures(views, training);
  const double share = std::min(2 * openShare(views, training), 0.5);
  const uint64_t least = static_cast<uint64_t>(share * static_cast<double>(places));
  const uint64_t others = std::max(places - std::min(places, known), least);
  if (options.max_count == 0 || known + others <= options.max_count) return {known, others};
  // Where there is no room for both, others get what they get at least, but half of it at most.
  const uint64_t points =
      std::min(known, options.max_count - std::min(least, options.max_count / 2));
  return {points, options.max_count - points};
}

StartPoints withPoints(const ViewSource& views, std::span<const size_t> training,
                       const StartOptions& options, Progress* progress) {
  const bool has_depth = haveDepth(views, training);
  const PointShares shares = sharesOf(views, training, has_depth, options);
  StartPoints points = fromPoints(views, shares.points, options);
  if (shares.others == 0) return points;
  points.append(has_depth ? fromDepth(views, training, shares.others, options, progress)
                          : sweptPoints(views, training, {shares.others, options.seed}, progress));
  return points;
}

StartPoints withoutPoints(const ViewSource& views, std::span<const size_t> training,
                          const StartOptions& options, Progress* progress) {
  const auto wanted = [&](uint64_t otherwise) {
    return capped(options.count > 0 ? options.count : otherwise, options.max_count);
  };
  StartPoints points = fromDepth(views, training, wanted(kStartSplatsOfDepth), options, progress);
  if (points.size() > 0) return points;
  const uint64_t count = wanted(placesOfPictures(views, training));
  points = sweptPoints(views, training, {count, options.seed}, progress);
  // Silhouettes that contradict each other leave nothing standing.
  if (points.size() >= count / kLeastSwept) return points;
  return fromVolume(views, training, count, options);
}

/// Metres, from the nearest neighbours.
std::vector<float> sizesOf(const StartPoints& points, const std::vector<Camera>& cameras) {
  const std::vector<double> places(points.positions.begin(), points.positions.end());
  const std::vector<uint32_t> rows = nearestNeighbours(places, kNeighbours);
  std::vector<float> sizes(points.size());
  parallelFor(sizes.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Eigen::Map<const Vec3d> place(&places[i * 3]);
      double sum = 0;
      size_t count = 0;
      for (size_t k = 0; k < kNeighbours; ++k) {
        const uint32_t other = rows[i * kNeighbours + k];
        if (other == kNoPlace) break;
        sum += (Eigen::Map<const Vec3d>(&places[size_t{other} * 3]) - place).squaredNorm();
        ++count;
      }
      if (count == 0) {
        double nearest = 1e30;
        for (const Camera& camera : cameras) {
          nearest = std::min(nearest, (placeOf(camera) - place).norm());
        }
        sum = std::pow(kLonelyShare / kSizeOfDistance * nearest, 2);
        count = 1;
      }
      const double squared = std::max(sum / static_cast<double>(count), kLeastSquaredSize);
      const double size = kSizeOfDistance * std::sqrt(squared);
      sizes[i] = static_cast<float>(std::min(size, 1e18));
    }
  });
  return sizes;
}

SplatCloud splatsAt(const StartPoints& points, const ViewSource& views,
                    std::span<const size_t> training, const StartOptions& options) {
  std::vector<Camera> cameras;
  for (const size_t view : training) cameras.push_back(views.camera(view));
  const std::vector<float> sizes = sizesOf(points, cameras);
  SplatCloud cloud;
  cloud.sh_degree = options.sh_degree;
  cloud.colour_space = views.colourSpace();
  cloud.antialias = options.antialias;
  cloud.resize(points.size());
  std::copy(points.positions.begin(), points.positions.end(), cloud.positions.begin());
  std::fill(cloud.opacities.begin(), cloud.opacities.end(), kStartOpacity);
  std::fill(cloud.sh.begin(), cloud.sh.end(), 0.0f);
  for (size_t i = 0; i < cloud.size(); ++i) {
    cloud.rotations[i * 4] = 1;
    std::fill_n(&cloud.scales[i * 3], 3, sizes[i]);
    for (size_t c = 0; c < 3; ++c) {
      cloud.sh[i * cloud.shStride() + c] = (points.colours[i * 3 + c] - 0.5f) / kShC0;
    }
  }
  return cloud;
}

}  // namespace

StartSplats startSplats(const ViewSource& views, std::span<const size_t> training,
                        const StartOptions& options, Progress* progress) {
  StartPoints points = views.points().size() > 0
                           ? withPoints(views, training, options, progress)
                           : withoutPoints(views, training, options, progress);
  StartSplats start;
  start.splats = splatsAt(points, views, training, options);
  if (options.with_lives) start.lives = pointLives(views, training, points, progress);
  start.times = std::move(points.times);
  return start;
}

}  // namespace stipple
