#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "densify/strategy.h"
#include "splat/render/render_backward.h"
#include "train/loop/picture_store.h"
#include "train/optimiser/image_loss.h"

namespace stipple {

/// Draws the training views of a fit for strategies that look around between steps, with the splats
/// that there are when forgetSplats() was called last. Views are numbered as StepView::index.
class FitViewEvaluator final : public ViewEvaluator {
 public:
  /// In: splats: gives them as they are now; references outlive this; background [3] behind
  /// transparent views.
  FitViewEvaluator(std::function<SplatCloud()> splats, PictureStore& pictures,
                   const std::vector<size_t>& training, const double background[3],
                   double ssim_share);

  /// Call where the splats may have changed.
  void forgetSplats() { cloud_.reset(); }

  size_t viewCount() const override { return training_.size(); }
  const SplatCloud& splats() override;
  const Camera& camera(size_t view) const override;
  std::vector<float> target(size_t view) override;
  std::vector<float> picture(size_t view) override;
  const ViewStatistics& evaluate(size_t view, const StatisticRequest& request) override;

 private:
  void load(size_t view);
  void draw(size_t view);

  std::function<SplatCloud()> splats_;
  PictureStore& pictures_;
  const std::vector<size_t>& training_;
  double background_[3];
  ImageLossOptions loss_options_;
  std::optional<SplatCloud> cloud_;
  RenderWorkspace workspace_;
  RenderResult drawn_;
  BackwardWorkspace backward_workspace_;
  BackwardResult backward_;
  ImageLoss loss_;
  TargetPicture target_;
  std::vector<float> colour_gradient_;  ///< [H,W,4]
  std::vector<float> residual_;         ///< [H,W,3]
  std::vector<float> made_errors_;      ///< [H,W] of StatisticRequest::errors_of
  std::vector<uint8_t> visible_;
  ViewStatistics statistics_;
};

}  // namespace stipple
