#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "data/views/memory_view_source.h"
#include "train/fit_scene.h"
#include "train/prior/shared_volume.h"

// A scene that has a formula, without points and depth.

namespace stipple::testing {

/// Colours in waves of about 0.5 m.
inline Vec3d pattern(const Vec3d& p) {
  return {0.5 + 0.4 * std::sin(7 * p.x() + 3 * p.z()), 0.5 + 0.4 * std::sin(8 * p.y() - 2 * p.x()),
          0.5 + 0.4 * std::sin(9 * p.z() + 4 * p.y())};
}

/// Nearest crossing of a ray with a sphere around the origin, from outside or inside; 0: none.
inline double crossing(const Vec3d& from, const Vec3d& along, double radius) {
  const double b = from.dot(along);
  const double under = b * b - from.squaredNorm() + radius * radius;
  if (under < 0) return 0;
  const double near = -b - std::sqrt(under), far = -b + std::sqrt(under);
  return near > 0 ? near : std::max(far, 0.0);
}

enum class Behind { kNothing, kBlank, kPattern };
constexpr double kBackdrop = 12;  ///< metres

/// Square pictures of a patterned sphere of radius 1, drawn by its formula, in front of nothing
/// (with alpha) or of a sphere around everything.
inline std::shared_ptr<MemoryViewSource> sphereViews(const std::vector<Camera>& cameras,
                                                     Behind behind) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (const Camera& camera : cameras) {
    const uint32_t size = camera.width;
    ViewPicture picture;
    picture.width = picture.height = size;
    for (uint32_t y = 0; y < size; ++y) {
      for (uint32_t x = 0; x < size; ++x) {
        const Vec3d from = placeOf(camera);
        const Vec3d along = (unproject(camera, x + 0.5, y + 0.5, 1) - from).normalized();
        const double at = crossing(from, along, 1);
        Vec3d colour = Vec3d::Zero();
        if (at > 0) {
          colour = pattern(from + at * along);
        } else if (behind == Behind::kBlank) {
          colour = Vec3d(0.4, 0.5, 0.6);
        } else if (behind == Behind::kPattern) {
          colour = pattern((from + crossing(from, along, kBackdrop) * along) / kBackdrop * 3);
        }
        for (int c = 0; c < 3; ++c) picture.colour.push_back(static_cast<float>(colour[c]));
        if (behind == Behind::kNothing) picture.alpha.push_back(at > 0 ? 1.0f : 0.0f);
      }
    }
    views->add(camera, std::move(picture));
  }
  return views;
}

}  // namespace stipple::testing
