#include "splat/render/ray_splats.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "base/parallel.h"
#include "math/covariance.h"
#include "math/principal_axes.h"
#include "splat/render/depth_order.h"
#include "splat/render/projection.h"

namespace stipple {

namespace {

/// Whether a matrix only turns, mirrors and scales evenly.
bool isSimilarity(const Mat3d& linear, double& scale) {
  const Mat3d square = linear.transpose() * linear;
  const double mean = square.trace() / 3;
  scale = std::sqrt(mean);
  return (square - mean * Mat3d::Identity()).cwiseAbs().maxCoeff() <= 1e-12 * mean;
}

PrincipalAxes axesOf(const PlacedCloud& placed, bool is_similarity, double scale, size_t index) {
  const SplatCloud& cloud = *placed.cloud;
  const float* rotation = &cloud.rotations[index * 4];
  const float* scales = &cloud.scales[index * 3];
  if (is_similarity) {
    return {placed.linear / scale * rotationFromQuaternion<double>(rotation),
            scale * Vec3d(scales[0], scales[1], scales[2]), Mat3d::Identity()};
  }
  return principalAxes(placed.linear * scaledAxes<double>(rotation, scales));
}

/// Area of a Gaussian's silhouette along a direction, but for a factor: sqrt(det S d^T S^-1 d) with
/// d in the frame of the axes; no division, so that flat splats are exact.
double silhouette(const Vec3d& squares, const Vec3d& direction) {
  const Vec3d d = direction.cwiseAbs2();
  return std::sqrt(d[0] * squares[1] * squares[2] + d[1] * squares[0] * squares[2] +
                   d[2] * squares[0] * squares[1]);
}

class Maker {
 public:
  Maker(const PlacedScene& scene, const PlacedCloud& placed, double least_alpha,
        const ViewSides& sides)
      : scene_(scene), placed_(placed), least_alpha_(least_alpha), sides_(sides) {
    is_similarity_ = isSimilarity(placed.linear, scale_);
  }

  /// Returns false where the splat cannot show.
  bool make(size_t index, RaySplat& splat) const {
    const View<double>& view = scene_.view;
    const float* position = &placed_.cloud->positions[index * 3];
    splat.centre =
        placed_.linear * Vec3d(position[0], position[1], position[2]) + placed_.translation;
    const double z = depthOf(view, splat.centre);
    if (!(z >= view.near_plane && z <= view.far_plane)) return false;
    const double pixel = (view.perspective ? z : 1.0) / std::sqrt(view.fx * view.fy);
    const PrincipalAxes axes = axesOf(placed_, is_similarity_, scale_, index);
    Vec3d squares = axes.lengths.cwiseAbs2();
    splat.opacity = placed_.opacity(index);
    const double added = lowPassVariance<double>(placed_.low_pass) * pixel * pixel;
    if (placed_.low_pass == LowPass::kMip) {
      const Vec3d towards = view.perspective ? Vec3d(splat.centre.normalized()) : Vec3d(0, 0, 1);
      const Vec3d direction = axes.axes.transpose() * towards;
      const double before = silhouette(squares, direction);
      squares.array() += added;
      splat.opacity *= before / silhouette(squares, direction);
    } else {
      squares.array() += added;
    }
    if (!(splat.opacity >= least_alpha_)) return false;
    const double thinnest = kMinWidth * pixel;
    const Vec3d scales = squares.cwiseSqrt().cwiseMax(thinnest);
    splat.whiten = scales.cwiseInverse().asDiagonal() * axes.axes.transpose();
    const double reach = std::sqrt(2 * std::log(splat.opacity / least_alpha_));
    splat.radius = scales.maxCoeff() * reach * (1 + 1e-9);
    if (!view.is_wide && !sides_.touch(splat.centre, splat.radius)) return false;
    splatColour(scene_, placed_, index, splat.colour);
    splat.is_holdout = placed_.is_holdout;
    if (splat.is_holdout) std::fill(splat.colour, splat.colour + 3, 0.0);
    return true;
  }

 private:
  const PlacedScene& scene_;
  const PlacedCloud& placed_;
  double least_alpha_;
  const ViewSides& sides_;
  bool is_similarity_ = false;
  double scale_ = 1;
};

/// A bound of what affineSplats finds: a splat is magnified by at most 1 + |slope|, slopes held to
/// 1.3 of those at the borders.
bool showsAffine(const View<double>& view, const Vec3d& centre, double longest, double added,
                 double reach) {
  const double focal[2] = {view.fx, view.fy};
  const double middle[2] = {view.cx, view.cy};
  const double size[2] = {view.width, view.height};
  const double depth = view.perspective ? centre[2] : 1.0;
  for (size_t axis = 0; axis < 2; ++axis) {
    const double steepest =
        view.perspective ? std::max(std::abs(view.slope_min[axis]), std::abs(view.slope_max[axis]))
                         : 0.0;
    const double magnified = focal[axis] * (1 + steepest) * longest / depth;
    const double pixels = reach * std::sqrt(magnified * magnified + added) + 1;
    const double place = focal[axis] * centre[static_cast<int>(axis)] / depth + middle[axis];
    if (place + pixels < 0 || place - pixels > size[axis]) return false;
  }
  return true;
}

}  // namespace

ViewSides::ViewSides(const View<double>& view) {
  const double focal[2] = {view.fx, view.fy};
  const double middle[2] = {view.cx, view.cy};
  const double size[2] = {view.width, view.height};
  for (size_t axis = 0; axis < 2; ++axis) {
    const double low = -middle[axis] / focal[axis];
    const double high = (size[axis] - middle[axis]) / focal[axis];
    Vec3d across = Vec3d::Zero();
    across[static_cast<int>(axis)] = 1;
    if (view.perspective) {
      inward_[axis * 2] = (across - Vec3d(0, 0, low)).normalized();
      inward_[axis * 2 + 1] = (Vec3d(0, 0, high) - across).normalized();
      offsets_[axis * 2] = offsets_[axis * 2 + 1] = 0;
    } else {
      inward_[axis * 2] = across;
      inward_[axis * 2 + 1] = -across;
      offsets_[axis * 2] = -low;
      offsets_[axis * 2 + 1] = high;
    }
  }
}

bool ViewSides::touch(const Vec3d& centre, double radius) const {
  // Rounding of the distance, which is a difference of terms as large as the centre's.
  const double room = radius + 1e-9 * (centre.cwiseAbs().maxCoeff() + radius);
  for (size_t side = 0; side < inward_.size(); ++side) {
    if (inward_[side].dot(centre) + offsets_[side] < -room) return false;
  }
  return true;
}

std::vector<RaySplat> raySplats(const PlacedScene& scene, double least_alpha) {
  const ViewSides sides(scene.view);
  std::vector<Maker> makers;
  for (const PlacedCloud& placed : scene.clouds) {
    makers.emplace_back(scene, placed, least_alpha, sides);
  }
  return splatsInDepthOrder<RaySplat>(
      scene,
      [&](const PlacedCloud& placed, size_t i, RaySplat& splat) {
        return makers[static_cast<size_t>(&placed - scene.clouds.data())].make(i, splat);
      },
      [&](const RaySplat& splat) { return depthOf(scene.view, splat.centre); });
}

uint64_t mostRaySplats(const PlacedScene& scene, double least_alpha, bool is_affine) {
  constexpr size_t kCountGrain = 8192;
  const View<double>& view = scene.view;
  const ViewSides sides(view);
  // Pixels from the axis are focal lengths times slopes, which the affine projection holds.
  const double pixel_at_one = 1 / std::sqrt(view.fx * view.fy);
  std::atomic<uint64_t> sum{0};
  for (const PlacedCloud& placed : scene.clouds) {
    const SplatCloud& cloud = *placed.cloud;
    double stretch;
    if (!isSimilarity(placed.linear, stretch)) stretch = placed.linear.norm();
    const double added = lowPassVariance<double>(placed.low_pass);
    parallelFor(cloud.size(), kCountGrain, [&](size_t begin, size_t end) {
      uint64_t count = 0;
      for (size_t i = begin; i < end; ++i) {
        const float* p = &cloud.positions[i * 3];
        const Vec3d centre = placed.linear * Vec3d(p[0], p[1], p[2]) + placed.translation;
        const double z = depthOf(view, centre);
        if (!(z >= view.near_plane && z <= view.far_plane)) continue;
        const double opacity = placed.opacity(i);
        if (!(opacity >= least_alpha)) continue;
        const float* s = &cloud.scales[i * 3];
        const double longest = stretch * static_cast<double>(std::max({s[0], s[1], s[2]}));
        const double pixel = (view.perspective ? z : 1.0) * pixel_at_one;
        const double reach = std::sqrt(2 * std::log(opacity / least_alpha)) * (1 + 1e-6);
        const double thick =
            std::max(std::sqrt(longest * longest + added * pixel * pixel), kMinWidth * pixel);
        if (is_affine ? showsAffine(view, centre, longest, added, reach)
                      : sides.touch(centre, thick * reach)) {
          ++count;
        }
      }
      sum.fetch_add(count, std::memory_order_relaxed);
    });
  }
  return sum;
}

}  // namespace stipple
