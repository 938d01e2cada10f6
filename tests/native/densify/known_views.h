#pragma once

#include <array>
#include <vector>

#include "densify/quantities/error_maps.h"
#include "densify/strategy.h"

// Views whose pictures and statistics a test sets.

namespace stipple::testing {

/// Looks along +z from the origin.
inline Camera forwardCamera(uint32_t width, uint32_t height, double focal) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  return camera;
}

struct KnownView {
  Camera camera;
  std::vector<float> target;   ///< [H,W,3]
  std::vector<float> picture;  ///< [H,W,3]
  std::vector<uint8_t> visible;
  std::array<std::vector<float>, kStatisticCount> statistics;
  double loss = 0.5;
  std::vector<float>& of(Statistic one) { return statistics[static_cast<size_t>(one)]; }
};

/// A view whose target and picture are of one colour each.
inline KnownView plainView(const Camera& camera, float target, float picture) {
  const size_t count = size_t{camera.width} * camera.height * 3;
  return {camera, std::vector<float>(count, target), std::vector<float>(count, picture), {}, {}, 0.5};
}

class KnownViews final : public ViewEvaluator {
 public:
  SplatCloud cloud;
  std::vector<KnownView> views;
  std::vector<size_t> drawn;  ///< views whose pictures were asked for

  size_t viewCount() const override { return views.size(); }
  const SplatCloud& splats() override { return cloud; }
  const Camera& camera(size_t view) const override { return views[view].camera; }
  std::vector<float> target(size_t view) override { return views[view].target; }
  std::vector<float> picture(size_t view) override {
    drawn.push_back(view);
    return views[view].picture;
  }
  const ViewStatistics& evaluate(size_t view, const StatisticRequest&) override {
    drawn.push_back(view);
    return observed(view);
  }

  /// What an iteration with this view shows. Valid until the next call.
  const ViewStatistics& observed(size_t view) {
    const KnownView& known = views[view];
    statistics_ = {};
    statistics_.view = view;
    statistics_.width = known.camera.width;
    statistics_.height = known.camera.height;
    statistics_.camera = &known.camera;
    statistics_.loss = known.loss;
    statistics_.visible = known.visible;
    statistics_.splats = {cloud.positions, cloud.rotations, cloud.scales, cloud.opacities};
    for (size_t k = 0; k < kStatisticCount; ++k) statistics_.arrays[k] = known.statistics[k];
    maps_ = errorMaps(known.camera.width, known.camera.height, known.picture, known.target);
    rgba_.assign(known.picture.size() / 3 * 4, 1.0f);
    for (size_t i = 0; i < known.picture.size(); ++i) rgba_[i / 3 * 4 + i % 3] = known.picture[i];
    statistics_.errors = {
        known.camera.width, known.camera.height, maps_.dissimilarity, rgba_, known.target, {}};
    return statistics_;
  }

 private:
  ErrorMaps maps_;
  std::vector<float> rgba_;
  ViewStatistics statistics_;
};

/// An iteration that learns from a view: what a strategy asks for, and then is shown.
inline StatisticRequest iterate(Strategy& strategy, KnownViews& views, FitMoment moment,
                                size_t view) {
  const Camera& camera = views.views[view].camera;
  const TrainingView learned{view, camera.width, camera.height, views.views[view].target};
  moment.view_count = views.views.size();
  moment.view = &learned;
  const StatisticRequest request = strategy.requests(moment);
  if (request.any()) strategy.observe(moment, views.observed(view));
  return request;
}

}  // namespace stipple::testing
