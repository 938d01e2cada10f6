#pragma once

#include <cstdint>
#include <vector>

namespace stipple {

/// What a backward pass gathers of each splat, beside the derivatives (splat/render_backward.h says
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
};

/// Which of them a pass shall gather; each costs time only where it is asked for.
struct StatisticRequest {
  bool contributions = false;  ///< against the target of the view
  bool blending_weights = false;
  bool screen_gradients = false;                 ///< all three of them
  std::vector<float> contribution_weights = {};  ///< [H,W] >= 0; empty: 1
  std::vector<float> edge_weights = {};          ///< [H,W] not empty: edge weights are gathered
  std::vector<float> errors = {};                ///< [H,W] not empty: errors are gathered
};

}  // namespace stipple
