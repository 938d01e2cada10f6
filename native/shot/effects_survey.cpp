#include "shot/effects_survey.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "math/affine.h"
#include "splat/render/blend.h"
#include "splat/render/projection.h"
#include "splat/render/scene.h"

// Based on: Zwicker et al., EWA Volume Splatting, Visualization 2001 (the affine approximation,
// whose remainder is bounded here instead of estimated).

namespace stipple {

namespace {

constexpr uint64_t kMostLooked = uint64_t{1} << 17;
constexpr size_t kGrain = 1024;
constexpr size_t kDepthGrain = 1 << 15;

/// What one splat says; coverage 0 where it is not in the picture.
struct Look {
  double coverage = 0;  ///< opacity times area, px^2
  double error_px = 0;
  double ahead_px = 0;
  double own_area = 0;  ///< opacity times area, without and with the low-pass
  double widened_area = 0;
  std::array<double, kMaxShDegree + 1> mean_square = {};
};

bool isPlane(const Camera& camera) {
  return camera.model == CameraModel::kPerspective || camera.model == CameraModel::kOrthographic;
}

/// Standard deviations at which alpha falls to 1/255.
double rimOf(double opacity) {
  return std::sqrt(2.0 * std::log(opacity / kMinAlpha));
}

Vec3d rowOf(const float* values) {
  return {static_cast<double>(values[0]), static_cast<double>(values[1]),
          static_cast<double>(values[2])};
}

/// Eigenvalues of J C J^T, px^2, larger first, of splats of any model: axes over the distance times
/// the focal length for those that are no plane.
std::array<double, 2> variances(const Camera& camera, const Vec3d& centre, const Mat3d& axes) {
  Eigen::Matrix<double, 2, 3> map;
  if (camera.model == CameraModel::kPerspective) {
    const double z = centre[2];
    map << camera.fx / z, 0, -camera.fx * centre[0] / (z * z), 0, camera.fy / z,
        -camera.fy * centre[1] / (z * z);
  } else if (camera.model == CameraModel::kOrthographic) {
    map << camera.fx, 0, 0, 0, camera.fy, 0;
  } else {
    // Across the ray, near enough for sizes.
    const double distance = centre.norm();
    const Vec3d ray = centre / distance;
    const int least = std::abs(ray[0]) < 0.6 ? 0 : 1;
    Vec3d side = Vec3d::Zero();
    side[least] = 1;
    side = (side - ray * ray[least]).eval();
    side /= side.norm();
    const Vec3d up{ray[1] * side[2] - ray[2] * side[1], ray[2] * side[0] - ray[0] * side[2],
                   ray[0] * side[1] - ray[1] * side[0]};
    map.row(0) = side.transpose() * (camera.fx / distance);
    map.row(1) = up.transpose() * (camera.fy / distance);
  }
  const Eigen::Matrix<double, 2, 3> a = map * axes;
  const double xx = a.row(0).squaredNorm(), yy = a.row(1).squaredNorm();
  const double xy = a.row(0).dot(a.row(1));
  const double middle = 0.5 * (xx + yy), spread = std::hypot(0.5 * (xx - yy), xy);
  return {middle + spread, std::max(middle - spread, 0.0)};
}

bool isInPicture(const Camera& camera, const Vec3d& centre, double radius_px) {
  double x, y;
  if (camera.model == CameraModel::kPerspective) {
    x = camera.fx * centre[0] / centre[2] + camera.cx;
    y = camera.fy * centre[1] / centre[2] + camera.cy;
  } else if (camera.model == CameraModel::kOrthographic) {
    x = camera.fx * centre[0] + camera.cx;
    y = camera.fy * centre[1] + camera.cy;
  } else {
    return true;
  }
  return x + radius_px >= 0 && x - radius_px <= camera.width && y + radius_px >= 0 &&
         y - radius_px <= camera.height;
}

Look lookAt(const PlacedCloud& placed, const Camera& camera, size_t index) {
  Look look;
  const SplatCloud& cloud = *placed.cloud;
  const double opacity = placed.opacity(index);
  if (!(opacity > kMinAlpha)) return look;
  const Vec3d centre = placed.linear * rowOf(&cloud.positions[index * 3]) + placed.translation;
  const double depth = isPlane(camera) ? centre[2] : centre.norm();
  if (!(depth >= camera.near_plane && depth <= camera.far_plane)) return look;
  const Mat3d axes =
      placed.linear * scaledAxes<double>(&cloud.rotations[index * 4], &cloud.scales[index * 3]);
  const double diagonal = std::hypot(camera.width, camera.height);
  const auto [larger, smaller] = variances(camera, centre, axes);
  const double rim = rimOf(opacity);
  const double radius = std::min(rim * std::sqrt(larger), diagonal);
  if (!isInPicture(camera, centre, radius)) return look;
  // Of a needle that is thinner than the low-pass, what is drawn counts.
  const double picture = static_cast<double>(camera.width) * camera.height;
  const double area =
      std::min(std::numbers::pi * std::sqrt((larger + 0.3) * (smaller + 0.3)), picture);
  look.coverage = opacity * area;
  if (camera.model == CameraModel::kPerspective) {
    look.error_px = std::min(affineErrorBound(camera, centre, axes, rim), diagonal);
    const double slope = std::hypot(centre[0], centre[1]) / centre[2];
    look.ahead_px = look.error_px / (slope + std::hypot(1.0, slope));
  }
  look.widened_area = look.coverage;
  look.own_area = placed.low_pass == LowPass::kClassic
                      ? opacity * std::min(std::numbers::pi * std::sqrt(larger * smaller), area)
                      : look.coverage;
  const float* sh = &cloud.sh[index * cloud.shStride()];
  for (int degree = 1; degree <= cloud.sh_degree; ++degree) {
    double sum = 0;
    for (size_t k = shCoefficientCount(degree - 1) * 3; k < shCoefficientCount(degree) * 3; ++k) {
      sum += static_cast<double>(sh[k]) * static_cast<double>(sh[k]);
    }
    // The basis is orthonormal over the sphere, whose area is 4 pi; three channels.
    look.mean_square[static_cast<size_t>(degree)] = sum / (4 * std::numbers::pi * 3);
  }
  return look;
}

/// The value that only `share` of the weight exceeds.
double weightedTail(std::vector<std::pair<double, double>>& values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end(), std::greater<>());
  double total = 0;
  for (const auto& [value, weight] : values) total += weight;
  double above = 0;
  for (const auto& [value, weight] : values) {
    above += weight;
    if (above > share * total) return value;
  }
  return values.back().first;
}

/// Full angle between opposite corners, the larger pair.
double fieldOfView(const Camera& camera) {
  if (camera.model != CameraModel::kPerspective) return 0;
  const auto ray = [&](double x, double y) {
    Vec3d direction{(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1.0};
    return Vec3d(direction / direction.norm());
  };
  const double w = camera.width, h = camera.height;
  const auto between = [&](const Vec3d& a, const Vec3d& b) {
    return std::acos(std::clamp(a.dot(b), -1.0, 1.0));
  };
  return std::max(between(ray(0, 0), ray(w, h)), between(ray(w, 0), ray(0, h)));
}

struct Interval {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
};

/// View depths of all centres of a cloud, or their distances where the camera sees no plane.
Interval depthsOf(const PlacedCloud& placed, bool is_plane) {
  const SplatCloud& cloud = *placed.cloud;
  std::vector<Interval> parts(rangeCount(cloud.size(), kDepthGrain));
  parallelFor(cloud.size(), kDepthGrain, [&](size_t begin, size_t end) {
    Interval& part = parts[begin / kDepthGrain];
    for (size_t i = begin; i < end; ++i) {
      const Vec3d seen = placed.linear * rowOf(&cloud.positions[i * 3]) + placed.translation;
      const double z = is_plane ? seen[2] : seen.norm();
      part.low = std::min(part.low, z);
      part.high = std::max(part.high, z);
    }
  });
  Interval all;
  for (const Interval& part : parts) {
    all.low = std::min(all.low, part.low);
    all.high = std::max(all.high, part.high);
  }
  return all;
}

uint64_t mixedCount(const PlacedScene& scene, const Camera& camera) {
  if (scene.clouds.size() < 2) return 0;
  std::vector<Interval> intervals;
  for (const PlacedCloud& placed : scene.clouds)
    intervals.push_back(depthsOf(placed, isPlane(camera)));
  std::sort(intervals.begin(), intervals.end(),
            [](const Interval& a, const Interval& b) { return a.low < b.low; });
  // Each run of intervals that touch is mixed.
  uint64_t mixed = 0, run = 1;
  double reach = intervals[0].high;
  for (size_t i = 1; i <= intervals.size(); ++i) {
    if (i < intervals.size() && intervals[i].low <= reach) {
      ++run;
      reach = std::max(reach, intervals[i].high);
      continue;
    }
    if (run > 1) mixed += run;
    run = 1;
    if (i < intervals.size()) reach = intervals[i].high;
  }
  return mixed;
}

}  // namespace

double affineErrorBound(const Camera& camera, const Vec3d& centre, const Mat3d& axes, double rim) {
  const double z = centre[2];
  const Vec3d forward = axes.row(2).transpose();
  const double reach = rim * forward.norm() / z;
  if (!(reach < 1)) return std::numeric_limits<double>::infinity();
  Eigen::Matrix<double, 2, 3> map;
  map << camera.fx / z, 0, -camera.fx * centre[0] / (z * z), 0, camera.fy / z,
      -camera.fy * centre[1] / (z * z);
  const Eigen::Matrix<double, 2, 3> a = map * axes;
  const Eigen::Vector2d along = a * forward;
  const double xx = a.row(0).squaredNorm(), yy = a.row(1).squaredNorm();
  const double larger = 0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), a.row(0).dot(a.row(1)));
  return rim * rim * (along.norm() + forward.norm() * std::sqrt(larger)) / (2 * z * (1 - reach));
}

double affineFieldOfView(double error_ahead_px, double error_px) {
  return std::max(4 * std::atan2(error_px, error_ahead_px) - std::numbers::pi, 0.0);
}

EffectsSurvey surveyEffects(std::span<const SplatInstance> instances, const Camera& camera) {
  const PlacedScene scene = placeSceneForRays(instances, camera, {});
  EffectsSurvey survey;
  survey.splat_count = scene.splat_count;
  survey.object_count = scene.clouds.size();
  survey.field_of_view = fieldOfView(camera);
  survey.mixed_count = mixedCount(scene, camera);
  for (const PlacedCloud& placed : scene.clouds) {
    survey.sh_degree = std::max(survey.sh_degree, placed.cloud->sh_degree);
  }
  survey.looked_count = std::min(scene.splat_count, kMostLooked);
  std::vector<Look> looks(survey.looked_count);
  const double step = static_cast<double>(scene.splat_count) /
                      std::max<double>(1, static_cast<double>(looks.size()));
  parallelFor(looks.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      // Places within the steps follow the golden ratio: splats often repeat with a period.
      const double place = static_cast<double>(i) * 0.6180339887498949;
      const double within = looks.size() == scene.splat_count ? 0 : place - std::floor(place);
      const auto splat = std::min(static_cast<uint64_t>((static_cast<double>(i) + within) * step),
                                  scene.splat_count - 1);
      const PlacedCloud& placed = scene.clouds[cloudOfSplat(scene, splat)];
      looks[i] = lookAt(placed, camera, splat - placed.first_index);
    }
  });

  std::vector<std::pair<double, double>> errors, ahead;
  double coverage = 0, own = 0, widened = 0;
  std::array<double, kMaxShDegree + 1> squares = {};
  for (const Look& look : looks) {
    if (!(look.coverage > 0)) continue;
    ++survey.seen_count;
    coverage += look.coverage;
    own += look.own_area;
    widened += look.widened_area;
    for (size_t d = 1; d < squares.size(); ++d) squares[d] += look.coverage * look.mean_square[d];
    errors.emplace_back(look.error_px, look.coverage);
    ahead.emplace_back(look.ahead_px, look.coverage);
  }
  if (survey.seen_count == 0) return survey;
  for (size_t d = 1; d < squares.size(); ++d) {
    survey.view_change[d] = std::sqrt(squares[d] / coverage);
  }
  survey.affine_error_px = weightedTail(errors, kUnusualShare);
  survey.error_ahead_px = weightedTail(ahead, kUnusualShare);
  // Splats thinner than anything that shows would make this infinite.
  survey.widening = widened / std::max(own, 1e-6 * widened);
  return survey;
}

}  // namespace stipple
