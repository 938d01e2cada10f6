#include "wide_reference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace stipple::testing {

namespace {

using Real = long double;
using Vector = std::array<Real, 3>;
using Matrix = std::array<Vector, 3>;  ///< rows

constexpr Real kPi = std::numbers::pi_v<Real>;

Real dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Vector apply(const Matrix& m, const Vector& v) {
  return {dot(m[0], v), dot(m[1], v), dot(m[2], v)};
}

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Rows are the axes of the splat in the world. In: w, x, y, z of any length.
Matrix axesOf(const float* quaternion) {
  Real q[4], length = 0;
  for (int i = 0; i < 4; ++i) length += Real(quaternion[i]) * Real(quaternion[i]);
  for (int i = 0; i < 4; ++i) q[i] = Real(quaternion[i]) / std::sqrt(length);
  const auto [w, x, y, z] = std::array{q[0], q[1], q[2], q[3]};
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
           {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
           {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}}};
}

struct Splat {
  Vector centre;    ///< from the camera, axes of the world
  Matrix whitened;  ///< lengths in standard deviations
  Real opacity;
  Real colour[3];
};

Vector whiten(const Splat& splat, const Vector& v) {
  return apply(splat.whitened, v);
}

bool directionOf(const Camera& camera, uint32_t column, uint32_t row, Vector& direction) {
  const Real x = (column + Real(0.5) - Real(camera.cx)) / Real(camera.fx);
  const Real y = (row + Real(0.5) - Real(camera.cy)) / Real(camera.fy);
  if (camera.model == CameraModel::kEquirectangular) {
    direction = {std::sin(x) * std::cos(y), std::sin(y), std::cos(x) * std::cos(y)};
    return std::abs(y) <= kPi / 2;
  }
  const Real radius = std::sqrt(x * x + y * y), turn = std::atan2(y, x);
  const bool is_equisolid = camera.model == CameraModel::kFisheyeEquisolid;
  if (is_equisolid && radius > 2) return false;
  const Real angle = is_equisolid ? 2 * std::asin(radius / 2) : radius;
  direction = {std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), std::cos(angle)};
  return angle <= kPi;
}

std::vector<Splat> splatsOf(const SplatCloud& cloud, const Camera& camera) {
  std::vector<Splat> splats(cloud.size());
  for (size_t i = 0; i < splats.size(); ++i) {
    Splat& splat = splats[i];
    // Camera: R p + t, so p + R^T t in the axes of the world.
    for (Eigen::Index k = 0; k < 3; ++k) {
      Real moved = 0;
      for (Eigen::Index j = 0; j < 3; ++j) {
        moved += Real(camera.world_to_camera(j, k)) * Real(camera.world_to_camera(j, 3));
      }
      const auto place = static_cast<size_t>(k);
      splat.centre[place] = Real(cloud.positions[i * 3 + place]) + moved;
    }
    const Real pixel =
        std::sqrt(dot(splat.centre, splat.centre) / (Real(camera.fx) * Real(camera.fy)));
    splat.whitened = axesOf(&cloud.rotations[i * 4]);
    for (size_t k = 0; k < 3; ++k) {
      const Real scale = Real(cloud.scales[i * 3 + k]);
      const Real width = std::sqrt(scale * scale + Real(0.3) * pixel * pixel);
      for (Real& entry : splat.whitened[k]) entry /= width;
      splat.colour[k] =
          std::max(Real(0), Real(0.5) + std::sqrt(1 / kPi) / 2 * Real(cloud.sh[i * 3 + k]));
    }
    splat.opacity = Real(cloud.opacities[i]);
  }
  return splats;
}

}  // namespace

std::vector<double> wideReference(const SplatCloud& cloud, const Camera& camera) {
  const std::vector<Splat> splats = splatsOf(cloud, camera);
  std::vector<double> picture(size_t{camera.width} * camera.height * 4);
  for (uint32_t row = 0; row < camera.height; ++row) {
    for (uint32_t column = 0; column < camera.width; ++column) {
      Vector seen, ray;
      if (!directionOf(camera, column, row, seen)) continue;
      for (size_t k = 0; k < 3; ++k) {
        ray[k] = 0;
        for (size_t j = 0; j < 3; ++j) {
          ray[k] += Real(camera.world_to_camera(static_cast<Eigen::Index>(j),
                                                static_cast<Eigen::Index>(k))) *
                    seen[j];
        }
      }
      std::vector<std::pair<Real, size_t>> hits;
      std::vector<Real> alphas(splats.size());
      for (size_t i = 0; i < splats.size(); ++i) {
        const Vector to = whiten(splats[i], splats[i].centre), along = whiten(splats[i], ray);
        const Real length = dot(along, along), place = dot(to, along) / length;
        const Vector across = cross(to, along);
        alphas[i] = splats[i].opacity * std::exp(-dot(across, across) / length / 2);
        if (place >= Real(camera.near_plane) && alphas[i] >= Real(1e-9)) hits.push_back({place, i});
      }
      std::stable_sort(hits.begin(), hits.end(),
                       [](const auto& a, const auto& b) { return a.first < b.first; });
      Real through = 1, sums[4] = {0, 0, 0, 0};
      for (const auto& [place, i] : hits) {
        for (size_t c = 0; c < 3; ++c) sums[c] += through * alphas[i] * splats[i].colour[c];
        through *= 1 - alphas[i];
      }
      sums[3] = 1 - through;
      double* pixel = &picture[(size_t{row} * camera.width + column) * 4];
      for (size_t c = 0; c < 4; ++c) pixel[c] = static_cast<double>(sums[c]);
    }
  }
  return picture;
}

}  // namespace stipple::testing
