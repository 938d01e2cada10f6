#include "fit/clip_cuts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace stipple {
namespace {

/// Two cameras that see grey of a brightness by time; `frames` images each.
class GreyViews final : public ViewSource {
 public:
  GreyViews(size_t frames, std::function<float(size_t)> grey)
      : frames_(frames), grey_(std::move(grey)), cameras_(2 * frames) {
    for (Camera& camera : cameras_) camera.width = camera.height = 20;
  }
  size_t count() const override { return cameras_.size(); }
  const Camera& camera(size_t view) const override { return cameras_[view]; }
  std::string name(size_t view) const override { return std::to_string(view); }
  std::string cameraName(size_t view) const override { return view < frames_ ? "a" : "b"; }
  double time(size_t view) const override { return 0.5 * static_cast<double>(view % frames_); }
  ColourSpace colourSpace() const override { return ColourSpace::kDisplay; }
  ViewPicture load(size_t view) const override {
    ViewPicture picture;
    picture.width = picture.height = 20;
    picture.colour.assign(20 * 20 * 3, grey_(view % frames_));
    return picture;
  }
  const PointSet& points() const override { return points_; }

 private:
  size_t frames_;
  std::function<float(size_t)> grey_;
  std::vector<Camera> cameras_;
  PointSet points_;
};

TEST(ClipCuts, AreFoundWhereImagesJump) {
  const GreyViews views(20, [](size_t frame) {
    return (frame < 7 ? 0.2f : 0.6f) + 0.01f * static_cast<float>(frame % 3);
  });
  const auto cut = findCut(views);
  ASSERT_TRUE(cut.has_value());
  EXPECT_DOUBLE_EQ(cut->before, 3.0);
  EXPECT_DOUBLE_EQ(cut->behind, 3.5);
}

TEST(ClipCuts, AreNotSeenInClipsThatMoveFlickerOrRest) {
  const std::vector<std::function<float(size_t)>> clips = {
      [](size_t) { return 0.5f; },
      [](size_t frame) { return 0.04f * static_cast<float>(frame); },
      [](size_t frame) { return frame % 2 == 0 ? 0.2f : 0.6f; },
      [](size_t frame) { return frame < 10 ? 0.3f : 0.32f; },  // a lamp
      [](size_t frame) { return frame == 5 ? 0.9f : 0.2f; },   // a flash, there and back
      [](size_t frame) { return 0.5f + 0.4f * std::sin(0.9f * static_cast<float>(frame)); }};
  for (size_t i = 0; i < clips.size(); ++i) {
    EXPECT_FALSE(findCut(GreyViews(20, clips[i])).has_value()) << i;
  }
  EXPECT_FALSE(findCut(GreyViews(3, [](size_t frame) { return frame < 2 ? 0.0f : 1.0f; })))
      << "too few frames to know what is usual";
}

}  // namespace
}  // namespace stipple
