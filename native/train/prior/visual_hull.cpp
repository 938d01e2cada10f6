// Based on: Laurentini, The Visual Hull Concept for Silhouette-Based Image Understanding, IEEE PAMI
// 1994; Potmesil, Generating Octree Models of 3D Objects from their Silhouettes, CVGIP 1987.
// Differs: two grids in place of an octree; a cell survives a few silhouettes that miss it.
#include "train/prior/visual_hull.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "math/camera.h"
#include "math/vec.h"
#include "train/prior/silhouette.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 12;
/// Of the first grid.
constexpr int kCoarseLevel = 5;
/// A cell is in the ball around its corners; of a fine one half its width suffices, as what it
/// misses its neighbours have.
constexpr double kCoarseReach = 0.87;
constexpr double kFineReach = 0.5;
/// A pixel shows something above this alpha.
constexpr float kShownAlpha = 0.25f;
/// Silhouettes are kept no finer than this many pixels a side.
constexpr uint32_t kMostPixels = 384;
/// Share of the views that may miss a cell: mattes have holes.
constexpr double kForgiven = 0.02;
/// Silhouettes that leave more than this share of what they show say nothing.
constexpr double kTelling = 0.7;
/// Share of the points' weight that is inside.
constexpr double kInside = 0.1;
constexpr double kMargin = 0.05;

/// What a view shows.
struct Outline {
  Camera camera;
  double block = 1;  ///< pixels of the silhouette's blocks a side
  Silhouette silhouette;
};

Outline outlineOf(const Camera& camera, const ViewPicture& picture) {
  const uint32_t block = (std::max(picture.width, picture.height) + kMostPixels - 1) / kMostPixels;
  return {camera, static_cast<double>(block),
          Silhouette(picture.width, picture.height, picture.alpha, picture.weights, block,
                     kShownAlpha)};
}

enum class Verdict { kUnseen, kShown, kMissed };

/// What a view says of a place and its surroundings.
Verdict judge(const Outline& view, const Vec3d& centre, double radius) {
  const Camera& camera = view.camera;
  const Vec3d p = (camera.world_to_camera * centre.homogeneous()).head<3>();
  const bool perspective = camera.model == CameraModel::kPerspective;
  if (p.z() - radius <= camera.near_plane || p.z() > camera.far_plane) return Verdict::kUnseen;
  const double depth = perspective ? p.z() : 1.0;
  const double x = (camera.fx * p.x() / depth + camera.cx) / view.block;
  const double y = (camera.fy * p.y() / depth + camera.cy) / view.block;
  const double reach = radius / depth * std::max(camera.fx, camera.fy) / view.block;
  const double width = view.silhouette.width(), height = view.silhouette.height();
  // What the frame cuts may show outside it.
  if (x - reach < 0 || y - reach < 0 || x + reach >= width || y + reach >= height) {
    return Verdict::kUnseen;
  }
  const bool shows = view.silhouette.shows(
      static_cast<uint32_t>(x - reach), static_cast<uint32_t>(y - reach),
      static_cast<uint32_t>(x + reach) + 1, static_cast<uint32_t>(y + reach) + 1);
  return shows ? Verdict::kShown : Verdict::kMissed;
}

/// The cells of a cube that are left.
struct Grid {
  RootCube cube;
  size_t side = 0;
  std::vector<uint8_t> kept;  ///< [side^3], x fastest
  size_t seen_count = 0;      ///< cells that enough views see
  size_t kept_count = 0;

  double cell() const { return cube.side / static_cast<double>(side); }
  std::array<size_t, 3> place(size_t i) const {
    return {i % side, i / side % side, i / side / side};
  }
  Vec3d corner(size_t i) const {
    const std::array<size_t, 3> at = place(i);
    Vec3d out;
    for (size_t a = 0; a < 3; ++a) {
      out[static_cast<int>(a)] = cube.origin[a] + static_cast<double>(at[a]) * cell();
    }
    return out;
  }
  bool isInside(size_t i) const {
    const std::array<size_t, 3> at = place(i);
    const std::array<size_t, 3> steps = {1, side, side * side};
    for (size_t a = 0; a < 3; ++a) {
      if (at[a] == 0 || at[a] + 1 == side) return false;
      if (kept[i - steps[a]] == 0 || kept[i + steps[a]] == 0) return false;
    }
    return true;
  }
};

/// In: reach: half a side of what is looked at around the middle of a cell, in cells.
Grid carve(const std::vector<Outline>& views, const RootCube& cube, int level, double reach) {
  Grid grid;
  grid.cube = cube;
  grid.side = size_t{1} << level;
  grid.kept.assign(grid.side * grid.side * grid.side, 0);
  const Vec3d to_middle = Vec3d::Constant(0.5 * grid.cell());
  const double radius = reach * grid.cell();
  const size_t needed = std::min<size_t>(2, views.size());
  const size_t ranges = rangeCount(grid.kept.size(), kGrain);
  std::vector<size_t> seen(ranges, 0), kept(ranges, 0);
  parallelFor(grid.kept.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3d centre = grid.corner(i) + to_middle;
      size_t shown = 0, missed = 0;
      for (const Outline& view : views) {
        const Verdict verdict = judge(view, centre, radius);
        shown += verdict == Verdict::kShown ? 1 : 0;
        missed += verdict == Verdict::kMissed ? 1 : 0;
        if (static_cast<double>(missed) > kForgiven * static_cast<double>(views.size())) break;
      }
      if (shown + missed < needed) continue;
      ++seen[begin / kGrain];
      if (static_cast<double>(missed) > kForgiven * static_cast<double>(shown + missed)) continue;
      grid.kept[i] = 1;
      ++kept[begin / kGrain];
    }
  });
  for (size_t r = 0; r < ranges; ++r) {
    grid.seen_count += seen[r];
    grid.kept_count += kept[r];
  }
  return grid;
}

RootCube cubeOfKept(const Grid& grid) {
  Vec3d low = Vec3d::Constant(1e30), high = Vec3d::Constant(-1e30);
  for (size_t i = 0; i < grid.kept.size(); ++i) {
    if (grid.kept[i] == 0) continue;
    const Vec3d corner = grid.corner(i);
    low = low.cwiseMin(corner);
    high = high.cwiseMax(corner + Vec3d::Constant(grid.cell()));
  }
  const double side = (high - low).maxCoeff() * (1 + kMargin);
  const Vec3d origin = 0.5 * (low + high) - Vec3d::Constant(0.5 * side);
  return {{origin[0], origin[1], origin[2]}, side};
}

void addPoints(const Grid& grid, const VisualHullOptions& options, VisualHull& hull) {
  size_t inside_count = 0;
  for (size_t i = 0; i < grid.kept.size(); ++i) {
    if (grid.kept[i] != 0) inside_count += grid.isInside(i) ? 1 : 0;
  }
  const size_t surface_count = grid.kept_count - inside_count;
  const size_t per_cell = std::max<size_t>(1, options.point_count / surface_count);
  // One point for a cell inside.
  const double surface_weight = static_cast<double>(surface_count * per_cell);
  const double inside_weight = inside_count == 0 ? 0
                                                 : kInside / (1 - kInside) * surface_weight /
                                                       static_cast<double>(inside_count);
  uint64_t number = 0;
  for (size_t i = 0; i < grid.kept.size(); ++i) {
    if (grid.kept[i] == 0) continue;
    const bool inside = grid.isInside(i);
    const Vec3d corner = grid.corner(i);
    for (size_t p = 0; p < (inside ? 1 : per_cell); ++p) {
      for (int axis = 0; axis < 3; ++axis) {
        const double u = unitDouble(keyedBits(options.seed, RandomUse::kPriorSample, number++));
        hull.positions.push_back(static_cast<float>(corner[axis] + u * grid.cell()));
      }
      hull.weights.push_back(inside ? static_cast<float>(inside_weight) : 1.0f);
    }
  }
  double sum = 0;
  for (const float weight : hull.weights) sum += static_cast<double>(weight);
  const float to_mean = static_cast<float>(static_cast<double>(hull.weights.size()) / sum);
  for (float& weight : hull.weights) weight *= to_mean;
}

}  // namespace

VisualHull visualHull(const ViewSource& views, std::span<const size_t> training,
                      const RootCube& where, const VisualHullOptions& options, Progress* progress) {
  if (options.level < 3 || options.level > 8) {
    fail(ErrorCode::kInvalidArgument, "the level of the visual hull is " +
                                          std::to_string(options.level) + "; 3 to 8 is allowed");
  }
  VisualHull hull;
  std::vector<Outline> outlines;
  const size_t view_count = std::min(training.size(), options.view_count);
  for (size_t v = 0; v < view_count; ++v) {
    advance(progress, static_cast<double>(v) / static_cast<double>(view_count),
            "Looking for silhouettes");
    const size_t view = training[v * training.size() / view_count];
    const ViewPicture picture = views.load(view);
    if (picture.alpha.empty()) return hull;  // the others have none either
    outlines.push_back(outlineOf(views.camera(view), picture));
  }
  const Grid coarse = carve(outlines, where, kCoarseLevel, kCoarseReach);
  const double left = static_cast<double>(coarse.kept_count);
  if (coarse.kept_count == 0 || left > kTelling * static_cast<double>(coarse.seen_count))
    return hull;
  const Grid fine = carve(outlines, cubeOfKept(coarse), options.level, kFineReach);
  if (fine.kept_count > 0) addPoints(fine, options, hull);
  return hull;
}

}  // namespace stipple
