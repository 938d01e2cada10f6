#include "fit/registration/bound_splats.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "math/cross_product.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

/// Triangles with edges of several times as many pixels have several splats: smaller ones than that
/// would be spread by the renderer's low pass, larger ones hide bends from the images.
constexpr double kPartPixels = 1.5;
constexpr uint32_t kMostParts = 16;
/// Where triangles have several; more would take longer than they tell.
constexpr size_t kMostSplats = 200000;
/// Standard deviation over the edge of a part. Six splats meet where the pattern of even triangles
/// is thinnest, 1/sqrt(3) away, and cover 97 % of it.
constexpr double kSpread = 0.45;
constexpr double kThickness = 0.05;  ///< of the mean edge of parts
constexpr float kOpacity = 0.99f;
constexpr double kLeastHeight = 0.1;  ///< of the mean edge

}  // namespace

/// A triangle as its splats lie on it.
struct BoundSplats::Frame {
  std::array<uint32_t, 3> corners;  ///< vertices; the first two have the longest edge
  Vec3d along, across, normal;      ///< unit; along the edge, in the plane, out of it
  double length = 0, height = 0;    ///< of the edge, and over it
  double foot = 0;                  ///< where the third corner is along the edge, metres
};

BoundSplats::BoundSplats(const MeshLinks& links, std::span<const Vec3d> positions, double pixel)
    : links_(links), first_(links.triangleCount()) {
  const std::span<const uint32_t> triangles = links.triangles();
  for (size_t t = 0; t < first_.size(); ++t) {
    double longest = -1;
    for (size_t corner = 0; corner < 3; ++corner) {
      const double length =
          (positions[triangles[t * 3 + (corner + 1) % 3]] - positions[triangles[t * 3 + corner]])
              .norm();
      mean_edge_ += length;
      if (length > longest) {
        longest = length;
        first_[t] = static_cast<uint8_t>(corner);
      }
    }
  }
  const double count = static_cast<double>(std::max<size_t>(first_.size(), 1));
  mean_edge_ /= 3 * count;
  const double wanted = std::round(mean_edge_ / (kPartPixels * pixel));
  const double most = std::floor(std::sqrt(static_cast<double>(kMostSplats) / count));
  const auto parts =
      static_cast<uint32_t>(std::clamp(wanted, 1.0, std::clamp(most, 1.0, double{kMostParts})));
  parts_ = parts;
  const auto add = [&](double second, double third) {
    places_.emplace_back(1 - (second + third) / parts, second / parts, third / parts);
  };
  for (uint32_t i = 0; i < parts; ++i) {
    for (uint32_t j = 0; i + j < parts; ++j) {
      add(i + 1.0 / 3, j + 1.0 / 3);
      if (i + j + 1 < parts) add(i + 2.0 / 3, j + 2.0 / 3);
    }
  }
}

size_t BoundSplats::countBound(size_t triangle_count) {
  return std::max(triangle_count, kMostSplats);
}

bool BoundSplats::frameOf(std::span<const Vec3d> positions, size_t triangle, Frame& frame) const {
  const uint32_t* corners = &links_.triangles()[triangle * 3];
  for (size_t i = 0; i < 3; ++i) frame.corners[i] = corners[(first_[triangle] + i) % 3];
  const Vec3d& begin = positions[frame.corners[0]];
  const Vec3d edge = positions[frame.corners[1]] - begin;
  const Vec3d other = positions[frame.corners[2]] - begin;
  const Vec3d area = crossProduct(edge, other);
  frame.length = edge.norm();
  const double twice = area.norm();
  if (!(frame.length > 0) || !(twice > 0)) return false;
  frame.along = edge / frame.length;
  frame.normal = area / twice;
  frame.across = crossProduct(frame.normal, frame.along);
  frame.height = twice / frame.length;
  frame.foot = other.dot(frame.along);
  return true;
}

void BoundSplats::place(std::span<const Vec3d> positions, std::span<const Vec3d> colours,
                        SplatCloud& cloud) const {
  cloud.sh_degree = 0;
  cloud.colour_space = ColourSpace::kLinear;
  cloud.resize(count());
  size_t i = 0;
  for (size_t t = 0; t < links_.triangleCount(); ++t) {
    Frame frame;
    const bool has_area = frameOf(positions, t, frame);
    Vec4d rotation(1, 0, 0, 0);
    Vec3d scales = Vec3d::Zero();
    if (has_area) {
      Mat3d axes;
      axes << frame.along, frame.across, frame.normal;
      rotation = quaternionFromRotation(axes);
      scales = kSpread / parts_ *
               Vec3d(frame.length, 2 / std::sqrt(3.0) * frame.height, kThickness * mean_edge_);
    }
    for (const Vec3d& weights : places_) {
      Vec3d place = Vec3d::Zero(), colour = Vec3d::Zero();
      for (size_t k = 0; k < 3; ++k) {
        const double weight = weights[static_cast<Eigen::Index>(k)];
        place += weight * positions[frame.corners[k]];
        colour += weight * colours[frame.corners[k]];
      }
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const size_t at = i * 3 + static_cast<size_t>(axis);
        cloud.positions[at] = static_cast<float>(place[axis]);
        cloud.scales[at] = static_cast<float>(scales[axis]);
        cloud.sh[at] = (static_cast<float>(colour[axis]) - 0.5f) / kShC0;
      }
      for (Eigen::Index k = 0; k < 4; ++k) {
        cloud.rotations[i * 4 + static_cast<size_t>(k)] = static_cast<float>(rotation[k]);
      }
      cloud.opacities[i] = has_area ? kOpacity : 0.0f;
      ++i;
    }
  }
}

void BoundSplats::addGradient(std::span<const Vec3d> positions, const SplatCloud& by_splats,
                              double factor, std::span<Vec3d> by_position,
                              std::span<Vec3d> by_colour) const {
  const auto rowOf = [&](const std::vector<float>& values, size_t i) {
    return Vec3d(static_cast<double>(values[i * 3]), static_cast<double>(values[i * 3 + 1]),
                 static_cast<double>(values[i * 3 + 2]));
  };
  size_t i = 0;
  for (size_t t = 0; t < links_.triangleCount(); ++t) {
    Frame frame;
    if (!frameOf(positions, t, frame)) {
      i += places_.size();
      continue;
    }
    Mat3d axes;
    axes << frame.along, frame.across, frame.normal;
    const Vec4d q = quaternionFromRotation(axes);
    const Vec3d v(q[1], q[2], q[3]);
    Vec3d by_turn = Vec3d::Zero(), by_scales = Vec3d::Zero();
    for (const Vec3d& weights : places_) {
      const Vec3d by_place = factor * rowOf(by_splats.positions, i);
      const Vec3d by_sh = factor / static_cast<double>(kShC0) * rowOf(by_splats.sh, i);
      for (size_t k = 0; k < 3; ++k) {
        const double weight = weights[static_cast<Eigen::Index>(k)];
        by_position[frame.corners[k]] += weight * by_place;
        by_colour[frame.corners[k]] += weight * by_sh;
      }
      by_scales += factor * rowOf(by_splats.scales, i);
      // Turning by w changes a quaternion q by (0, w) q / 2.
      const float* by_q = &by_splats.rotations[i * 4];
      const Vec3d by_v(static_cast<double>(by_q[1]), static_cast<double>(by_q[2]),
                       static_cast<double>(by_q[3]));
      by_turn +=
          0.5 * factor * (q[0] * by_v - static_cast<double>(by_q[0]) * v + crossProduct(v, by_v));
      ++i;
    }
    // How the frame turns about its own axes as the edge and the third corner move.
    const double length = std::max(frame.length, kLeastHeight * mean_edge_);
    const double height = std::max(frame.height, kLeastHeight * mean_edge_);
    const double about_along = by_turn.dot(frame.along), about_across = by_turn.dot(frame.across),
                 about_normal = by_turn.dot(frame.normal);
    const double by_length = kSpread / parts_ * by_scales[0];
    const double by_height = kSpread / parts_ * 2 / std::sqrt(3.0) * by_scales[1];
    const double slope = frame.foot / length;
    const Vec3d by_other = about_along / height * frame.normal + by_height * frame.across;
    const Vec3d by_edge = (about_normal / length - by_height * slope) * frame.across -
                          (about_across / length + about_along * slope / height) * frame.normal +
                          by_length * frame.along;
    by_position[frame.corners[1]] += by_edge;
    by_position[frame.corners[2]] += by_other;
    by_position[frame.corners[0]] -= by_edge + by_other;
  }
}

RenderOptions boundSplatsDrawing() {
  RenderOptions options;
  options.low_pass = LowPass::kMip;
  options.with_depth = false;
  return options;
}

}  // namespace stipple
