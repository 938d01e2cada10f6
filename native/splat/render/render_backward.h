#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/progress.h"
#include "splat/render/render.h"

namespace stipple {

/// What the backward pass gets: the derivative of a scalar loss by the picture, and what the
/// statistics need. All arrays are pictures of the camera's size, row 0 on top; empty where not
/// used. Values must be finite and at most 1e4 in size.
struct BackwardInput {
  /// [H,W,4] dL/d(premultiplied R, G, B, alpha) of RenderResult::colour. With a background the
  /// alpha of the picture is constant, so its derivative counts for nothing. Empty: blending
  /// weights are all that is wanted, and every array of derivatives stays empty.
  std::span<const float> colour_gradient;
  /// dL/d(coverage) of every pixel, coverage being 1 minus the transmittance behind its last splat:
  /// beside the derivative by alpha, and also where a background makes alpha constant.
  double coverage_gradient = 0;
  /// [H,W,3] picture minus target in the blending space, before any clamp. Not empty: leave-one-out
  /// contributions are wanted.
  std::span<const float> residual;
  /// [H,W] weight of each pixel in the contributions, >= 0; empty: 1.
  std::span<const float> residual_weights;
  /// [H,W] Not empty: edge-weighted blending weights are wanted.
  std::span<const float> edge_weights;
  /// [H,W] >= 0. Not empty: error contributions are wanted.
  std::span<const float> errors;
  bool with_blending_weights = false;
  bool with_screen_gradients = false;  ///< signed ones: they cost next to nothing
  /// Absolute screen gradients and lengths, whose sums over pixels each pixel has to add to.
  bool with_absolute_screen_gradients = false;
  /// What the pixels that show a splat are, each counting alike: covered pixels and distances, and
  /// covered errors where there are errors.
  bool with_covered = false;
  /// [H,W] dL/d(expected depth), per metre, of RenderResult::depth. Empty: the loss does not depend
  /// on it. Where nothing covers a pixel it counts for nothing. The median depth is that of one
  /// splat, chosen by a threshold: a step function of everything else, so it has no derivative
  /// here.
  std::span<const float> depth_gradient;
};

/// Derivatives by one cloud's stored values, in the frame of the object. Splats that do not show
/// have zeros. An array that was not wanted is empty.
struct SplatGradients {
  std::vector<float> positions;  ///< [N,3]
  std::vector<float> rotations;  ///< [N,4] by the stored quaternion, through its normalisation
  std::vector<float> scales;     ///< [N,3]
  std::vector<float> opacities;  ///< [N]
  std::vector<float> sh;         ///< [N,(degree+1)^2,3]
  /// [N] sum over pixels and channels of w (|R| - |R - dC|), dC = picture minus the picture without
  /// the splat. Negative: the splat lowers the L1 error.
  std::vector<float> contributions;
  std::vector<float> blending_weights;  ///< [N] sum of T alpha
  std::vector<float> edge_weights;      ///< [N] sum of edge weight times T alpha
  /// [N,2] dL/d(projected centre), per pixel: multiply by half the picture's sides for the unit in
  /// which thresholds of densification are usually given.
  std::vector<float> screen_gradients;
  std::vector<float> absolute_screen_gradients;  ///< [N,2] sum over pixels of |.| per axis
  std::vector<float> screen_gradient_norms;      ///< [N] sum over pixels of the length
  std::vector<float> errors;                     ///< [N] sum of error times T alpha
  std::vector<float> largest_errors;             ///< [N] largest error times T alpha of one pixel
  std::vector<float> covered_pixels;             ///< [N] that show the splat
  std::vector<float> covered_errors;             ///< [N] sum of their errors, without weights
  std::vector<float> covered_distances;          ///< [N] sum of theirs from its centre, pixels
};

/// Every array of SplatGradients.
struct GradientArray {
  const char* name;
  std::vector<float> SplatGradients::*values;
  size_t per_splat;   ///< values; 0: SplatCloud::shStride()
  bool is_statistic;  ///< on request; else a derivative by the cloud's array of the same name
};
inline constexpr GradientArray kGradientArrays[] = {
    {"positions", &SplatGradients::positions, 3, false},
    {"rotations", &SplatGradients::rotations, 4, false},
    {"scales", &SplatGradients::scales, 3, false},
    {"opacities", &SplatGradients::opacities, 1, false},
    {"sh", &SplatGradients::sh, 0, false},
    {"contributions", &SplatGradients::contributions, 1, true},
    {"blending_weights", &SplatGradients::blending_weights, 1, true},
    {"edge_weights", &SplatGradients::edge_weights, 1, true},
    {"screen_gradients", &SplatGradients::screen_gradients, 2, true},
    {"absolute_screen_gradients", &SplatGradients::absolute_screen_gradients, 2, true},
    {"screen_gradient_norms", &SplatGradients::screen_gradient_norms, 1, true},
    {"errors", &SplatGradients::errors, 1, true},
    {"largest_errors", &SplatGradients::largest_errors, 1, true},
    {"covered_pixels", &SplatGradients::covered_pixels, 1, true},
    {"covered_errors", &SplatGradients::covered_errors, 1, true},
    {"covered_distances", &SplatGradients::covered_distances, 1, true}};

struct BackwardResult {
  /// One per instance, in their order. Those of a cloud that is placed twice are to be added.
  std::vector<SplatGradients> instances;
  /// By a motion of the camera: x_camera' = x_camera + omega x x_camera + upsilon to first order,
  /// that is world_to_camera' = exp(omega, upsilon) world_to_camera. Order: omega (radians),
  /// upsilon (metres), both in the camera's frame.
  std::array<double, 6> camera{};
  std::array<double, 3> background{};  ///< zeros without a background
  uint64_t visible_count = 0;
};

/// Memory of renderBackward that the next call uses again: a second call of the same size
/// allocates nothing. One call at a time.
class BackwardWorkspace {
 public:
  BackwardWorkspace();
  ~BackwardWorkspace();
  BackwardWorkspace(BackwardWorkspace&&) noexcept;
  BackwardWorkspace& operator=(BackwardWorkspace&&) noexcept;

  struct Arrays;
  Arrays& arrays() { return *arrays_; }

 private:
  std::unique_ptr<Arrays> arrays_;
};

/// Derivatives of a loss by everything that renderTiled draws. It takes every decision (which
/// splat shows at which pixel, where a pixel ends) as the renderers do; the clamp of alpha at 0.99
/// and that of colours at 0 pass no derivative; the ends of a splat at alpha = 1/255 and the order
/// of blending are taken as fixed.
///
/// The second half of a step of training. In: drawn: a workspace that keeps for backward; picture:
/// what renderTiled drew into it last; the clouds of that call, as they were then. Everything that
/// the picture found out (projection, order, lists, ends of pixels) is used again. May be called
/// several times for one picture.
/// Same bits for any number of threads. Errors: kInvalidArgument where `drawn` does not hold that
/// picture or its clouds have changed since (any position or opacity is seen; rotations, scales and
/// harmonics where a step of training changed all of them), an array has another size than the
/// picture or holds a value outside its range; kMemoryLimit where backwardMemoryBound(drawn, input)
/// is above memory_limit_bytes; `result` is then as it was. Cost: O(pairs of tiles and splats).
void renderBackward(RenderWorkspace& drawn, const RenderResult& picture, const BackwardInput& input,
                    BackwardWorkspace& workspace, BackwardResult& result,
                    uint64_t memory_limit_bytes = UINT64_MAX, Progress* progress = nullptr);

/// Upper bound of the bytes that this allocates, the result included, whatever the workspace has.
uint64_t backwardMemoryBound(RenderWorkspace& drawn, const BackwardInput& input);

/// The same from nothing: the picture is blended first, and handed to nobody. Errors: those of
/// renderTiled too.
void renderBackward(std::span<const SplatInstance> instances, const Camera& camera,
                    const RenderOptions& options, const BackwardInput& input,
                    BackwardWorkspace& workspace, BackwardResult& result,
                    uint64_t memory_limit_bytes = UINT64_MAX, Progress* progress = nullptr);
BackwardResult renderBackward(std::span<const SplatInstance> instances, const Camera& camera,
                              const RenderOptions& options, const BackwardInput& input,
                              uint64_t memory_limit_bytes = UINT64_MAX,
                              Progress* progress = nullptr);

/// Upper bound of the bytes that renderBackward from nothing allocates, its result included.
/// Errors: kInvalidArgument for a camera that validate() refuses.
uint64_t backwardMemoryBound(std::span<const SplatInstance> instances, const Camera& camera,
                             const RenderOptions& options, const BackwardInput& input);

}  // namespace stipple
