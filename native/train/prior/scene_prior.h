#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/views/view_source.h"
#include "density/octree_density.h"

namespace stipple {

/// What is known of a scene before it is fitted: where it is and where its surfaces are.
struct ScenePrior {
  RootCube root;
  std::vector<float> positions;  ///< [N,3] metres, on surfaces; may be empty
  std::vector<float> weights;    ///< [N] >= 0, mean 1
  /// Cells of this level of the root are the smallest that the points tell of.
  int known_level = kMaxLeafLevel;
  /// The root holds everything around its inner half, too (decode/field/contraction.h); positions are
  /// those in the root. The shell has been sown along the rays of cameras.
  bool contracted = false;
};

/// Whether the root holds all space around the scene, too.
enum class ShellChoice : uint32_t {
  kAuto = 0,  ///< where surfaces are known and pictures are opaque
  kOn = 1,
  kOff = 2
};

struct ScenePriorOptions {
  size_t depth_points = 300000;  ///< at most, from the depth of views where they have it
  size_t depth_views = 64;       ///< at most, that are loaded for it
  ShellChoice shell = ShellChoice::kAuto;
  uint64_t seed = 0;
};

/// Points of the source, and places that the views' depth shows. The root cube holds the points
/// that at least two cameras see, without the farthest 1 % on either side of each axis where those
/// reach far out, and a tenth more. Without points or depth: points of the visual hull, where
/// pictures have alpha; places that other pictures tell of for certain (swept_points.h), unless
/// they have a blank backdrop; else none, and the root is around the ball that the cameras have in
/// common.
/// With a shell the root is contracted: its inner half is what it would be. Auto has one where
/// points are known and pictures have no alpha. It begins right behind the walls where depth ends
/// inside the root in all but a twentieth of the pixels; else it reaches far out.
/// In: training: views of the source, at least one. Errors: those of ViewSource::load; kCancelled.
ScenePrior scenePrior(const ViewSource& views, std::span<const size_t> training,
                      const ScenePriorOptions& options, Progress* progress = nullptr);

}  // namespace stipple
