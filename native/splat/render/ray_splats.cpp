#include "splat/render/ray_splats.h"

#include <algorithm>
#include <cmath>

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
  Maker(const PlacedScene& scene, const PlacedCloud& placed, double least_alpha)
      : scene_(scene), placed_(placed), least_alpha_(least_alpha) {
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
    splatColour(scene_, placed_, index, splat.colour);
    splat.is_holdout = placed_.is_holdout;
    if (splat.is_holdout) std::fill(splat.colour, splat.colour + 3, 0.0);
    return true;
  }

 private:
  const PlacedScene& scene_;
  const PlacedCloud& placed_;
  double least_alpha_;
  bool is_similarity_ = false;
  double scale_ = 1;
};

}  // namespace

std::vector<RaySplat> raySplats(const PlacedScene& scene, double least_alpha) {
  std::vector<Maker> makers;
  for (const PlacedCloud& placed : scene.clouds) makers.emplace_back(scene, placed, least_alpha);
  return splatsInDepthOrder<RaySplat>(
      scene,
      [&](const PlacedCloud& placed, size_t i, RaySplat& splat) {
        return makers[static_cast<size_t>(&placed - scene.clouds.data())].make(i, splat);
      },
      [&](const RaySplat& splat) { return depthOf(scene.view, splat.centre); });
}

}  // namespace stipple
