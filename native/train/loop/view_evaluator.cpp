#include "train/loop/view_evaluator.h"

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.h"

namespace stipple {

FitViewEvaluator::FitViewEvaluator(const BackendFactory& backends, SplatsOverTime splats,
                                   PictureStore& pictures, const std::vector<size_t>& training,
                                   const double background[3], double ssim_share)
    : splats_(std::move(splats)),
      pictures_(pictures),
      training_(training),
      ssim_share_(ssim_share),
      pass_(backends.makeViewPass()) {
  std::copy_n(background, 3, background_);
}

FitViewEvaluator::FitViewEvaluator(const BackendFactory& backends,
                                   std::function<SplatCloud()> splats, PictureStore& pictures,
                                   const std::vector<size_t>& training, const double background[3],
                                   double ssim_share)
    : FitViewEvaluator(backends,
                       SplatsOverTime([make = std::move(splats)](double) { return make(); }, false),
                       pictures, training, background, ssim_share) {}

const Camera& FitViewEvaluator::camera(size_t view) const {
  if (view >= training_.size()) {
    fail(ErrorCode::kInvalidArgument,
         "view " + std::to_string(view) + " was asked for; there are " +
             std::to_string(training_.size()) + " to learn from, counted from 0");
  }
  return pictures_.views().camera(training_[view]);
}

void FitViewEvaluator::load(size_t view) {
  camera(view);
  pictures_.load(training_[view], background_, target_);
}

void FitViewEvaluator::draw(size_t view) {
  RenderOptions options;
  options.with_depth = false;
  options.with_background = true;
  std::copy_n(background_, 3, options.background);
  const Camera& seen_by = camera(view);
  pass_->forward(splats_.at(pictures_.views().time(training_[view])), seen_by, options);
}

std::vector<float> FitViewEvaluator::target(size_t view) {
  load(view);
  return target_.colour;
}

std::vector<float> FitViewEvaluator::picture(size_t view) {
  draw(view);
  const std::span<const float> drawn = pass_->image();
  const size_t count = drawn.size() / 4;
  std::vector<float> colours(count * 3);
  for (size_t i = 0; i < count; ++i) std::copy_n(&drawn[i * 4], 3, &colours[i * 3]);
  return colours;
}

const ViewStatistics& FitViewEvaluator::evaluate(size_t view, const StatisticRequest& request) {
  load(view);
  draw(view);
  pass_->loss(target_.colour, target_.weights, lossFor(request, ssim_share_));
  pass_->backward(request);
  statistics_.view = view;
  pass_->lendStatistics(statistics_);
  return statistics_;
}

}  // namespace stipple
