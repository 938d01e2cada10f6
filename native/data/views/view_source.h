#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "data/meshes/point_set.h"
#include "math/camera.h"

namespace stipple {

/// What one camera has seen. Row 0 is the top. Arrays other than the colour are empty where nothing
/// is known.
struct ViewPicture {
  uint32_t width = 0;   ///< pixels; those of the camera
  uint32_t height = 0;  ///< pixels
  /// [H,W,3] premultiplied by alpha, in the space in which splats are composited
  /// (ViewSource::colourSpace): a target is colour + (1 - alpha) * background.
  std::vector<float> colour;
  std::vector<float> alpha;    ///< [H,W] 0..1; empty: 1 everywhere
  std::vector<float> weights;  ///< [H,W] >= 0, what a pixel counts in the loss (masks); empty: 1
  std::vector<float> depth;    ///< [H,W] planar z, metres, 0 where unknown
  std::vector<float> normals;  ///< [H,W,3] unit, world; 0 where unknown
};

class PackedPicture;

/// What a data set says a view is for.
enum class ViewRole : uint32_t { kNone = 0, kTrain = 1, kTest = 2, kValidation = 3 };

/// Views of one scene: photographs, or renders of a Blender scene. Pictures are loaded when they
/// are wanted, as ten thousand of them fit into no memory.
class ViewSource {
 public:
  virtual ~ViewSource() = default;

  virtual size_t count() const = 0;
  /// Of the pictures that load() gives: pinhole (distortion is taken out) or orthographic, of their
  /// size, in metres of the world.
  virtual const Camera& camera(size_t view) const = 0;
  /// Of the picture, for messages and for choosing held-out views by name.
  virtual std::string name(size_t view) const = 0;
  virtual ColourSpace colourSpace() const = 0;
  /// kNone where nothing is said.
  virtual ViewRole role(size_t) const { return ViewRole::kNone; }
  /// When the picture was taken, seconds; 0 where nothing moves.
  virtual double time(size_t) const { return 0; }
  /// Of the camera that took it, where the same camera took others at other times; else empty.
  virtual std::string cameraName(size_t) const { return {}; }

  /// [H,W], true where something moves in the picture, by whoever made it; empty where that is
  /// unknown.
  virtual std::vector<bool> moving(size_t) const { return {}; }

  /// May be called by several threads at once. Errors: kIo, kFormat (names the picture), and
  /// kInvalidArgument for numbers that are not finite.
  virtual ViewPicture load(size_t view) const = 0;

  /// The same in little room (packed_picture.h), for those who keep pictures; depth and normals may
  /// be missing. Sources that have pictures in memory give those. Errors: also those of
  /// validateView().
  virtual std::shared_ptr<const PackedPicture> packed(size_t view) const;

  /// What was wrong and could be gone past, a sentence each, for whoever uses the views.
  virtual std::vector<std::string> notes() const { return {}; }

  /// Where surfaces are known to be: points of a reconstruction or samples of meshes, in the
  /// cameras' world. Colours are scene linear. May be empty.
  virtual const PointSet& points() const = 0;
};

}  // namespace stipple
