#pragma once

#include <memory>

#include "base/error.h"
#include "data/views/memory_view_source.h"
#include "train/loop/fit_model.h"

namespace stipple::testing {

struct ColourModelOptions {
  uint64_t spoils_from = UINT64_MAX;   ///< iteration from which steps lead away from the target
  uint64_t fails_at = UINT64_MAX;      ///< iteration whose step throws
  uint64_t lowers_every = UINT64_MAX;  ///< iterations, after which opacities are said to be lowered
  uint64_t foggy_steps = 0;            ///< after each of these
};

/// A model of four numbers, a colour and a sum of gradients, that fits the mean colour of views by
/// gradient descent with momentum: small enough to follow by hand, and yet it goes on bit for bit
/// only where its whole state is kept. Drawn as one splat that fills every picture.
class ColourModel final : public FitModel {
 public:
  explicit ColourModel(const ColourModelOptions& options = {}) : options_(options) {}

  const char* name() const override { return "colour"; }

  StepReport step(const FitMoment& moment, const StepView& view, ViewEvaluator*,
                  Progress*) override {
    if (moment.iteration == options_.fails_at) fail(ErrorCode::kInternal, "the step fails");
    const size_t pixels = size_t{view.camera->width} * view.camera->height;
    double loss = 0;
    for (size_t c = 0; c < 3; ++c) {
      double mean = 0;
      for (size_t i = 0; i < pixels; ++i) mean += static_cast<double>(view.target[i * 3 + c]);
      const double error = static_cast<double>(colour_[c]) - mean / static_cast<double>(pixels);
      momentum_[c] = 0.5f * momentum_[c] + 0.05f * static_cast<float>(error);
      colour_[c] -= moment.iteration >= options_.spoils_from ? -momentum_[c] : momentum_[c];
      loss += error * error;
    }
    seen_views.push_back(view.index);
    seen_widths.push_back(view.camera->width);
    seen_backgrounds.push_back(view.background[0]);
    seen_times.push_back(view.time);
    seen_moments.push_back(moment.time);
    seen_centres.push_back(moment.centre.x());
    StepReport report;
    report.loss = loss;
    report.splat_count = 1;
    report.stage = "Colour";
    return report;
  }

  bool lowersOpacitiesAt(const FitMoment& moment) const override {
    return moment.iteration % options_.lowers_every == 0;
  }
  uint64_t foggyStepsAfter(const FitMoment& moment) const override {
    return lowersOpacitiesAt(moment) ? options_.foggy_steps : 0;
  }

  SplatCloud splats(uint64_t) override {
    SplatCloud cloud;
    cloud.resize(1);
    cloud.rotations[0] = 1;
    cloud.scales = {1e3f, 1e3f, 1e3f};
    cloud.opacities = {1};
    for (size_t c = 0; c < 3; ++c) cloud.sh[c] = (colour_[c] - 0.5f) / kShC0;
    return cloud;
  }
  std::vector<uint64_t> budgets() const override { return {1}; }

  TensorTable state() const override {
    TensorTable table;
    table["raw.colour"] = {{3}, colour_};
    table["adam.first"] = {{3}, momentum_};
    return table;
  }
  void restore(const TensorTable& state) override {
    colour_ = std::get<std::vector<float>>(state.at("raw.colour").values);
    momentum_ = std::get<std::vector<float>>(state.at("adam.first").values);
  }
  uint64_t memoryBytes() const override { return 24; }

  const std::vector<float>& colour() const { return colour_; }

  std::vector<size_t> seen_views;
  std::vector<uint32_t> seen_widths;  ///< of the cameras
  std::vector<double> seen_backgrounds;
  std::vector<double> seen_times;    ///< of the views
  std::vector<double> seen_moments;  ///< of the moments
  std::vector<double> seen_centres;  ///< x of the cameras' mean place, of the moments

 private:
  ColourModelOptions options_;
  std::vector<float> colour_ = {0.5f, 0.5f, 0.5f};
  std::vector<float> momentum_ = {0, 0, 0};
};

/// A camera at z = -distance that looks along z.
inline Camera cameraAt(double x, uint32_t width, uint32_t height, double distance = 3) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.world_to_camera(0, 3) = -x;
  camera.world_to_camera(2, 3) = distance;
  return camera;
}

/// Views of one colour that differ a little from view to view. alpha below 1: of every pixel.
inline std::shared_ptr<MemoryViewSource> colourViews(size_t count, float red, float green,
                                                     float blue, float alpha = 1,
                                                     double seconds_apart = 0) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  const float colour[3] = {red, green, blue};
  for (size_t v = 0; v < count; ++v) {
    ViewPicture picture;
    picture.width = 20;
    picture.height = 12;
    const float change = 0.01f * static_cast<float>(v % 3);
    for (size_t i = 0; i < size_t{20} * 12; ++i) {
      for (const float value : colour) picture.colour.push_back((value + change) * alpha);
    }
    if (alpha < 1) picture.alpha.assign(size_t{20} * 12, alpha);
    const std::string number = std::to_string(v);
    views->add(cameraAt(0.1 * static_cast<double>(v), 20, 12), std::move(picture),
               "view" + std::string(4 - number.size(), '0') + number,
               seconds_apart * static_cast<double>(v));
  }
  return views;
}

}  // namespace stipple::testing
