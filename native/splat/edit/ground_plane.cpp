#include "splat/edit/ground_plane.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "base/random.h"
#include "math/affine.h"
#include "math/principal_axes.h"

// Based on: Fischler and Bolles, Random Sample Consensus, CACM 1981. Differs: candidates are scored
// by what lies in the plane less what lies below it, and the best is refitted by least squares.

namespace stipple {

namespace {

constexpr size_t kMaxConsidered = 50000;
constexpr size_t kScored = 4000;  ///< of those, for comparing candidates
constexpr uint64_t kCandidates = 3000;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kRefits = 8;
/// Below this, splats are haze rather than surface.
constexpr float kSolid = 0.1f;

struct WeightedPoint {
  Vec3d at;
  double weight;  ///< area that the splat covers, within bounds; unitless
};

Vec3d cross(const Vec3d& a, const Vec3d& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

std::string text(const Vec3d& v) {
  return std::string("(") + numberText(v[0]) + ", " + numberText(v[1]) + ", " + numberText(v[2]) +
         ")";
}

/// Up to `most` of the solid splats (of all where hardly any is solid), evenly over the list.
std::vector<WeightedPoint> considered(const SplatCloud& cloud, const Mat4d& cloud_to_world,
                                      size_t most) {
  std::vector<size_t> chosen;
  for (size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.opacities[i] >= kSolid) chosen.push_back(i);
  }
  if (chosen.size() < std::max<size_t>(3, cloud.size() / 20)) {
    chosen.clear();
    for (size_t i = 0; i < cloud.size(); ++i) chosen.push_back(i);
  }
  const size_t count = std::min(chosen.size(), most);
  std::vector<WeightedPoint> points(count);
  std::vector<double> areas(count);
  const Mat3d linear = linearPart(cloud_to_world);
  for (size_t k = 0; k < count; ++k) {
    const size_t i = chosen[k * chosen.size() / count];
    const float* p = &cloud.positions[i * 3];
    points[k].at = linear * Vec3d(static_cast<double>(p[0]), static_cast<double>(p[1]),
                                  static_cast<double>(p[2])) +
                   translationPart(cloud_to_world);
    std::array<float, 3> s = {cloud.scales[i * 3], cloud.scales[i * 3 + 1],
                              cloud.scales[i * 3 + 2]};
    std::sort(s.begin(), s.end());
    areas[k] = static_cast<double>(s[1]) * static_cast<double>(s[2]);
  }
  // Floors are covered by few large splats, so area counts; within what is usual, so that one sheet
  // of sky does not decide.
  std::vector<double> sorted = areas;
  std::sort(sorted.begin(), sorted.end());
  const double usual = count > 0 ? sorted[count * 9 / 10] : 0;
  const double least = 0.05 * usual;
  for (size_t k = 0; k < count; ++k) {
    points[k].weight = usual > 0 ? std::clamp(areas[k], least, usual) / usual : 1.0;
  }
  return points;
}

/// Length of the diagonal of the box that holds the middle 80 % along each axis.
double middleExtent(const std::vector<WeightedPoint>& points) {
  Vec3d extent;
  std::vector<double> values(points.size());
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < points.size(); ++i) values[i] = points[i].at[axis];
    std::sort(values.begin(), values.end());
    extent[axis] = values[values.size() * 9 / 10] - values[values.size() / 10];
  }
  return extent.norm();
}

/// The box that holds all but `outside` of the points on either side of each axis of a frame.
void middleBox(const std::vector<WeightedPoint>& points, const Mat4d& to_frame, double outside,
               Vec3d& lowest, Vec3d& highest) {
  std::vector<double> values(points.size());
  const size_t left_out =
      std::min(static_cast<size_t>(outside * static_cast<double>(points.size())),
               (points.size() - 1) / 2);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < points.size(); ++i) {
      values[i] = (linearPart(to_frame) * points[i].at + translationPart(to_frame))[axis];
    }
    std::sort(values.begin(), values.end());
    lowest[axis] = values[left_out];
    highest[axis] = values[points.size() - 1 - left_out];
  }
}

/// Weight in the plane less weight below it.
double score(const Plane& plane, double tolerance, const std::vector<WeightedPoint>& points,
             size_t step) {
  double sum = 0;
  for (size_t i = 0; i < points.size(); i += step) {
    const double distance = plane.normal.dot(points[i].at) - plane.offset;
    if (std::abs(distance) <= tolerance) {
      const double near = distance / tolerance;
      sum += points[i].weight * (1.0 - near * near);
    } else if (distance < 0) {
      sum -= points[i].weight;
    }
  }
  return sum;
}

/// True where the triple makes a plane within the tilt; the plane's normal then looks up.
bool candidate(const std::array<Vec3d, 3>& p, const Vec3d& up, double min_cosine, Plane& plane) {
  const Vec3d normal = cross(p[1] - p[0], p[2] - p[0]);
  const double length = normal.norm();
  const double sides = (p[1] - p[0]).norm() * (p[2] - p[0]).norm();
  if (!(length > 1e-6 * sides)) return false;
  plane.normal = normal / length;
  if (plane.normal.dot(up) < 0) plane.normal = -plane.normal;
  plane.offset = plane.normal.dot(p[0]);
  return plane.normal.dot(up) >= min_cosine;
}

/// The least-squares plane of the splats near a plane.
Plane refitted(const Plane& plane, double tolerance, const std::vector<WeightedPoint>& points) {
  double total = 0;
  Vec3d mean = Vec3d::Zero();
  const auto isNear = [&](const WeightedPoint& point) {
    return std::abs(plane.normal.dot(point.at) - plane.offset) <= tolerance;
  };
  for (const WeightedPoint& point : points) {
    if (!isNear(point)) continue;
    total += point.weight;
    mean += point.weight * point.at;
  }
  if (!(total > 0)) return plane;
  mean /= total;
  Mat3d spread = Mat3d::Zero();
  for (const WeightedPoint& point : points) {
    if (!isNear(point)) continue;
    const Vec3d d = point.at - mean;
    spread += point.weight * d * d.transpose();
  }
  const PrincipalAxes axes = principalAxes(spread);
  Eigen::Index thin = 0;
  axes.lengths.minCoeff(&thin);
  Plane result;
  result.normal = axes.axes.col(thin);
  if (result.normal.dot(plane.normal) < 0) result.normal = -result.normal;
  result.offset = result.normal.dot(mean);
  return result;
}

}  // namespace

GroundPlane groundPlane(const SplatCloud& cloud, const Mat4d& cloud_to_world,
                        const GroundPlaneOptions& options) {
  validate(cloud, "cloud");
  validateAffine(cloud_to_world, "cloud_to_world");
  for (Eigen::Index k = 0; k < 3; ++k) requireFinite(options.up[k], "up");
  if (!(options.max_tilt > 0 && options.max_tilt <= std::numbers::pi / 2)) {
    fail(ErrorCode::kInvalidArgument, "max_tilt is " + std::to_string(options.max_tilt) +
                                          " radians; above 0 up to 1.570796 is allowed");
  }
  if (options.tolerance && !(*options.tolerance > 0 && *options.tolerance < 1e30)) {
    fail(ErrorCode::kInvalidArgument,
         "tolerance is " + std::to_string(*options.tolerance) + " m; above 0 is allowed");
  }
  if (cloud.size() < 3) {
    fail(ErrorCode::kInvalidArgument, "the cloud has " + std::to_string(cloud.size()) +
                                          " splats; a ground plane needs at least 3");
  }
  const std::vector<WeightedPoint> points = considered(cloud, cloud_to_world, kMaxConsidered);
  GroundPlane result;
  result.considered_count = points.size();
  result.tolerance = options.tolerance.value_or(0.005 * middleExtent(points));
  const bool any_tilt = !(options.up.norm() > 0);
  const Vec3d up = any_tilt ? Vec3d(Vec3d::UnitZ()) : Vec3d(options.up / options.up.norm());
  const double min_cosine = any_tilt ? -1.0 : std::cos(options.max_tilt);

  // Scores of all candidates first, the best of them after: the same for any number of threads.
  struct Scored {
    Plane plane;
    double score = -kInfinity;
  };
  std::vector<Scored> candidates(kCandidates);
  const size_t step = std::max<size_t>(1, points.size() / kScored);
  parallelFor(kCandidates, 64, [&](size_t begin, size_t end) {
    for (size_t c = begin; c < end; ++c) {
      std::array<Vec3d, 3> triple;
      for (size_t k = 0; k < 3; ++k) {
        const double u = unitDouble(keyedBits(options.seed, RandomUse::kGroundPlane, c * 3 + k));
        triple[k] = points[static_cast<size_t>(u * static_cast<double>(points.size()))].at;
      }
      Scored& made = candidates[c];
      if (!candidate(triple, up, min_cosine, made.plane)) continue;
      made.score = score(made.plane, result.tolerance, points, step);
      if (!any_tilt) continue;
      // Without a hint either side may be up.
      const Plane other{-made.plane.normal, -made.plane.offset};
      const double flipped = score(other, result.tolerance, points, step);
      if (flipped > made.score) made = {other, flipped};
    }
  });
  const auto best =
      std::max_element(candidates.begin(), candidates.end(),
                       [](const Scored& a, const Scored& b) { return a.score < b.score; });
  if (best->score == -kInfinity) {
    fail(ErrorCode::kInvalidArgument,
         "no plane within " + std::to_string(options.max_tilt * 180 / std::numbers::pi) +
             " degrees of the up direction was found; a larger tilt or another up axis is needed");
  }
  result.plane = best->plane;
  for (int i = 0; i < kRefits; ++i) {
    result.plane = refitted(result.plane, result.tolerance, points);
  }
  for (const WeightedPoint& point : points) {
    const double distance = result.plane.normal.dot(point.at) - result.plane.offset;
    if (std::abs(distance) <= result.tolerance) ++result.inlier_count;
  }
  middleBox(points, levelling(result.plane), 0.01, result.extent_min, result.extent_max);
  return result;
}

Plane planeThrough(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& up) {
  for (const Vec3d* point : {&a, &b, &c, &up}) {
    for (Eigen::Index k = 0; k < 3; ++k) requireFinite((*point)[k], "point");
  }
  Plane plane;
  if (!candidate({a, b, c}, up, -kInfinity, plane)) {
    fail(ErrorCode::kInvalidArgument, "the points " + text(a) + ", " + text(b) + " and " + text(c) +
                                          " lie on one line; three that span a plane are needed");
  }
  return plane;
}

Mat4d levelling(const Plane& plane) {
  const Vec3d from = plane.normal;
  const Vec3d to = Vec3d::UnitZ();
  const Vec3d axis = cross(from, to);
  const double cosine = from.dot(to);
  Mat3d turn;
  if (cosine < -1 + 1e-12) {
    turn << 1, 0, 0, 0, -1, 0, 0, 0, -1;  // upside down: half a turn about x
  } else {
    Mat3d skew;
    skew << 0, -axis[2], axis[1], axis[2], 0, -axis[0], -axis[1], axis[0], 0;
    turn = Mat3d::Identity() + skew + skew * skew / (1 + cosine);
  }
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() = turn;
  matrix(2, 3) = -plane.offset;
  return matrix;
}

Mat4d scalingTo(const Vec3d& a, const Vec3d& b, double length) {
  for (Eigen::Index k = 0; k < 3; ++k) {
    requireFinite(a[k], "first point");
    requireFinite(b[k], "second point");
  }
  const double now = (b - a).norm();
  if (!(length > 0) || !std::isfinite(length)) {
    fail(ErrorCode::kInvalidArgument,
         "length is " + std::to_string(length) + " m; above 0 is allowed");
  }
  if (!(now > 0)) {
    fail(ErrorCode::kInvalidArgument,
         "both points are " + text(a) + "; two different ones are needed");
  }
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() *= length / now;
  return matrix;
}

}  // namespace stipple
