#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "densify/statistic.h"
#include "densify/strategy.h"
#include "math/camera.h"
#include "splat/render/render.h"
#include "train/optimiser/image_loss.h"

namespace stipple {

struct GradientArray;

/// The loss whose backward pass can gather what `request` asks for.
ImageLossOptions lossFor(const StatisticRequest& request, double ssim_share);

/// Of one backward pass; what they are is said at SplatGradients and BackwardResult.
struct BackwardSummary {
  std::array<double, 6> camera{};
  std::array<double, 3> background{};
  uint64_t visible_count = 0;
  double regularisation = 0;  ///< value of what adds to the loss beside the image
};

/// How much of each splat an image shows: [N] each, 0 for splats out of view.
struct ShownWeights {
  std::span<const float> seen;      ///< sum of T alpha over the pixels
  std::span<const float> unhidden;  ///< unhiddenWeights: about that with nothing in front
};

/// What one view tells about splats: their image, its loss against a target, derivatives by the
/// stored values, statistics and errors. Whoever looks at a view does it here, in a step of a fit
/// or between steps, so that a strategy is told the same in both.
///
/// Images, derivatives and statistics stay inside until they are asked for, and what is lent is
/// valid until the next call. One call at a time.
///
/// Errors of every call: kInvalidArgument for arguments outside their range and for a call out of
/// its order (forward, loss, backward, then what they found).
/// Determinism: the same calls give the same bits, for any number of threads.
class ViewPass {
 public:
  virtual ~ViewPass() = default;

  /// Draws. In: cloud, camera: the caller's, as they are until the last call about this view.
  virtual void forward(const SplatCloud& cloud, const Camera& camera, const RenderOptions& options,
                       Progress* progress = nullptr) = 0;

  /// Loss of the image against a target [H,W,3], and its derivative by the image. In: weights [H,W]
  /// >= 0 of pixels, or empty: 1. Both are the caller's until the last call about this view.
  virtual ImageLossValue loss(std::span<const float> target, std::span<const float> weights,
                              const ImageLossOptions& options) = 0;

  /// Instead: the derivative of some loss by the image, [H,W,4] as BackwardInput has it.
  virtual void setLossGradient(std::span<const float> gradient) = 0;

  /// Derivatives by the stored values of the cloud, and statistics. Pixels count in contributions
  /// as they do in the loss. In: transmittance_weight: of the mean transmittance behind the last
  /// splat of each pixel, which is added to the loss; not 0: the image must have been drawn with
  /// transmittance. A request for structure errors, or for error maps, needs lossFor() it.
  virtual BackwardSummary backward(const StatisticRequest& request, double transmittance_weight = 0,
                                   Progress* progress = nullptr) = 0;

  /// Of the image drawn last; instead of a loss and its derivatives, which are gone then.
  virtual ShownWeights shownWeights(Progress* progress = nullptr) = 0;

  /// [H,W,4] drawn last.
  virtual std::span<const float> image() = 0;
  /// Gives a statistic of the last backward pass; empty where it was not asked for.
  virtual std::span<const float> statistic(Statistic statistic) = 0;
  /// Exchanges the derivatives, shaped as the cloud, for the arrays of `gradients`. A second call
  /// gives the memory back, which the next pass uses again.
  virtual void swapGradients(SplatCloud& gradients) = 0;
  /// All that a strategy is told of the last backward pass. Out: everything but the number of the
  /// view.
  virtual void lendStatistics(ViewStatistics& statistics) = 0;

  /// The splats are others now: image, loss and derivatives are of none that there is.
  virtual void forget() = 0;

  virtual uint64_t memoryBytes() const = 0;  ///< held now, about
};

/// On this processor, with native/splat and train/optimiser/image_loss.
std::unique_ptr<ViewPass> makeCpuViewPass();

/// The arrays of Statistic, in its order.
const GradientArray& arrayOf(Statistic statistic);

/// Refuses an array of another length. In: what, as a noun.
void requireCount(size_t seen, size_t needed, const char* what);

}  // namespace stipple
