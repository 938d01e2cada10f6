#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace stipple {

/// What a backward pass gathers of each splat, beside the derivatives (splat/render/render_backward.h says
/// what each is).
enum class Statistic : uint32_t {
  kContributions = 0,
  kBlendingWeights = 1,
  kEdgeWeights = 2,
  kScreenGradients = 3,          ///< [N,2]
  kAbsoluteScreenGradients = 4,  ///< [N,2]
  kScreenGradientNorms = 5,
  kErrors = 6,
  kLargestErrors = 7,
  kCoveredPixels = 8,
  kCoveredErrors = 9,
  kCoveredDistances = 10,
};

constexpr size_t kStatisticCount = 11;

/// How a picture differs from what it should look like.
struct ViewErrors {
  uint32_t width = 0;
  uint32_t height = 0;
  std::span<const float> structure;  ///< [H,W] 1 - SSIM, mean of the channels, times its weight
  std::span<const float> picture;    ///< [H,W,4] as it is drawn
  std::span<const float> target;     ///< [H,W,3]
  std::span<const float> weights;    ///< [H,W] of pixels; empty: 1

  /// |picture - target|, mean of the channels, times its weight.
  double differenceAt(size_t pixel) const;
};

/// Which of them a pass shall gather; each costs time only where it is asked for. Pictures have the
/// size of the view.
struct StatisticRequest {
  bool contributions = false;  ///< against the target of the view, its pixels as the loss has them
  bool blending_weights = false;
  bool screen_gradients = false;           ///< signed ones: next to nothing beside the pass itself
  bool absolute_screen_gradients = false;  ///< and lengths
  bool covered = false;                    ///< pixels and distances, and errors where there are any
  std::vector<float> edge_weights = {};          ///< [H,W] not empty: edge weights are gathered
  std::vector<float> errors = {};                ///< [H,W] not empty: errors are gathered
  /// Instead of `errors`: what it makes of the picture that was drawn, [H,W] >= 0. It may be called
  /// after the pass has begun and must hold all that it needs.
  std::function<std::vector<float>(const ViewErrors&)> errors_of = {};
  /// Instead of both: those of structure, 1 - SSIM of the picture and the view's target, mean
  /// of the channels, times what a mask says.
  bool structure_errors = false;
  /// Splats as they are drawn, for ViewStatistics::splats: they are copied out for it.
  bool drawn_splats = false;
  /// Temporal scales of splats that move, for DrawnSplats::lifespans.
  bool lifespans = false;
  /// Pictures for ViewStatistics::errors: nothing is gathered of splats.
  bool error_maps = false;

  bool any() const {
    return contributions || blending_weights || screen_gradients || absolute_screen_gradients ||
           structure_errors || drawn_splats || lifespans || error_maps || covered || errors_of ||
           !edge_weights.empty() || !errors.empty();
  }
};

}  // namespace stipple
