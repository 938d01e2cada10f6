#include "data/views/moving_pixels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "base/parallel.h"
#include "base/random.h"
#include "data/views/memory_view_source.h"

namespace stipple {
namespace {

constexpr uint32_t kWidth = 12;
constexpr uint32_t kHeight = 9;

std::vector<float> grey(float value) {
  return std::vector<float>(size_t{kWidth} * kHeight * 3, value);
}

std::vector<bool> movingPixels(const std::vector<std::vector<float>>& pictures) {
  MovingPixels moving(kWidth, kHeight);
  for (const std::vector<float>& picture : pictures) moving.add(picture);
  return moving.found();
}

void paint(std::vector<float>& picture, uint32_t x, uint32_t y, size_t colour, float value) {
  picture[(size_t{y} * kWidth + x) * 3 + colour] = value;
}

TEST(MovingPixels, AreThoseWhoseNeighbourhoodChangesInAnyColour) {
  std::vector<std::vector<float>> pictures(5, grey(0.5f));
  // One pixel of one colour in the fourth of five: a ninth of 0.9 is 0.1, twice the limit.
  paint(pictures[3], 5, 4, 1, 1.0f);
  paint(pictures[1], 5, 4, 1, 0.1f);
  const std::vector<bool> moves = movingPixels(pictures);
  for (uint32_t y = 0; y < kHeight; ++y) {
    for (uint32_t x = 0; x < kWidth; ++x) {
      const bool is_near = x >= 4 && x <= 6 && y >= 3 && y <= 5;
      EXPECT_EQ(moves[y * kWidth + x], is_near) << x << ' ' << y;
    }
  }
}

TEST(MovingPixels, AreNotThoseThatFlickerByNoise) {
  // Even noise of 4 of 255 to each side, which is more than a camera's.
  std::vector<std::vector<float>> pictures(5, grey(0.5f));
  uint64_t key = 0;
  for (auto& picture : pictures) {
    for (float& value : picture) {
      value += static_cast<float>((unitDouble(mixBits(++key)) - 0.5) * 8 / 255);
    }
  }
  const std::vector<bool> moves = movingPixels(pictures);
  EXPECT_EQ(std::count(moves.begin(), moves.end(), true), 0);
}

TEST(MovingPixels, AreNoneOfOnePictureAndTheSameForAnyThreads) {
  const std::vector<std::vector<float>> one(1, grey(0.5f));
  const std::vector<bool> none = movingPixels(one);
  EXPECT_EQ(none, std::vector<bool>(size_t{kWidth} * kHeight, false));
  EXPECT_EQ(movingPixels({}), none);
  std::vector<std::vector<float>> pictures(2, grey(0.2f));
  for (size_t i = 0; i < pictures[1].size(); i += 7) pictures[1][i] = 0.9f;
  std::vector<bool> by_one, by_many;
  withThreads(1, [&] { by_one = movingPixels(pictures); });
  withThreads(4, [&] { by_many = movingPixels(pictures); });
  EXPECT_EQ(by_one, by_many);
}

/// Cameras with names, and no pictures.
class NamedViews final : public ViewSource {
 public:
  struct View {
    std::string camera;
    double time;
    double x;
  };
  explicit NamedViews(std::vector<View> views) : views_(std::move(views)) {
    for (const View& view : views_) {
      Camera camera;
      camera.world_to_camera(0, 3) = view.x;
      cameras_.push_back(camera);
    }
  }
  size_t count() const override { return views_.size(); }
  const Camera& camera(size_t view) const override { return cameras_[view]; }
  std::string name(size_t view) const override { return views_[view].camera; }
  ColourSpace colourSpace() const override { return ColourSpace::kDisplay; }
  double time(size_t view) const override { return views_[view].time; }
  std::string cameraName(size_t view) const override { return views_[view].camera; }
  ViewPicture load(size_t) const override { return {}; }
  const PointSet& points() const override { return points_; }

 private:
  std::vector<View> views_;
  std::vector<Camera> cameras_;
  PointSet points_;
};

TEST(StillCameras, GiveTheFiveNearestFramesOfTheirOwnCamera) {
  std::vector<NamedViews::View> views;
  // Times fall, and two cameras take turns.
  for (size_t i = 0; i < 7; ++i) {
    views.push_back({"a", 6.0 - static_cast<double>(i), 0});
    views.push_back({"b", 6.0 - static_cast<double>(i), 1});
  }
  const StillCameras cameras{NamedViews(views)};
  // Views 0, 2, 4 and so on are of "a", the last one first in time.
  EXPECT_EQ(cameras.around(6), (std::vector<size_t>{10, 8, 6, 4, 2}));
  EXPECT_EQ(cameras.around(12), (std::vector<size_t>{12, 10, 8, 6, 4}));
  EXPECT_EQ(cameras.around(10), (std::vector<size_t>{12, 10, 8, 6, 4}));
  EXPECT_EQ(cameras.around(0), (std::vector<size_t>{8, 6, 4, 2, 0}));
  EXPECT_EQ(cameras.around(1), (std::vector<size_t>{9, 7, 5, 3, 1}));
}

TEST(StillCameras, AreNotThoseThatMoveOrTookOneImage) {
  const StillCameras none{
      NamedViews({{"a", 0, 0}, {"a", 1, 0.5}, {"b", 0, 3}, {"", 0, 4}, {"", 1, 4}})};
  for (size_t v = 0; v < 5; ++v) EXPECT_TRUE(none.around(v).empty());
  const StillCameras few{NamedViews({{"a", 0, 0}, {"a", 1, 0}})};
  EXPECT_EQ(few.around(1), (std::vector<size_t>{0, 1}));
}

}  // namespace
}  // namespace stipple
