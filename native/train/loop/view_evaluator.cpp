#include "train/loop/view_evaluator.h"

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.h"

namespace stipple {

FitViewEvaluator::FitViewEvaluator(std::function<SplatCloud()> splats, PictureStore& pictures,
                                   const std::vector<size_t>& training, const double background[3],
                                   double ssim_share)
    : splats_(std::move(splats)), pictures_(pictures), training_(training) {
  std::copy_n(background, 3, background_);
  loss_options_.ssim_share = ssim_share;
  workspace_.keepForBackward(true);
}

const Camera& FitViewEvaluator::camera(size_t view) const {
  if (view >= training_.size()) {
    fail(ErrorCode::kInvalidArgument,
         "view " + std::to_string(view) + " was asked for; there are " +
             std::to_string(training_.size()) + " to learn from, counted from 0");
  }
  return pictures_.views().camera(training_[view]);
}

const SplatCloud& FitViewEvaluator::splats() {
  if (!cloud_) cloud_ = splats_();
  return *cloud_;
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
  const SplatInstance instance{&splats()};
  renderTiled({&instance, 1}, camera(view), options, workspace_, drawn_);
}

std::vector<float> FitViewEvaluator::target(size_t view) {
  load(view);
  return target_.colour;
}

std::vector<float> FitViewEvaluator::picture(size_t view) {
  draw(view);
  const size_t count = drawn_.colour.size() / 4;
  std::vector<float> colours(count * 3);
  for (size_t i = 0; i < count; ++i) std::copy_n(&drawn_.colour[i * 4], 3, &colours[i * 3]);
  return colours;
}

const ViewStatistics& FitViewEvaluator::evaluate(size_t view, const StatisticRequest& request) {
  load(view);
  draw(view);
  colour_gradient_.resize(drawn_.colour.size());
  loss_options_.with_structure_errors = request.structure_errors;
  const ImageLossValue value =
      loss_.evaluate(drawn_.width, drawn_.height, {drawn_.colour.data(), PixelLayout::kRgba},
                     {target_.colour.data(), PixelLayout::kRgb},
                     target_.weights.empty() ? nullptr : target_.weights.data(),
                     {colour_gradient_.data(), PixelLayout::kRgba}, loss_options_);
  BackwardInput input;
  input.colour_gradient = colour_gradient_;
  if (request.contributions) {
    residual_.resize(target_.colour.size());
    for (size_t i = 0; i < residual_.size() / 3; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        residual_[i * 3 + c] = drawn_.colour[i * 4 + c] - target_.colour[i * 3 + c];
      }
    }
    input.residual = residual_;
    input.residual_weights = request.contribution_weights;
  }
  input.edge_weights = request.edge_weights;
  if (request.errors_of) {
    made_errors_ = request.errors_of({drawn_.width, drawn_.height, loss_.structureErrors(),
                                      drawn_.colour, target_.colour, target_.weights});
  }
  input.errors = request.structure_errors ? loss_.structureErrors()
                 : request.errors_of      ? std::span<const float>(made_errors_)
                                          : std::span<const float>(request.errors);
  input.with_blending_weights = request.blending_weights;
  input.with_screen_gradients = request.screen_gradients;
  input.with_absolute_screen_gradients = request.absolute_screen_gradients;
  input.with_covered = request.covered;
  renderBackward(workspace_, drawn_, input, backward_workspace_, backward_);
  visibleFlags(workspace_, visible_);
  statistics_ = {};
  statistics_.view = view;
  statistics_.width = drawn_.width;
  statistics_.height = drawn_.height;
  statistics_.camera = &camera(view);
  statistics_.loss = value.loss;
  statistics_.visible = visible_;
  statistics_.splats = {cloud_->positions, cloud_->rotations, cloud_->scales, cloud_->opacities};
  size_t next = 0;
  for (const GradientArray& array : kGradientArrays) {
    if (array.is_statistic) statistics_.arrays[next++] = backward_.instances[0].*array.values;
  }
  return statistics_;
}

}  // namespace stipple
