#include "data/views/view_source.h"

#include "data/views/packed_picture.h"
#include "data/views/view_check.h"

namespace stipple {

std::shared_ptr<const PackedPicture> ViewSource::packed(size_t view) const {
  ViewPicture picture = load(view);
  validateView(camera(view), picture, name(view));
  picture.depth.clear();
  picture.normals.clear();
  return std::make_shared<const PackedPicture>(picture);
}

}  // namespace stipple
