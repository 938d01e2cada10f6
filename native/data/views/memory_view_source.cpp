#include "data/views/memory_view_source.h"

#include <utility>

#include "base/error.h"
#include "data/views/view_check.h"

namespace stipple {

void MemoryViewSource::add(const Camera& camera, const ViewPicture& picture, ViewFacts facts) {
  if (facts.name.empty()) facts.name = "view " + std::to_string(views_.size());
  validateView(camera, picture, facts.name);
  requireFinite(facts.time, (facts.name + ": time").c_str());
  auto packed = std::make_shared<const PackedPicture>(picture);
  views_.push_back(
      std::make_shared<const View>(View{camera, std::move(packed), std::move(facts)}));
}

void MemoryViewSource::setPoints(PointSet points) {
  validatePoints(points, "points");
  points_ = std::move(points);
}

const MemoryViewSource::View& MemoryViewSource::at(size_t view) const {
  if (view >= views_.size()) {
    fail(ErrorCode::kInvalidArgument, "view " + std::to_string(view) +
                                          " was asked for; there are " +
                                          std::to_string(views_.size()) + " views, counted from 0");
  }
  return *views_[view];
}

}  // namespace stipple
