#pragma once

#include <memory>
#include <string>
#include <vector>

#include "data/latent.h"
#include "data/views/view_source.h"

namespace stipple {

/// Side of the cube around the origin that a normalised object fits into, in that of the networks,
/// whose side is 1: a little is left, since points of a surface do not reach its ends.
constexpr double kNormalisedSide = 0.95;

/// Where the networks' cube lies around points that shall fill kNormalisedSide of it.
/// Errors: kInvalidArgument where they have no extent.
LatentPlacement placementAround(const PointSet& points);
/// The points in the cube around the origin.
PointSet normalised(PointSet points, const LatentPlacement& placement);

/// Views of one object, moved and scaled so that its points fill the networks' cube around the
/// origin. The images stay what they are.
class NormalisedViews final : public ViewSource {
 public:
  /// Errors: kInvalidArgument where the points have no extent, or a camera has no image plane.
  explicit NormalisedViews(std::shared_ptr<const ViewSource> views);

  /// From the networks' cube back to where the object was.
  const LatentPlacement& placement() const { return placement_; }

  size_t count() const override { return views_->count(); }
  const Camera& camera(size_t view) const override { return cameras_[view]; }
  std::string name(size_t view) const override { return views_->name(view); }
  ColourSpace colourSpace() const override { return views_->colourSpace(); }
  ViewRole role(size_t view) const override { return views_->role(view); }
  /// Depths stay those of the source.
  ViewPicture load(size_t view) const override { return views_->load(view); }
  std::shared_ptr<const PackedPicture> packed(size_t view) const override {
    return views_->packed(view);
  }
  std::vector<std::string> notes() const override { return views_->notes(); }
  const PointSet& points() const override { return points_; }

 private:
  std::shared_ptr<const ViewSource> views_;
  LatentPlacement placement_;
  std::vector<Camera> cameras_;
  PointSet points_;
};

}  // namespace stipple
