#pragma once

#include <array>
#include <vector>

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
  std::vector<float>& of(Statistic one) { return statistics[static_cast<size_t>(one)]; }
};

/// A view whose target and picture are of one colour each.
inline KnownView plainView(const Camera& camera, float target, float picture) {
  const size_t count = size_t{camera.width} * camera.height * 3;
  return {camera, std::vector<float>(count, target), std::vector<float>(count, picture), {}, {}};
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
    const KnownView& known = views[view];
    statistics_ = {};
    statistics_.view = view;
    statistics_.width = known.camera.width;
    statistics_.height = known.camera.height;
    statistics_.camera = &known.camera;
    statistics_.visible = known.visible;
    for (size_t k = 0; k < kStatisticCount; ++k) statistics_.arrays[k] = known.statistics[k];
    return statistics_;
  }

 private:
  ViewStatistics statistics_;
};

}  // namespace stipple::testing
