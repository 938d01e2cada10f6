#include "decode/silhouette.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stipple::test {

namespace {

/// Squared distances along one line: lower envelope of parabolas.
void transformLine(std::vector<double>& f) {
  const size_t n = f.size();
  std::vector<size_t> v(n);
  std::vector<double> z(n + 1), d(n);
  size_t k = 0;
  v[0] = 0;
  z[0] = -std::numeric_limits<double>::infinity();
  z[1] = std::numeric_limits<double>::infinity();
  for (size_t q = 1; q < n; ++q) {
    const auto crossing = [&](size_t p) {
      const auto a = static_cast<double>(q), b = static_cast<double>(p);
      return ((f[q] + a * a) - (f[p] + b * b)) / (2 * a - 2 * b);
    };
    double s = crossing(v[k]);
    while (s <= z[k]) s = crossing(v[--k]);
    v[++k] = q;
    z[k] = s;
    z[k + 1] = std::numeric_limits<double>::infinity();
  }
  k = 0;
  for (size_t q = 0; q < n; ++q) {
    while (z[k + 1] < static_cast<double>(q)) ++k;
    const double offset = static_cast<double>(q) - static_cast<double>(v[k]);
    d[q] = offset * offset + f[v[k]];
  }
  f = d;
}

}  // namespace

Camera viewFrom(const Vec3d& direction, const Vec3d& target, double radius, uint32_t size_px,
                CameraModel model) {
  const Vec3d forward = -direction.normalized();
  const Vec3d helper = std::abs(forward.z()) > 0.9 ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1);
  const auto cross = [](const Vec3d& a, const Vec3d& b) {
    return Vec3d(a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(),
                 a.x() * b.y() - a.y() * b.x());
  };
  const Vec3d right = cross(forward, helper).normalized();
  const Vec3d down = cross(forward, right);
  const double distance = 4 * radius;
  const Vec3d eye = target - distance * forward;
  Camera camera;
  camera.model = model;
  camera.width = camera.height = size_px;
  // The sphere fills 80 % of the picture, which leaves room for what grows over the silhouette.
  const double half = 0.8 * size_px / 2;
  camera.fx = camera.fy = model == CameraModel::kPerspective
                              ? half * std::sqrt(distance * distance - radius * radius) / radius
                              : half / radius;
  camera.cx = camera.cy = size_px / 2.0;
  const Vec3d rows[3] = {right, down, forward};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) camera.world_to_camera(r, c) = rows[r][c];
    camera.world_to_camera(r, 3) = -rows[r].dot(eye);
  }
  return camera;
}

std::vector<uint8_t> rasterise(const TriMesh& mesh, const Camera& camera) {
  const auto width = static_cast<int>(camera.width), height = static_cast<int>(camera.height);
  std::vector<uint8_t> mask(static_cast<size_t>(width) * static_cast<size_t>(height), 0);
  std::vector<Vec2d> projected(mesh.vertexCount());
  for (size_t i = 0; i < projected.size(); ++i) {
    const Vec4d world(static_cast<double>(mesh.positions[i * 3]),
                      static_cast<double>(mesh.positions[i * 3 + 1]),
                      static_cast<double>(mesh.positions[i * 3 + 2]), 1.0);
    const Vec4d p = camera.world_to_camera * world;
    const double scale = camera.model == CameraModel::kPerspective ? 1.0 / p.z() : 1.0;
    projected[i] = {camera.fx * p.x() * scale + camera.cx, camera.fy * p.y() * scale + camera.cy};
  }
  for (size_t t = 0; t < mesh.triangleCount(); ++t) {
    const Vec2d a = projected[mesh.triangles[t * 3]], b = projected[mesh.triangles[t * 3 + 1]],
                c = projected[mesh.triangles[t * 3 + 2]];
    const int x0 = std::max(0, static_cast<int>(std::floor(std::min({a.x(), b.x(), c.x()}) - 0.5)));
    const int x1 =
        std::min(width - 1, static_cast<int>(std::ceil(std::max({a.x(), b.x(), c.x()}))));
    const int y0 = std::max(0, static_cast<int>(std::floor(std::min({a.y(), b.y(), c.y()}) - 0.5)));
    const int y1 =
        std::min(height - 1, static_cast<int>(std::ceil(std::max({a.y(), b.y(), c.y()}))));
    const auto side = [](const Vec2d& p, const Vec2d& q, const Vec2d& r) {
      return (q.x() - p.x()) * (r.y() - p.y()) - (q.y() - p.y()) * (r.x() - p.x());
    };
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const Vec2d p(x + 0.5, y + 0.5);
        const double u = side(a, b, p), v = side(b, c, p), w = side(c, a, p);
        if ((u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0)) {
          mask[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)] = 1;
        }
      }
    }
  }
  return mask;
}

std::vector<double> distanceTo(const std::vector<uint8_t>& mask, uint8_t value, uint32_t width,
                               uint32_t height) {
  constexpr double kFar = 1e12;
  std::vector<double> squared(mask.size());
  for (size_t i = 0; i < mask.size(); ++i) squared[i] = mask[i] == value ? 0.0 : kFar;
  std::vector<double> line;
  for (size_t x = 0; x < width; ++x) {
    line.resize(height);
    for (size_t y = 0; y < height; ++y) line[y] = squared[y * width + x];
    transformLine(line);
    for (size_t y = 0; y < height; ++y) squared[y * width + x] = line[y];
  }
  for (size_t y = 0; y < height; ++y) {
    line.assign(squared.begin() + static_cast<std::ptrdiff_t>(y * width),
                squared.begin() + static_cast<std::ptrdiff_t>((y + 1) * width));
    transformLine(line);
    for (size_t x = 0; x < width; ++x) squared[y * width + x] = std::sqrt(line[x]);
  }
  return squared;
}

SilhouetteFit measureFit(const std::vector<uint8_t>& mask, std::span<const float> alpha,
                         uint32_t width, uint32_t height, double spacing_px) {
  const double unit = std::max(2.0, spacing_px);
  const std::vector<double> to_outside = distanceTo(mask, 0, width, height);
  const std::vector<double> to_inside = distanceTo(mask, 1, width, height);
  SilhouetteFit fit;
  size_t open_count = 0;
  double outside_sum = 0;
  for (size_t i = 0; i < mask.size(); ++i) {
    const auto value = static_cast<double>(alpha[i]);
    // The border runs half-way between the last pixel inside and the first outside.
    const double inside = to_outside[i] - 0.5, outside = to_inside[i] - 0.5;
    if (mask[i] == 1 && inside > unit) {
      ++fit.inside_count;
      fit.min_inside = std::min(fit.min_inside, value);
      if (value < 0.98) ++open_count;
    } else if (mask[i] == 0 && outside > unit && outside < 2 * unit) {
      ++fit.outside_count;
      outside_sum += value;
    } else if (mask[i] == 0 && outside > 3 * unit) {
      fit.max_beyond = std::max(fit.max_beyond, value);
    }
  }
  if (fit.inside_count > 0) {
    fit.open_share = static_cast<double>(open_count) / static_cast<double>(fit.inside_count);
  }
  if (fit.outside_count > 0) {
    fit.mean_outside = outside_sum / static_cast<double>(fit.outside_count);
  }
  return fit;
}

}  // namespace stipple::test
