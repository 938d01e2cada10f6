#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "data/views/view_source.h"

namespace stipple::testing {

/// Cameras side by side, of which each took a small grey image at every time; frame by frame of the
/// first camera, then of the next. In the left half of images nothing moves.
class SeriesViews : public ViewSource {
 public:
  SeriesViews(size_t cameras, size_t frames) : frames_(frames) {
    for (size_t i = 0; i < cameras * frames; ++i) {
      Camera camera;
      camera.width = camera.height = 8;
      camera.fx = camera.fy = 8;
      camera.cx = camera.cy = 4;
      camera.world_to_camera(0, 3) = 0.1 * static_cast<double>(i / frames);
      camera.world_to_camera(2, 3) = 3;
      cameras_.push_back(camera);
    }
  }

  size_t count() const override { return cameras_.size(); }
  const Camera& camera(size_t view) const override { return cameras_[view]; }
  std::string name(size_t view) const override {
    return cameraName(view) + "/" + std::to_string(view % frames_);
  }
  std::string cameraName(size_t view) const override {
    return "cam" + std::to_string(view / frames_);
  }
  double time(size_t view) const override { return static_cast<double>(view % frames_); }
  ColourSpace colourSpace() const override { return ColourSpace::kDisplay; }
  ViewRole role(size_t view) const override {
    if (test_camera == kNoCamera) return ViewRole::kNone;
    return view / frames_ == test_camera ? ViewRole::kTest : ViewRole::kTrain;
  }
  ViewPicture load(size_t view) const override {
    ViewPicture picture;
    picture.width = picture.height = 8;
    const float moved = static_cast<float>(view % frames_ % 2) * 0.4f;
    for (size_t i = 0; i < 64; ++i) {
      for (int c = 0; c < 3; ++c) picture.colour.push_back(i % 8 < 4 ? 0.3f : 0.3f + moved);
    }
    return picture;
  }
  const PointSet& points() const override { return points_; }

  static constexpr size_t kNoCamera = SIZE_MAX;
  size_t test_camera = kNoCamera;

 private:
  size_t frames_;
  std::vector<Camera> cameras_;
  PointSet points_;
};

}  // namespace stipple::testing
