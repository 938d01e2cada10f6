#include "splat/edit/hole_filling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "data/clouds/cloud_selection.h"
#include "math/principal_axes.h"
#include "math/quaternion.h"
#include "math/spherical_harmonics.h"
#include "mesh/floaters.h"
#include "mesh/point_components.h"
#include "mesh/point_growth.h"
#include "splat/edit/colour_levelling.h"
#include "splat/edit/ground_plane.h"
#include "splat/edit/hole_raster.h"
#include "splat/edit/local_surface.h"
#include "splat/edit/patch_quilt.h"

namespace stipple {

namespace {

using Cell = HoleRaster::Cell;
using Mat2d = Eigen::Matrix2d;

constexpr size_t kGrain = 4096;
constexpr size_t kLeastRing = 16;
constexpr size_t kNeighbour = 8;
constexpr size_t kQueries = 2000;
/// Splats that a cell has on average: few, so that the edge of a hole is followed closely.
constexpr double kSplatsPerCell = 2.0;
constexpr double kMostCells = 768;  ///< along an axis
/// A ring is at least so many rows of splats wide.
constexpr double kLeastRows = 12;
/// Patches reach so many cells from their middles, more in a large hole: what a patch shows is
/// whole.
constexpr double kPatchShare = 0.125;
constexpr size_t kLeastReach = 4;
constexpr size_t kMostReach = 12;
/// Deviations of a splat that colour cells, and cells that one may colour along an axis.
constexpr double kLookSigmas = 2;
constexpr std::ptrdiff_t kLookCells = 12;
/// Share of the ring's extent from its plane within which splats are looked at as ground.
constexpr double kPlaneShare = 0.02;
constexpr double kReachShare = 0.08;
/// Splats whose deviation across is below this share of that along lie on a line.
constexpr double kLeastBreadth = 1e-3;
/// What stands on the ground is not copied with it: there are splats up to so many bands from it.
constexpr double kThingBands = 4;
/// Splats wider than this share of a hole are background, which shows through as it is.
constexpr double kWidestShare = 0.4;
/// A splat so much longer than it is wide draws a line, so far to both sides of its middle.
constexpr double kNeedle = 4;
constexpr double kNeedleSigmas = 1.5;

void requirePositive(const std::optional<double>& value, const char* what) {
  if (value && !(*value > 0 && *value <= 1e30)) {
    fail(ErrorCode::kInvalidArgument,
         std::string(what) + " is " + numberText(*value) + "; above 0 is allowed");
  }
}

Vec3d positionOf(const SplatCloud& cloud, size_t i) {
  const float* p = &cloud.positions[i * 3];
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}

float widthOf(const SplatCloud& cloud, size_t i) {
  const float* s = &cloud.scales[i * 3];
  return std::max(s[0], std::max(s[1], s[2]));
}

std::vector<float> positionsOf(const SplatCloud& cloud, const std::vector<uint32_t>& splats) {
  std::vector<float> positions(splats.size() * 3);
  for (size_t k = 0; k < splats.size(); ++k) {
    std::copy_n(&cloud.positions[size_t{splats[k]} * 3], 3, &positions[k * 3]);
  }
  return positions;
}

/// Centre and spread of a group.
struct Extent {
  Vec3d centre = Vec3d::Zero();
  double farthest = 0;                    ///< metres from the centre
  std::array<double, 3> deviations = {};  ///< along its axes, longest first
};

Extent extentOf(const SplatCloud& cloud, const std::vector<uint32_t>& splats) {
  Extent extent;
  for (const uint32_t i : splats) extent.centre += positionOf(cloud, i);
  extent.centre /= static_cast<double>(splats.size());
  Mat3d spread = Mat3d::Zero();
  for (const uint32_t i : splats) {
    const Vec3d d = positionOf(cloud, i) - extent.centre;
    extent.farthest = std::max(extent.farthest, d.norm());
    spread += d * d.transpose();
  }
  const Vec3d lengths = principalAxes(spread).lengths / static_cast<double>(splats.size());
  for (size_t k = 0; k < 3; ++k) {
    extent.deviations[k] = std::sqrt(lengths[static_cast<Eigen::Index>(k)]);
  }
  std::sort(extent.deviations.rbegin(), extent.deviations.rend());
  return extent;
}

/// What is copied where: splats of the ground and the cells that they come from and go to.
struct Plan {
  HoleRaster raster;
  std::vector<uint32_t> begins;   ///< of each cell in splats
  std::vector<uint32_t> splats;   ///< of the ground, cell by cell, in their order
  std::vector<CellLook> looks;    ///< of each cell, by the ground that is left
  std::vector<uint32_t> sources;  ///< of each cell; UINT32_MAX: nothing is missing
  std::vector<Vec3d> added;       ///< to the colours that are copied into each cell, as stored
};

std::vector<float> coverOf(const std::vector<CellLook>& looks) {
  std::vector<float> cover(looks.size());
  for (size_t i = 0; i < looks.size(); ++i) cover[i] = static_cast<float>(looks[i][3]);
  return cover;
}

/// One hole. What is left of the cloud is `rest`, as indices.
class Hole {
 public:
  Hole(const SplatCloud& cloud, std::vector<uint32_t> removed, const FillOptions& options)
      : cloud_(cloud), removed_(std::move(removed)), options_(options) {
    extent_ = extentOf(cloud, removed_);
  }

  /// Appends to `result`; says in the report how it went.
  void fill(const std::vector<uint32_t>& rest, SplatCloud& result, FillReport& report) {
    gatherRing(rest);
    if (ring_.size() < kLeastRing) {
      ++report.no_ring_count;
      return;
    }
    Plane plane;
    if (!layPlane(plane)) {
      ++report.no_plane_count;
      return;
    }
    std::vector<Vec3d> points;
    for (const uint32_t i : ring_) points.push_back(positionOf(cloud_, i));
    const LocalSurface surface(plane, extent_.centre, points, kReachShare * ringExtent());
    Plan plan;
    if (!layRaster(surface, plan)) {
      ++report.no_ring_count;
      return;
    }
    if (plan.raster.count(Cell::kHole) == 0) {
      ++report.covered_count;
      return;
    }
    quilt(plan);
    copySplats(surface, plan, result);
    ++report.filled_count;
  }

 private:
  double ringExtent() const { return 2 * (extent_.farthest + ring_width_); }

  /// Splats that are left within `width` of the middle's furthest, as indices.
  std::vector<uint32_t> around(const std::vector<uint32_t>& rest, double width) const {
    // The corners of the raster are further away than its sides.
    const double limit = std::numbers::sqrt2 * (extent_.farthest + width);
    std::vector<std::vector<uint32_t>> parts(rangeCount(rest.size(), kGrain));
    parallelFor(rest.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t k = begin; k < end; ++k) {
        const double squared = (positionOf(cloud_, rest[k]) - extent_.centre).squaredNorm();
        if (squared <= limit * limit) parts[begin / kGrain].push_back(rest[k]);
      }
    });
    std::vector<uint32_t> found;
    for (const auto& part : parts) found.insert(found.end(), part.begin(), part.end());
    return found;
  }

  /// Distance that splats of the hole have from each other.
  double rowOfRemoved() const {
    const std::vector<float> positions = positionsOf(cloud_, removed_);
    const std::vector<uint8_t> all(removed_.size(), 1);
    return neighbourSpacing(positions, all) / std::sqrt(kNeighbour / std::numbers::pi);
  }

  void gatherRing(const std::vector<uint32_t>& rest) {
    ring_width_ = options_.ring_width
                      ? *options_.ring_width
                      : std::max(2 * extent_.deviations[1], kLeastRows * rowOfRemoved());
    near_ = around(rest, ring_width_);
    std::vector<uint32_t> together = removed_;
    together.insert(together.end(), near_.begin(), near_.end());
    std::vector<uint8_t> mask(together.size(), 0);
    std::fill_n(mask.begin(), removed_.size(), uint8_t{1});
    const std::vector<uint8_t> reached = grown(positionsOf(cloud_, together), mask, ring_width_);
    for (size_t k = removed_.size(); k < together.size(); ++k) {
      if (reached[k]) ring_.push_back(together[k]);
    }
  }

  /// False where the ring spans none.
  bool layPlane(Plane& plane) const {
    const Extent ring = extentOf(cloud_, ring_);
    if (ring.deviations[1] < kLeastBreadth * ring.deviations[0]) return false;
    std::vector<uint8_t> mask(cloud_.size(), 0);
    for (const uint32_t i : ring_) mask[i] = 1;
    GroundPlaneOptions options;
    options.up = Vec3d::Zero();
    options.seed = options_.seed;
    options.tolerance = std::max(kPlaneShare * ringExtent(), 1e-30);
    // Around the hole's middle: far from the origin a plane's offset would lose digits.
    Mat4d to_middle = Mat4d::Identity();
    to_middle.topRightCorner<3, 1>() = -extent_.centre;
    try {
      plane = groundPlane(kept(cloud_, mask), to_middle, options).plane;
    } catch (const Error& error) {
      // The one thing that can be wrong with valid splats: no three of them make a plane.
      if (error.code() != ErrorCode::kInvalidArgument) throw;
      return false;
    }
    plane.offset += plane.normal.dot(extent_.centre);
    return true;
  }

  /// Side of a cell from how densely the ground is covered. 0: all splats are at one place.
  double cellSide(const std::vector<LocalSurface::Place>& ground) const {
    std::vector<float> flat;
    std::vector<uint32_t> queries;
    for (const LocalSurface::Place& place : ground) {
      flat.insert(flat.end(), {static_cast<float>(place.u), static_cast<float>(place.v), 0.0f});
    }
    const size_t count = std::min(kQueries, ground.size());
    for (size_t k = 0; k < count; ++k) {
      queries.push_back(static_cast<uint32_t>(k * ground.size() / count));
    }
    std::vector<double> distances = neighbourDistances(flat, queries, kNeighbour);
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    // A disc of this radius has 8 splats and the one in its middle.
    return *middle * std::sqrt(std::numbers::pi * kSplatsPerCell / (kNeighbour + 1));
  }

  /// False where too few splats of the ground are left.
  bool layRaster(const LocalSurface& surface, Plan& plan) const {
    std::vector<LocalSurface::Place> left, removed, things;
    std::vector<uint32_t> ground;
    for (const uint32_t i : near_) {
      const LocalSurface::Place place = surface.placeOf(positionOf(cloud_, i));
      if (std::abs(place.h) > surface.band()) {
        if (std::abs(place.h) <= kThingBands * surface.band()) things.push_back(place);
        continue;
      }
      left.push_back(place);
      ground.push_back(i);
    }
    if (ground.size() < kLeastRing) return false;
    Vec2d lowest = Vec2d::Constant(1e300), highest = Vec2d::Constant(-1e300);
    for (const uint32_t i : removed_) {
      const LocalSurface::Place place = surface.placeOf(positionOf(cloud_, i));
      removed.push_back(place);
      lowest = lowest.cwiseMin(Vec2d(place.u, place.v));
      highest = highest.cwiseMax(Vec2d(place.u, place.v));
    }
    lowest.array() -= ring_width_;
    highest.array() += ring_width_;
    HoleRaster& raster = plan.raster;
    const double widest = (highest - lowest).maxCoeff();
    raster.side = std::max(cellSide(left), widest / kMostCells);
    if (!(raster.side > 0)) return false;
    raster.u0 = lowest[0];
    raster.v0 = lowest[1];
    raster.width = static_cast<size_t>((highest[0] - lowest[0]) / raster.side) + 1;
    raster.height = static_cast<size_t>((highest[1] - lowest[1]) / raster.side) + 1;
    HoleCounts counts;
    for (auto* values : {&counts.left, &counts.removed, &counts.above, &counts.things}) {
      values->assign(raster.size(), 0.0f);
    }
    for (const LocalSurface::Place& place : removed) {
      const size_t cell = raster.cellAt(place.u, place.v);
      counts.above[cell] += 1;
      if (std::abs(place.h) <= surface.band()) counts.removed[cell] += 1;
    }
    for (const LocalSurface::Place& place : things) {
      if (raster.has(place.u, place.v)) counts.things[raster.cellAt(place.u, place.v)] += 1;
    }
    sortIntoCells(left, ground, plan);
    plan.looks.assign(raster.size(), CellLook::Zero());
    for (const uint32_t splat : plan.splats) look(surface, raster, splat, plan.looks);
    for (size_t cell = 0; cell < raster.size(); ++cell) {
      counts.left[cell] = static_cast<float>(plan.begins[cell + 1] - plan.begins[cell]);
    }
    std::vector<CellLook> looks(raster.size(), CellLook::Zero());
    for (size_t k = 0; k < removed.size(); ++k) {
      if (std::abs(removed[k].h) <= surface.band()) look(surface, raster, removed_[k], looks);
    }
    counts.removed_cover = coverOf(looks);
    counts.left_cover = coverOf(plan.looks);
    labelCells(raster, counts);
    return raster.count(Cell::kSolid) > 0;
  }

  void sortIntoCells(const std::vector<LocalSurface::Place>& places,
                     const std::vector<uint32_t>& ground, Plan& plan) const {
    const HoleRaster& raster = plan.raster;
    plan.begins.assign(raster.size() + 1, 0);
    const auto forEach = [&](const auto& visit) {
      for (size_t k = 0; k < places.size(); ++k) {
        if (!raster.has(places[k].u, places[k].v)) continue;
        visit(raster.cellAt(places[k].u, places[k].v), ground[k]);
      }
    };
    forEach([&](size_t cell, uint32_t) { ++plan.begins[cell + 1]; });
    for (size_t cell = 0; cell < raster.size(); ++cell) {
      plan.begins[cell + 1] += plan.begins[cell];
    }
    plan.splats.resize(plan.begins.back());
    std::vector<uint32_t> ends(plan.begins.begin(), plan.begins.end() - 1);
    forEach([&](size_t cell, uint32_t splat) { plan.splats[ends[cell]++] = splat; });
  }

  /// Adds a splat of the ground to what the cells that it covers look like.
  void look(const LocalSurface& surface, const HoleRaster& raster, size_t splat,
            std::vector<CellLook>& looks) const {
    const LocalSurface::Place place = surface.placeOf(positionOf(cloud_, splat));
    // Its outline on the plane, and at least a cell wide, so that it is not missed between two.
    Mat2d spread = Mat2d::Identity() * (raster.side * raster.side / 4);
    const Mat3d axes = rotationFromQuaternion<double>(&cloud_.rotations[splat * 4]);
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Vec2d along = surface.along(axes.col(k));
      const double scale = static_cast<double>(cloud_.scales[splat * 3 + static_cast<size_t>(k)]);
      spread += scale * scale * along * along.transpose();
    }
    const double inverse = 1 / (spread(0, 0) * spread(1, 1) - spread(0, 1) * spread(1, 0));
    const float* sh = &cloud_.sh[splat * cloud_.shStride()];
    Vec4d shown(0, 0, 0, 1);
    for (Eigen::Index c = 0; c < 3; ++c) {
      shown[c] = static_cast<double>(kShC0) * static_cast<double>(sh[c]) + 0.5;
    }
    const auto middle = static_cast<std::ptrdiff_t>(raster.cellAt(place.u, place.v));
    const auto width = static_cast<std::ptrdiff_t>(raster.width);
    const auto cellsOf = [&](double variance) {
      return std::min(kLookCells,
                      static_cast<std::ptrdiff_t>(kLookSigmas * std::sqrt(variance) / raster.side));
    };
    const std::ptrdiff_t across = cellsOf(spread(0, 0)), up = cellsOf(spread(1, 1));
    for (std::ptrdiff_t y = -up; y <= up; ++y) {
      for (std::ptrdiff_t x = -across; x <= across; ++x) {
        const std::ptrdiff_t column = middle % width + x, row = middle / width + y;
        if (column < 0 || row < 0 || column >= width ||
            row >= static_cast<std::ptrdiff_t>(raster.height)) {
          continue;
        }
        const double du = raster.u0 + (static_cast<double>(column) + 0.5) * raster.side - place.u;
        const double dv = raster.v0 + (static_cast<double>(row) + 0.5) * raster.side - place.v;
        const double squared = inverse * (spread(1, 1) * du * du - 2 * spread(0, 1) * du * dv +
                                          spread(0, 0) * dv * dv);
        const double alpha = static_cast<double>(cloud_.opacities[splat]) * std::exp(-squared / 2);
        CellLook& cell = looks[static_cast<size_t>(row * width + column)];
        // One over the other in their order; which is on top is of no weight for a comparison.
        cell = alpha * shown + (1 - alpha) * cell;
      }
    }
  }

  void quilt(Plan& plan) const {
    const HoleRaster& raster = plan.raster;
    QuiltOptions options;
    options.seed = options_.seed;
    double cells = kPatchShare * std::sqrt(static_cast<double>(raster.count(Cell::kHole)));
    cells = std::max(cells, static_cast<double>(kLeastReach));
    if (options_.patch_size) cells = *options_.patch_size / raster.side / 2;
    options.reach = static_cast<size_t>(std::min(cells, static_cast<double>(kMostReach)));
    plan.sources = quiltSources(raster, plan.looks, options);
    plan.added = levelledColours(raster, plan.looks, plan.sources, options.reach);
  }

  /// False for a needle one of whose ends lies where something else is copied, or nothing: it would
  /// draw the broken end of a line.
  bool endsFollow(const LocalSurface& surface, const Plan& plan, size_t splat, uint32_t from,
                  uint32_t to) const {
    const float* s = &cloud_.scales[splat * 3];
    const auto longest = static_cast<size_t>(std::max_element(s, s + 3) - s);
    const float second = std::max(s[(longest + 1) % 3], s[(longest + 2) % 3]);
    if (static_cast<double>(s[longest]) < kNeedle * static_cast<double>(second)) return true;
    const Mat3d axes = rotationFromQuaternion<double>(&cloud_.rotations[splat * 4]);
    const Vec2d half = kNeedleSigmas * static_cast<double>(s[longest]) *
                       surface.along(axes.col(static_cast<Eigen::Index>(longest)));
    const LocalSurface::Place place = surface.placeOf(positionOf(cloud_, splat));
    const HoleRaster& raster = plan.raster;
    for (const double side : {-1.0, 1.0}) {
      const double u = place.u + side * half[0], v = place.v + side * half[1];
      if (!raster.has(u, v)) return false;
      // Cells of one patch are as far from each other as those that they are copied from.
      const size_t end = raster.cellAt(u, v) + to - from;
      if (end >= raster.size() || plan.sources[end] != raster.cellAt(u, v)) return false;
    }
    return true;
  }

  /// Appends the splats of every source cell where its copy goes.
  void copySplats(const LocalSurface& surface, const Plan& plan, SplatCloud& result) const {
    const HoleRaster& raster = plan.raster;
    const double area = static_cast<double>(raster.count(Cell::kHole)) * raster.side * raster.side;
    const auto widest = static_cast<float>(std::max(kWidestShare * std::sqrt(area), raster.side));
    struct Copy {
      uint32_t splat;
      uint32_t from, to;  ///< cells
    };
    std::vector<Copy> copies;
    for (uint32_t cell = 0; cell < raster.size(); ++cell) {
      const uint32_t source = plan.sources[cell];
      if (source == UINT32_MAX) continue;
      for (uint32_t k = plan.begins[source]; k < plan.begins[source + 1]; ++k) {
        const uint32_t splat = plan.splats[k];
        if (widthOf(cloud_, splat) <= widest && endsFollow(surface, plan, splat, source, cell)) {
          copies.push_back({splat, source, cell});
        }
      }
    }
    const size_t before = result.size();
    result.resize(before + copies.size());
    parallelFor(copies.size(), 256, [&](size_t begin, size_t end) {
      for (size_t k = begin; k < end; ++k) {
        const Copy& copy = copies[k];
        const auto along = [&](uint32_t cell, size_t row_length) {
          return Vec2d(static_cast<double>(cell % row_length),
                       static_cast<double>(cell / row_length));
        };
        const Vec2d move =
            raster.side * (along(copy.to, raster.width) - along(copy.from, raster.width));
        copySplat(surface, copy.splat, move, result, before + k);
        addColour(plan.added[copy.to], result, before + k);
      }
    });
  }

  /// Light is added to what a splat reflects to all sides. Nothing becomes darker than black or
  /// brighter than white by it.
  static void addColour(const Vec3d& added, SplatCloud& result, size_t splat) {
    constexpr double kBlack = -0.5, kWhite = 0.5;
    constexpr double kC0 = static_cast<double>(kShC0);
    float* sh = &result.sh[splat * result.shStride()];
    for (size_t c = 0; c < 3; ++c) {
      const double before = kC0 * static_cast<double>(sh[c]);
      const double after = std::clamp(before + added[static_cast<Eigen::Index>(c)],
                                      std::min(before, kBlack), std::max(before, kWhite));
      sh[c] = static_cast<float>(after / kC0);
    }
  }

  void copySplat(const LocalSurface& surface, size_t from, const Vec2d& move, SplatCloud& result,
                 size_t to) const {
    LocalSurface::Place place = surface.placeOf(positionOf(cloud_, from));
    const Mat3d turn = surface.turn(place.u, place.v, place.u + move[0], place.v + move[1]);
    place.u += move[0];
    place.v += move[1];
    const Vec3d position = surface.pointAt(place);
    for (size_t c = 0; c < 3; ++c) {
      result.positions[to * 3 + c] = static_cast<float>(position[static_cast<Eigen::Index>(c)]);
    }
    const size_t stride = cloud_.shStride();
    std::copy_n(&cloud_.rotations[from * 4], 4, &result.rotations[to * 4]);
    std::copy_n(&cloud_.scales[from * 3], 3, &result.scales[to * 3]);
    result.opacities[to] = cloud_.opacities[from];
    std::copy_n(&cloud_.sh[from * stride], stride, &result.sh[to * stride]);
    if (turn == Mat3d::Identity()) return;
    const Mat3d axes = turn * rotationFromQuaternion<double>(&cloud_.rotations[from * 4]);
    const Vec4d rotation = quaternionFromRotation(axes);
    for (size_t c = 0; c < 4; ++c) {
      result.rotations[to * 4 + c] = static_cast<float>(rotation[static_cast<Eigen::Index>(c)]);
    }
    rotateHarmonics(turn, cloud_.sh_degree, &result.sh[to * stride]);
  }

  const SplatCloud& cloud_;
  std::vector<uint32_t> removed_;
  const FillOptions& options_;
  Extent extent_;
  double ring_width_ = 0;
  std::vector<uint32_t> near_;  ///< splats that are left around the hole
  std::vector<uint32_t> ring_;  ///< of those, within the ring's width of a removed one
};

/// Groups of removed splats, by the smallest index of each.
std::vector<std::vector<uint32_t>> groupsOf(const SplatCloud& cloud,
                                            const std::vector<uint32_t>& removed,
                                            const FillOptions& options, FillReport& report,
                                            Progress* progress) {
  const std::vector<float> points = positionsOf(cloud, removed);
  report.radius = options.radius ? *options.radius : connectingRadius(points);
  if (!(report.radius > 0)) return {removed};
  const std::vector<uint32_t> roots = pointComponents(points, report.radius, progress);
  std::map<uint32_t, std::vector<uint32_t>> groups;
  for (size_t k = 0; k < roots.size(); ++k) groups[roots[k]].push_back(removed[k]);
  std::vector<std::vector<uint32_t>> list;
  for (auto& [root, group] : groups) list.push_back(std::move(group));
  return list;
}

}  // namespace

SplatCloud holesFilled(const SplatCloud& cloud, std::span<const uint8_t> removed,
                       const FillOptions& options, FillReport& report, Progress* progress) {
  validate(cloud, "cloud");
  requirePositive(options.radius, "radius");
  requirePositive(options.ring_width, "ring_width");
  requirePositive(options.patch_size, "patch_size");
  if (removed.size() != cloud.size()) {
    fail(ErrorCode::kInvalidArgument, "mask holds " + std::to_string(removed.size()) +
                                          " values; the cloud has " + std::to_string(cloud.size()) +
                                          " splats, one each is needed");
  }
  if (cloud.size() > UINT32_MAX) {
    fail(ErrorCode::kUnsupported, "cloud has " + std::to_string(cloud.size()) +
                                      " splats; holes of at most 4294967295 can be filled");
  }
  std::vector<uint32_t> gone, rest;
  for (uint32_t i = 0; i < removed.size(); ++i) (removed[i] ? gone : rest).push_back(i);
  if (gone.empty() || rest.empty()) {
    fail(ErrorCode::kInvalidArgument,
         std::string("mask removes ") + (gone.empty() ? "no splats" : "all splats") +
             "; a hole needs splats that are removed, and others around it that stay");
  }
  report = {};
  advance(progress, 0.0, "Looking for holes");
  const auto groups = groupsOf(cloud, gone, options, report, progress);
  report.hole_count = groups.size();
  SplatCloud result;
  result.sh_degree = cloud.sh_degree;
  result.colour_space = cloud.colour_space;
  result.antialias = cloud.antialias;
  result.frame = cloud.frame;
  for (size_t g = 0; g < groups.size(); ++g) {
    advance(progress, 0.1 + 0.9 * static_cast<double>(g) / static_cast<double>(groups.size()),
            "Filling holes");
    Hole(cloud, groups[g], options).fill(rest, result, report);
  }
  report.splat_count = result.size();
  return result;
}

}  // namespace stipple
