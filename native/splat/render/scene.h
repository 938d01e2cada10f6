#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "math/colour.h"
#include "math/spherical_harmonics.h"
#include "splat/render/projection.h"
#include "splat/render/render.h"

namespace stipple {

/// An instance made ready for one camera.
struct PlacedCloud {
  const SplatCloud* cloud;
  Mat3d linear;       ///< object to view
  Vec3d translation;  ///< object to view, metres
  /// The camera's centre in object space. Orthographic: the viewing direction there.
  Vec3d eye;
  size_t instance;       ///< of the caller's list
  bool is_checked;       ///< SplatInstance::values_are_checked
  uint64_t first_index;  ///< of its splat 0 among all splats of the picture
  LowPass low_pass;      ///< never kFromCloud
  int sh_degree;
  bool linearise;      ///< colours are stored for display and composited scene linear
  bool grades_colour;  ///< grade has more than an opacity
  bool is_holdout;     ///< its splats have the colour kHoldoutColour
  ColourGrade grade;

  /// Opacity of a splat as it is drawn.
  double opacity(size_t index) const {
    return static_cast<double>(cloud->opacities[index]) * grade.opacity;
  }
};

/// Everything of a picture that does not depend on the pixel. Geometry is double in both renderers:
/// then both decide alike which splats show, in which order and where they end, and only sums
/// differ.
struct PlacedScene {
  View<double> view;
  Mat3d view_to_world;  ///< a rotation
  std::vector<PlacedCloud> clouds;
  uint64_t splat_count = 0;
  bool has_holdouts = false;
  bool objects_apart = false;       ///< instances are drawn one after the other
  std::vector<size_t> drawn_order;  ///< then: indices into clouds, the nearest first
};

/// All three numbers of the colour of a splat that shows nothing: no colour is below 0.
constexpr double kHoldoutColour = -1;

/// Checks everything that enters (camera, clouds, matrices, options) and places the instances.
/// Errors: kInvalidArgument; kUnsupported for clouds of different colour spaces under
/// BlendSpace::kAsTrained.
PlacedScene placeScene(std::span<const SplatInstance> instances, const Camera& camera,
                       const RenderOptions& options);

/// The same, for panoramas and fisheyes too, which placeScene refuses: nobody but who follows rays
/// can draw them.
PlacedScene placeSceneForRays(std::span<const SplatInstance> instances, const Camera& camera,
                              const RenderOptions& options);

/// The same into memory that may have held a scene, except that the splats' values are not read:
/// whoever reads them first must hold each row to rowsAreValid, and call refuseCloud where one is
/// not.
void placeSceneUnread(std::span<const SplatInstance> instances, const Camera& camera,
                      const RenderOptions& options, PlacedScene& scene);

/// Throws what placeScene would have thrown of this cloud.
[[noreturn]] void refuseCloud(const PlacedCloud& placed);

/// Index into scene.clouds of the instance that owns the splat.
size_t cloudOfSplat(const PlacedScene& scene, uint64_t splat);

/// Projects splat `index` of its cloud.
inline bool projectSplat(const PlacedScene& scene, const PlacedCloud& placed, size_t index,
                         Projected<double>& out) {
  const SplatCloud& cloud = *placed.cloud;
  return project(scene.view, placed.linear, placed.translation, &cloud.positions[index * 3],
                 &cloud.rotations[index * 4], &cloud.scales[index * 3], placed.opacity(index),
                 placed.low_pass, out);
}

/// From the sums of the harmonics + 0.5 to the colour that is blended, or kHoldoutColour. In and
/// out: colour [3].
template <typename T>
void finishColour(const PlacedCloud& placed, T* colour) {
  if (placed.is_holdout) {
    std::fill(colour, colour + 3, T(kHoldoutColour));
    return;
  }
  if (placed.grades_colour) {
    // So that no product of a harmonic sum and the matrix leaves float32.
    for (size_t c = 0; c < 3; ++c) colour[c] = std::clamp(colour[c], T(-1e12), T(1e12));
    applyGrade(placed.grade, colour);
  }
  for (size_t c = 0; c < 3; ++c) {
    const T held = std::clamp(colour[c], T(0), T(1e12));
    colour[c] = placed.linearise ? srgbToLinear(held) : held;
  }
}

/// Colour of a splat in the blending space: harmonics in the viewing direction, brought into object
/// space, + 0.5, graded, held to 0..1e12 (above, the linearised colour could leave float32). Out:
/// colour [3].
template <typename T>
void splatColour(const PlacedScene& scene, const PlacedCloud& placed, size_t index, T* colour) {
  const SplatCloud& cloud = *placed.cloud;
  const float* sh = &cloud.sh[index * cloud.shStride()];
  T basis[25];
  basis[0] = T(kShC0);
  if (placed.sh_degree > 0) {
    double direction[3];
    for (int axis = 0; axis < 3; ++axis) {
      const double eye = placed.eye[axis];
      const size_t at = index * 3 + static_cast<size_t>(axis);
      direction[axis] =
          scene.view.perspective ? static_cast<double>(cloud.positions[at]) - eye : eye;
    }
    // A splat within near..far is never at the camera's centre, so the length is not zero.
    const double inverse =
        1.0 / std::sqrt(direction[0] * direction[0] + direction[1] * direction[1] +
                        direction[2] * direction[2]);
    harmonicBasis(placed.sh_degree, T(direction[0] * inverse), T(direction[1] * inverse),
                  T(direction[2] * inverse), basis);
  }
  const size_t count = shCoefficientCount(placed.sh_degree);
  for (size_t c = 0; c < 3; ++c) {
    T sum = T(0.5);
    for (size_t k = 0; k < count; ++k) sum += basis[k] * T(sh[k * 3 + c]);
    colour[c] = sum;
  }
  finishColour(placed, colour);
}

/// Sorting key of a depth: unsigned order = order of the depth rounded to float32. Both renderers
/// sort by it, ties by splat index, so rounding cannot reorder splats between them.
uint32_t depthKey(double depth);

}  // namespace stipple
