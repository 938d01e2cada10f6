#include "bench/splat_views.h"

#include <algorithm>
#include <utility>

#include "data/views/memory_view_source.h"
#include "splat/render/render.h"

namespace stipple::bench {

std::shared_ptr<const ViewSource> viewsOf(const SplatCase& c, size_t count) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  const SplatCloud& cloud = cloudOf(c);
  const SplatInstance instance{&cloud};
  for (size_t v = 0; v < count; ++v) {
    Camera camera = cameraOf(c);
    camera.world_to_camera(0, 3) += 0.01 * static_cast<double>(v);
    const RenderResult drawn = renderTiled({&instance, 1}, camera, {});
    ViewPicture picture;
    picture.width = c.width;
    picture.height = c.height;
    for (size_t i = 0; i < drawn.colour.size(); i += 4) {
      for (size_t k = 0; k < 3; ++k) {
        picture.colour.push_back(std::clamp(drawn.colour[i + k], 0.0f, 1.0f));
      }
      picture.alpha.push_back(drawn.colour[i + 3]);
    }
    views->add(camera, std::move(picture));
  }
  PointSet points;
  points.positions = cloud.positions;
  points.colours.assign(cloud.size() * 3, 0.5f);
  points.opacities.assign(cloud.size(), 1.0f);
  views->setPoints(std::move(points));
  return views;
}

}  // namespace stipple::bench
