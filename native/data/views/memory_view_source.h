#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "data/views/packed_picture.h"
#include "data/views/view_source.h"

namespace stipple {

/// What is known of the picture that a view has taken.
struct ViewFacts {
  std::string name = {};  ///< empty: "view" and its number
  double time = 0;        ///< seconds, finite
  ViewRole role = ViewRole::kNone;
  std::string camera_name = {};   ///< where the same camera took others at other times; else empty
  std::vector<bool> moving = {};  ///< [H,W] where something moves; empty: unknown
};

/// Views whose pictures are in memory: renders of a Blender scene, and whatever small. They are
/// kept packed, so that they come back as PackedPicture says. Copies share the pictures.
class MemoryViewSource final : public ViewSource {
 public:
  explicit MemoryViewSource(ColourSpace colour_space) : colour_space_(colour_space) {}

  /// Errors: kInvalidArgument, as validateView() and for a time that is not finite; nothing is added
  /// then.
  void add(const Camera& camera, const ViewPicture& picture, ViewFacts facts);
  void add(const Camera& camera, const ViewPicture& picture, std::string name = {},
           double time = 0) {
    add(camera, picture, ViewFacts{.name = std::move(name), .time = time});
  }
  /// In: positions and colours [N,3] and opacities [N], the other arrays of N or empty.
  /// Errors: kInvalidArgument for array sizes that disagree and values that are not finite.
  void setPoints(PointSet points);

  size_t count() const override { return views_.size(); }
  const Camera& camera(size_t view) const override { return at(view).camera; }
  std::string name(size_t view) const override { return at(view).facts.name; }
  ColourSpace colourSpace() const override { return colour_space_; }
  ViewRole role(size_t view) const override { return at(view).facts.role; }
  double time(size_t view) const override { return at(view).facts.time; }
  std::string cameraName(size_t view) const override { return at(view).facts.camera_name; }
  std::vector<bool> moving(size_t view) const override { return at(view).facts.moving; }
  ViewPicture load(size_t view) const override { return at(view).picture->unpacked(); }
  std::shared_ptr<const PackedPicture> packed(size_t view) const override {
    return at(view).picture;
  }
  const PointSet& points() const override { return points_; }

 private:
  struct View {
    Camera camera;
    std::shared_ptr<const PackedPicture> picture;
    ViewFacts facts;
  };

  const View& at(size_t view) const;

  ColourSpace colour_space_;
  std::vector<std::shared_ptr<const View>> views_;
  PointSet points_;
};

}  // namespace stipple
