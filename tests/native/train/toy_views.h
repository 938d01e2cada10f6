#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "base/random.h"
#include "data/views/memory_view_source.h"
#include "splat/render/render.h"

namespace stipple {

/// A ball of small flat splats, coloured in waves: a scene that a fit can learn in seconds.
inline SplatCloud toyBall(size_t count, float radius = 1.0f) {
  SplatCloud cloud;
  cloud.antialias = Antialias::kMip;
  cloud.resize(count);
  const float golden = 2.3999632f;
  for (size_t i = 0; i < count; ++i) {
    const float z = 1.0f - 2.0f * (static_cast<float>(i) + 0.5f) / static_cast<float>(count);
    const float r = std::sqrt(1.0f - z * z);
    const float angle = golden * static_cast<float>(i);
    const float n[3] = {r * std::cos(angle), r * std::sin(angle), z};
    for (size_t a = 0; a < 3; ++a) cloud.positions[i * 3 + a] = radius * n[a];
    // From z to the normal.
    const float q[4] = {1.0f + n[2], -n[1], n[0], 0.0f};
    const float length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    for (size_t a = 0; a < 4; ++a) {
      cloud.rotations[i * 4 + a] = length > 1e-3f ? q[a] / length : (a == 1 ? 1.0f : 0.0f);
    }
    const float size = 1.2f * radius / std::sqrt(static_cast<float>(count));
    cloud.scales[i * 3] = cloud.scales[i * 3 + 1] = size;
    cloud.scales[i * 3 + 2] = 0.1f * size;
    cloud.opacities[i] = 0.95f;
    cloud.sh[i * 3] = std::sin(4.0f * n[0]) + 0.5f * n[2];
    cloud.sh[i * 3 + 1] = std::sin(5.0f * n[1]);
    cloud.sh[i * 3 + 2] = n[2] > 0.3f ? 1.0f : -1.0f;
  }
  return cloud;
}

/// In: view and count: places on a spiral around the origin, looking at it.
inline Camera toyCamera(size_t view, size_t count, uint32_t size, double distance = 3.5) {
  const double z = 1 - 2 * (static_cast<double>(view) + 0.5) / static_cast<double>(count);
  const double angle = 2.39996 * static_cast<double>(view);
  const double r = std::sqrt(1 - z * z);
  const Vec3d place = distance * Vec3d(r * std::cos(angle), r * std::sin(angle), z);
  const Vec3d forward = -place.normalized();
  const Vec3d across(-std::sin(angle), std::cos(angle), 0);
  const Vec3d down(forward.y() * across.z() - forward.z() * across.y(),
                   forward.z() * across.x() - forward.x() * across.z(),
                   forward.x() * across.y() - forward.y() * across.x());
  Camera camera;
  camera.width = camera.height = size;
  camera.fx = camera.fy = 1.4 * size;
  camera.cx = camera.cy = 0.5 * size;
  camera.world_to_camera.block<1, 3>(0, 0) = across.transpose();
  camera.world_to_camera.block<1, 3>(1, 0) = down.transpose();
  camera.world_to_camera.block<1, 3>(2, 0) = forward.transpose();
  camera.world_to_camera(0, 3) = -across.dot(place);
  camera.world_to_camera(1, 3) = -down.dot(place);
  camera.world_to_camera(2, 3) = -forward.dot(place);
  return camera;
}

inline PointSet toyPoints(const SplatCloud& cloud) {
  PointSet points;
  points.positions = cloud.positions;
  points.normals.assign(cloud.size() * 3, 0.0f);
  for (size_t i = 0; i < cloud.size(); ++i) points.normals[i * 3 + 2] = 1.0f;
  points.colours.assign(cloud.size() * 3, 0.5f);
  points.opacities.assign(cloud.size(), 1.0f);
  points.areas.assign(cloud.size(), 1e-3f);
  points.weights.assign(cloud.size(), 1.0f);
  return points;
}

/// Views of a cloud with their alpha, and its centres as points.
inline std::shared_ptr<MemoryViewSource> toyViews(const SplatCloud& cloud, size_t count,
                                                  uint32_t size, bool with_points = true) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  const SplatInstance instance{&cloud};
  for (size_t v = 0; v < count; ++v) {
    const Camera camera = toyCamera(v, count, size);
    const RenderResult drawn = renderTiled({&instance, 1}, camera, {});
    ViewPicture picture;
    picture.width = picture.height = size;
    for (size_t i = 0; i < drawn.colour.size(); i += 4) {
      for (size_t c = 0; c < 3; ++c) picture.colour.push_back(drawn.colour[i + c]);
      picture.alpha.push_back(std::min(1.0f, drawn.colour[i + 3]));
    }
    views->add(camera, std::move(picture));
  }
  if (with_points) views->setPoints(toyPoints(cloud));
  return views;
}

}  // namespace stipple
