#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "densify/strategy.h"
#include "train/backend/backend_factory.h"
#include "train/loop/picture_store.h"
#include "train/loop/splats_over_time.h"

namespace stipple {

/// Draws the training views of a fit for strategies that look around between steps, with the splats
/// that there are when forgetSplats() was called last, where these move as they are at the time of
/// each view. Views are numbered as StepView::index.
class FitViewEvaluator final : public ViewEvaluator {
 public:
  /// In: backends: for this call; splats: gives them as they are now; references outlive this;
  /// background [3] behind transparent views.
  FitViewEvaluator(const BackendFactory& backends, SplatsOverTime splats, PictureStore& pictures,
                   const std::vector<size_t>& training, const double background[3],
                   double ssim_share);
  /// Of splats that stand still.
  FitViewEvaluator(const BackendFactory& backends, std::function<SplatCloud()> splats,
                   PictureStore& pictures, const std::vector<size_t>& training,
                   const double background[3], double ssim_share);

  /// Call where the splats may have changed.
  void forgetSplats() { splats_.forget(); }

  size_t viewCount() const override { return training_.size(); }
  const SplatCloud& splats() override { return splats_.latest(); }
  const Camera& camera(size_t view) const override;
  std::vector<float> target(size_t view) override;
  std::vector<float> picture(size_t view) override;
  const ViewStatistics& evaluate(size_t view, const StatisticRequest& request) override;

 private:
  void load(size_t view);
  void draw(size_t view);

  SplatsOverTime splats_;
  PictureStore& pictures_;
  const std::vector<size_t>& training_;
  double background_[3];
  double ssim_share_;
  std::unique_ptr<ViewPass> pass_;
  TargetPicture target_;
  ViewStatistics statistics_;
};

}  // namespace stipple
