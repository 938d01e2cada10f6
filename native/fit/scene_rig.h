#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "math/camera.h"
#include "math/vec.h"
#include "train/loop/view_rig.h"

namespace stipple {

struct SceneRigOptions {
  /// kAutomatic: inside where the viewer stands between walls, else around.
  ViewRig rig = ViewRig::kAutomatic;
  uint32_t count = 10;  ///< views, 1..4096
  uint32_t size = 400;  ///< pixels per side, 1..65536
  uint64_t seed = 0;    ///< other seeds give other views, spread as evenly
  double angle = 0;     ///< full, of both sides, radians, below pi; 0: 40 degrees around, 75 inside
  Vec3d lowest = Vec3d::Zero();  ///< of all that is to be seen, world, z up, metres
  Vec3d highest = Vec3d::Zero();
  std::optional<Vec3d> viewer = {};  ///< where the scene's own camera stands
};

/// A question to the scene: what does this ray meet first?
struct SceneRay {
  double origin[3];     ///< world, metres
  double direction[3];  ///< unit
  double farthest;      ///< metres from the origin; infinity: no limit
};

/// Answers to N rays.
struct SceneHits {
  std::span<const double> distances;  ///< [N] metres; infinity where nothing is met
  std::span<const double> normals;    ///< [N,3] of the faces, world, as they point
  std::span<const uint32_t> objects;  ///< [N] any numbers that tell things apart, from 0 on
  std::span<const double>
      object_sizes;  ///< [M,3] sides of their boxes along the world's axes, metres
};

/// Cameras that see a scene from everywhere: around things, or inside a room. Where they may stand
/// is asked of the scene, which others know: rays() are questions, answer() goes on until there are
/// none.
///
/// Around: nearly evenly spread on a sphere from which the whole is seen; nearer where something
/// stands between, and elsewhere on the sphere where a camera would be inside a mesh. Inside: at
/// free places between walls, looking everywhere.
class SceneRig {
 public:
  /// Errors: kInvalidArgument for options out of range.
  explicit SceneRig(const SceneRigOptions& options);

  /// What is to be asked now; none: the cameras are known.
  const std::vector<SceneRay>& rays() const { return rays_; }
  /// In: the answers to rays(), in their order. Errors: kInvalidArgument for another number of
  /// them and for objects without a size, and where no place is left for a camera.
  void answer(const SceneHits& hits);

  const std::vector<Camera>& cameras() const { return cameras_; }

 private:
  enum class Step { kChoose, kOutward, kEnclosed, kInside, kDone };

  void begin(ViewRig rig);
  void askOutward();
  void askInside();
  void ask(const Vec3d& origin, const Vec3d& direction, double farthest);
  void askAround(const Vec3d& place);
  void tellOutward(const SceneHits& hits);
  void tellEnclosed(const SceneHits& hits);
  void tellInside(const SceneHits& hits);
  void add(const Vec3d& place, const Vec3d& forward, double angle);
  Vec3d directionOf(uint32_t index, uint64_t seed) const;
  bool isFree(const SceneHits& hits, size_t first) const;

  SceneRigOptions options_;
  Vec3d centre_;
  double radius_;  ///< of the ball around the bounds
  Step step_ = Step::kDone;
  uint64_t attempt_ = 0;  ///< rounds on the sphere, or places that were tried inside
  std::vector<SceneRay> rays_;
  std::vector<Vec3d> places_;      ///< that are asked about
  std::vector<Vec3d> directions_;  ///< of them, from the middle
  std::vector<Camera> cameras_;
};

}  // namespace stipple
