#pragma once

#include <memory>
#include <string>
#include <vector>

#include "data/views/packed_picture.h"
#include "data/views/view_source.h"

namespace stipple {

/// Views whose pictures are in memory: renders of a Blender scene, and whatever small. They are
/// kept packed, so that they come back as PackedPicture says. Copies share the pictures.
class MemoryViewSource final : public ViewSource {
 public:
  explicit MemoryViewSource(ColourSpace colour_space) : colour_space_(colour_space) {}

  /// Errors: kInvalidArgument, as validateView(); nothing is added then. In: name, empty for
  /// "view" and its number; time, seconds, finite; role, what the view is for.
  void add(const Camera& camera, const ViewPicture& picture, std::string name = {}, double time = 0,
           ViewRole role = ViewRole::kNone);
  /// In: positions and colours [N,3] and opacities [N], the other arrays of N or empty.
  /// Errors: kInvalidArgument for array sizes that disagree and values that are not finite.
  void setPoints(PointSet points);

  size_t count() const override { return views_.size(); }
  const Camera& camera(size_t view) const override { return at(view).camera; }
  std::string name(size_t view) const override { return at(view).name; }
  ColourSpace colourSpace() const override { return colour_space_; }
  ViewRole role(size_t view) const override { return at(view).role; }
  double time(size_t view) const override { return at(view).time; }
  ViewPicture load(size_t view) const override { return at(view).picture->unpacked(); }
  std::shared_ptr<const PackedPicture> packed(size_t view) const override {
    return at(view).picture;
  }
  const PointSet& points() const override { return points_; }

 private:
  struct View {
    Camera camera;
    std::shared_ptr<const PackedPicture> picture;
    std::string name;
    double time = 0;
    ViewRole role = ViewRole::kNone;
  };

  const View& at(size_t view) const;

  ColourSpace colour_space_;
  std::vector<std::shared_ptr<const View>> views_;
  PointSet points_;
};

}  // namespace stipple
