#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "data/views/memory_view_source.h"
#include "math/cross_product.h"
#include "mesh/adapt/harmonic_light.h"
#include "mesh/adapt/mesh_renderer.h"

namespace stipple {

/// A camera at a place that looks at the origin.
inline Camera lookingFrom(const Vec3d& place, uint32_t size) {
  const Vec3d forward = -place.normalized();
  const Vec3d aside = std::abs(forward.z()) > 0.9 ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1);
  const Vec3d right = crossProduct(forward, aside).normalized();
  const Vec3d down = crossProduct(forward, right);
  Camera camera;
  camera.width = camera.height = size;
  camera.fx = camera.fy = size;
  camera.cx = camera.cy = 0.5 * size;
  const Vec3d axes[3] = {right, down, forward};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      camera.world_to_camera(row, column) = axes[row][column];
    camera.world_to_camera(row, 3) = -axes[row].dot(place);
  }
  return camera;
}

/// Images of a shape around the origin in some light, from directions spread over a sphere.
inline MemoryViewSource imagesOf(const std::vector<Vec3d>& positions,
                                 const std::vector<uint32_t>& triangles, size_t count,
                                 uint32_t size, bool has_alpha = true) {
  const MeshLinks links(positions.size(), triangles);
  HarmonicLight light;
  light.colours.row(0) << 0.5, 0.45, 0.4;
  light.colours.row(2) << 0.3, 0.3, 0.3;
  light.colours.row(3) << 0.1, -0.1, 0.05;
  light.colours.row(8) << 0.05, 0.1, 0.0;
  std::vector<Vec3d> colours;
  for (const Vec3d& normal : vertexNormals(links, positions)) colours.push_back(light.on(normal));
  const MeshRenderer renderer(triangles);
  double radius = 0;
  for (const Vec3d& p : positions) radius = std::max(radius, p.norm());
  MemoryViewSource views(ColourSpace::kLinear);
  for (size_t i = 0; i < count; ++i) {
    const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double turn = 2.4 * static_cast<double>(i), around = std::sqrt(1 - z * z);
    const Camera camera = lookingFrom(
        3.5 * radius * Vec3d(around * std::cos(turn), around * std::sin(turn), z), size);
    const MeshView view = renderer.draw(camera, positions, colours);
    ViewPicture picture;
    picture.width = picture.height = size;
    for (size_t pixel = 0; pixel < size_t{size} * size; ++pixel) {
      for (size_t c = 0; c < 3; ++c) {
        picture.colour.push_back(static_cast<float>(std::max(view.pixels[pixel * 4 + c], 0.0)));
      }
      if (has_alpha) picture.alpha.push_back(static_cast<float>(view.pixels[pixel * 4 + 3]));
    }
    views.add(camera, picture);
  }
  return views;
}

}  // namespace stipple
