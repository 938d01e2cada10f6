#pragma once

#include <span>
#include <string>
#include <vector>

#include "splat/render/render_backward.h"
#include "train/loop/view_pass.h"

namespace stipple {

/// On this processor, with native/splat and train/optimiser/image_loss.
class CpuViewPass final : public ViewPass {
 public:
  CpuViewPass();

  void forward(const SplatCloud& cloud, const Camera& camera, const RenderOptions& options,
               Progress* progress = nullptr) override;
  ImageLossValue loss(std::span<const float> target, std::span<const float> weights,
                      const ImageLossOptions& options) override;
  void setLossGradient(std::span<const float> gradient) override;
  BackwardSummary backward(const StatisticRequest& request, double transmittance_weight = 0,
                           Progress* progress = nullptr) override;
  std::span<const float> image() override;
  std::span<const float> statistic(Statistic statistic) override;
  void swapGradients(SplatCloud& gradients) override;
  void lendStatistics(ViewStatistics& statistics) override;
  uint64_t memoryBytes() const override;

  /// What has been done since the splats changed last; each pass needs the one before it.
  enum class Stage { kSplats, kDrawn, kLoss, kGradients };
  void requireStage(Stage least, const char* message) const;
  /// The splats are others now: image, loss and derivatives are of none that there is.
  void forget() { stage_ = Stage::kSplats; }

  const RenderResult& drawn() const { return drawn_; }
  SplatGradients& gradients() { return backward_.instances[0]; }
  const SplatGradients& gradients() const { return backward_.instances[0]; }

 private:
  std::span<const float> errorsOf(const StatisticRequest& request);
  std::span<const float> residual();
  double meanTransmittance() const;

  Stage stage_ = Stage::kSplats;
  const SplatCloud* cloud_ = nullptr;
  const Camera* camera_ = nullptr;
  RenderWorkspace workspace_;
  RenderResult drawn_;
  ImageLoss loss_;
  double loss_value_ = 0;
  std::span<const float> target_;         ///< [H,W,3] of the last loss
  std::span<const float> weights_;        ///< [H,W] the same
  std::span<const float> loss_gradient_;  ///< [H,W,4] of the last loss, or the caller's
  bool has_error_maps_ = false;           ///< whether the last backward pass was asked for them
  bool has_drawn_splats_ = false;         ///< the same
  std::vector<float> own_gradient_;       ///< [H,W,4]
  std::vector<float> residual_;           ///< [H,W,3]
  std::vector<float> made_errors_;        ///< [H,W] of StatisticRequest::errors_of
  BackwardWorkspace workspace_of_backward_;
  BackwardResult backward_;
  std::vector<uint8_t> visible_;  ///< [N]
};

/// The arrays of Statistic, in its order.
const GradientArray& arrayOf(Statistic statistic);

/// Refuses an array of another length. In: what, as a noun.
void requireCount(size_t seen, size_t needed, const char* what);

}  // namespace stipple
