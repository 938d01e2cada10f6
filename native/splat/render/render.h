#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/clouds/colour_grade.h"
#include "data/clouds/splat_cloud.h"
#include "math/camera_rays.h"
#include "math/empty_depth.h"
#include "math/vec.h"

namespace stipple {

/// One placed cloud. Many instances are sorted and blended together.
struct SplatInstance {
  const SplatCloud* cloud = nullptr;
  Mat4d object_to_world = Mat4d::Identity();  ///< invertible, affine (scale and shear allowed)
  /// True: rowsAreValid() has accepted all of the cloud and nothing has written to it since; the
  /// renderer then does not read its values a second time to check them.
  bool values_are_checked = false;
  ColourGrade grade = {};  ///< of what the cloud stores; neutral costs nothing
  bool holdout = false;  ///< hides what is behind it and shows nothing, in colour, alpha and depth
};

enum class LowPass : uint32_t {
  kFromCloud = 0,  ///< the flag of each cloud
  kClassic = 1,    ///< +0.3 px^2 on the diagonal of the projected covariance
  kMip = 2,        ///< +0.1 px^2 with opacity compensation
  kNone = 3,
};

enum class BlendSpace : uint32_t {
  kAsTrained = 0,    ///< composite the colours as stored (display space for trained splats)
  kSceneLinear = 1,  ///< linearise each display-space splat colour, then composite
};

enum class ObjectOrder : uint32_t {
  kTogether = 0,  ///< the splats of all instances by depth
  /// Each instance as a whole, its own splats by depth: see splat/render/object_order.h. Not with a
  /// surface, and not along rays by response.
  kApart = 1,
};

/// What something else drew, to stand at its depth between the splats: see splat/render/blend.h.
/// The order is that of the splats' centres, as among the splats themselves, so a splat is before
/// or behind as a whole. Row 0 is the top; the arrays are the caller's.
struct SurfaceLayer {
  uint32_t width = 0;  ///< pixels; those of the camera
  uint32_t height = 0;
  /// [H,W] planar z, metres; kEmptyDepth and more: behind everything. Null: no layer.
  const float* depth = nullptr;
  /// [H,W,4] premultiplied, alpha 0..1, in the blending space (see RenderOptions::splats_apart).
  /// Null: a matte, which hides what is behind it and leaves a hole.
  const float* colour = nullptr;
  /// [H,W] 0..1, of a matte where it covers pixels in part; null: 1. With a colour: how much of
  /// what is behind it the layer hides, no less than its alpha; null: its alpha.
  const float* matte_opacity = nullptr;
};

/// Settings that change the picture; both the tiled and the reference renderer follow them.
struct RenderOptions {
  LowPass low_pass = LowPass::kFromCloud;
  BlendSpace blend_space = BlendSpace::kAsTrained;
  ObjectOrder object_order = ObjectOrder::kTogether;
  int sh_degree_limit = kMaxShDegree;  ///< harmonics above this degree are left out
  double background[3] = {0, 0, 0};  ///< in the blending space; used under the final transmittance
  double least_alpha = 1.0 / 255.0;  ///< fainter splats are skipped at a pixel; above 0, below 1
  bool with_background = false;      ///< true: background is composited and alpha becomes 1
  bool with_depth = true;
  bool with_median_depth = false;
  bool with_counts = false;  ///< also the number of splats blended per pixel
  bool with_transmittance = false;
  bool with_normal = false;
  bool with_objects = false;
  /// Of a panorama or fisheye, where rays start across each of them; colours stay those that splats
  /// show to the middle of the lens.
  LensPoint lens = {};
  SurfaceLayer surface = {};
  /// True: the colour is left without the surface's, and surface_weight tells what that counts for:
  /// for who changes the splats' colours before addSurface. Depth has the surface all the same.
  bool splats_apart = false;
};

/// Row 0 is the top of the picture.
struct RenderResult {
  uint32_t width = 0;
  uint32_t height = 0;
  std::vector<float> colour;          ///< [H,W,4] premultiplied RGBA in the blending space
  std::vector<float> depth;           ///< [H,W] expected planar z: sum(w z)/sum(w), metres
  std::vector<float> median_depth;    ///< [H,W] planar z where transmittance passes 1/2, metres
  std::vector<uint32_t> counts;       ///< [H,W]
  std::vector<float> surface_weight;  ///< [H,W] transmittance before the surface; if splats_apart
  std::vector<float> transmittance;   ///< [H,W] of all, holdouts and surface too
  /// [H,W,3] of the splats that show: mean, in the world, of their shortest axes as far as they
  /// turn to the camera, by weight, made unit again; 0 where none shows.
  std::vector<float> normal;
  /// [H,W] 1 + the instance whose splats weigh most together, the first of equals; 0 where nothing
  /// shows and where the surface weighs as much.
  std::vector<uint32_t> objects;
  uint64_t visible_count = 0;  ///< splats that passed culling
  uint64_t number = 0;         ///< of this drawing, another for every call; 0: none
};

/// Tiled CPU renderer: culling, one depth sort, tiles in parallel.
/// Same bits for any number of threads. Errors: kInvalidArgument for a camera or cloud that
/// validate() refuses, a singular matrix.
RenderResult renderTiled(std::span<const SplatInstance> instances, const Camera& camera,
                         const RenderOptions& options, Progress* progress = nullptr);

/// Memory of renderTiled that the next picture uses again: a second picture of the same size
/// allocates nothing. One picture at a time.
class RenderWorkspace {
 public:
  RenderWorkspace();
  ~RenderWorkspace();
  RenderWorkspace(RenderWorkspace&&) noexcept;
  RenderWorkspace& operator=(RenderWorkspace&&) noexcept;

  uint64_t bytes() const;  ///< held now

  /// Whether pictures drawn from now on leave behind what renderBackward needs to go on from them:
  /// at most 12 bytes per pixel of whole tiles more. Off at first.
  void keepForBackward(bool keep);

  struct Arrays;
  Arrays& arrays() { return *arrays_; }

 private:
  std::unique_ptr<Arrays> arrays_;
};

/// Which splats passed culling in the picture that was drawn last into a workspace: those in view
/// that are not too faint or too near. Out: flags [splats of all clouds] 0 or 1.
void visibleFlags(RenderWorkspace& drawn, std::vector<uint8_t>& flags);

/// Sum of alpha that each splat in view would have over the pixels of that picture with nothing in
/// front: the integral of its projected Gaussian, clamps left out; the picture's borders cut
/// nothing off. Out: weights [splats of all clouds]; 0 for the others.
void unhiddenWeights(RenderWorkspace& drawn, std::vector<float>& weights);

/// renderTiled into a result and a workspace that may have served before.
void renderTiled(std::span<const SplatInstance> instances, const Camera& camera,
                 const RenderOptions& options, RenderWorkspace& workspace, RenderResult& result,
                 Progress* progress = nullptr);

/// Upper bounds of the bytes that renderTiled allocates, by what they grow with.
struct RenderMemory {
  uint64_t splat_bytes = 0;   ///< at most 112 per splat, and 11 MiB; 16 more for all passes
  uint64_t pixel_bytes = 0;   ///< at most 64 per pixel: counters of the tiles, what is kept
  uint64_t pair_bytes = 0;    ///< 4 per pair of splat and tile, at most 136 MB or 4 per splat
  uint64_t result_bytes = 0;  ///< the picture itself
  uint64_t other_bytes = 0;   ///< instances

  uint64_t sum() const {
    return splat_bytes + pixel_bytes + pair_bytes + result_bytes + other_bytes;
  }
};
/// In: keeps_for_backward, whether the workspace keeps pictures (RenderWorkspace::keepForBackward).
/// Errors: kInvalidArgument for a camera that validate() refuses.
RenderMemory renderMemory(std::span<const SplatInstance> instances, const Camera& camera,
                          const RenderOptions& options, bool keeps_for_backward = false);

/// Their sum: upper bound of the bytes that renderTiled allocates, its result included.
uint64_t renderMemoryBound(std::span<const SplatInstance> instances, const Camera& camera,
                           const RenderOptions& options);

/// The definition of correct for the same settings: double precision, no tiles, no SIMD.
/// Cost: O(pixels * splats); for tests and small pictures.
struct ReferenceResult {
  uint32_t width = 0;
  uint32_t height = 0;
  std::vector<double> colour;          ///< [H,W,4]
  std::vector<double> depth;           ///< [H,W]
  std::vector<double> median_depth;    ///< [H,W]
  std::vector<uint32_t> counts;        ///< [H,W]
  std::vector<double> surface_weight;  ///< [H,W]
  std::vector<double> transmittance;   ///< [H,W]
  std::vector<double> normal;          ///< [H,W,3]
  std::vector<uint32_t> objects;       ///< [H,W]
};
ReferenceResult renderReference(std::span<const SplatInstance> instances, const Camera& camera,
                                const RenderOptions& options, Progress* progress = nullptr);

}  // namespace stipple
