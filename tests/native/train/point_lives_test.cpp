#include "train/prior/point_lives.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "data/views/memory_view_source.h"
#include "train/prior/shared_volume.h"

namespace stipple {
namespace {

constexpr uint32_t kSize = 40;
constexpr size_t kFrames = 21;  // at 0, 0.5 ... 10 s

/// Looks along z from a place on the x axis.
Camera cameraAt(double x) {
  Camera camera;
  camera.width = camera.height = kSize;
  camera.fx = camera.fy = 40;
  camera.cx = camera.cy = kSize / 2.0;
  camera.world_to_camera = Mat4d::Identity();
  camera.world_to_camera(0, 3) = -x;
  return camera;
}

/// A block of a colour that is there from one time to another.
struct Block {
  Vec3d place;
  float colour[3];
  double from, until;
};

ViewPicture pictureOf(const Camera& camera, const std::vector<Block>& blocks, double time) {
  ViewPicture picture;
  picture.width = picture.height = kSize;
  picture.colour.assign(size_t{kSize} * kSize * 3, 0.2f);
  for (const Block& block : blocks) {
    double x = 0, y = 0;
    if (time < block.from || time > block.until) continue;
    if (!project(camera, block.place, x, y)) continue;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const size_t pixel = static_cast<size_t>(static_cast<int>(y) + dy) * kSize +
                             static_cast<size_t>(static_cast<int>(x) + dx);
        std::copy_n(block.colour, 3, &picture.colour[pixel * 3]);
      }
    }
  }
  return picture;
}

/// Three cameras; with a shift, none of them stands still.
MemoryViewSource viewsOf(const std::vector<Block>& blocks, double shift = 0) {
  MemoryViewSource views(ColourSpace::kDisplay);
  for (size_t frame = 0; frame < kFrames; ++frame) {
    const double time = 0.5 * static_cast<double>(frame);
    for (const double x : {-0.4, 0.0, 0.4}) {
      const Camera camera = cameraAt(x + shift * time);
      views.add(camera, pictureOf(camera, blocks, time), "", time);
    }
  }
  return views;
}

std::vector<float> livesOf(const ViewSource& views, const std::vector<Block>& blocks,
                           const std::vector<double>& times) {
  StartPoints points;
  for (size_t i = 0; i < times.size(); ++i) points.add(blocks[i].place, blocks[i].colour);
  points.times = times;
  std::vector<size_t> training(views.count());
  std::iota(training.begin(), training.end(), size_t{0});
  return pointLives(views, training, points);
}

const std::vector<Block> kBlocks = {{{-1, -1, 5}, {0.9f, 0.1f, 0.1f}, 0, 10},
                                    {{1, -1, 5}, {0.1f, 0.9f, 0.1f}, 3, 6},
                                    {{1, 1, 5}, {0.1f, 0.1f, 0.9f}, 0, 2}};

TEST(PointLives, EndHalfWayBetweenWhatIsThereAndWhatIsGone) {
  const auto lives = livesOf(viewsOf(kBlocks), kBlocks, {5, 4, 1});
  ASSERT_EQ(lives.size(), 6u);
  EXPECT_EQ(lives[0], kWholeLife);
  EXPECT_EQ(lives[1], kWholeLife);
  EXPECT_NEAR(lives[2], 4 - 2.75, 1e-6);  // there from 3 s on, not at 2.5
  EXPECT_NEAR(lives[3], 6.25 - 4, 1e-6);
  EXPECT_EQ(lives[4], kWholeLife) << "there from the beginning";
  EXPECT_NEAR(lives[5], 2.25 - 1, 1e-6);
}

TEST(PointLives, DoNotEndWhereSomethingPasses) {
  std::vector<Block> blocks = {kBlocks[0]};
  blocks.push_back({{-1, -1, 5}, {0.5f, 0.5f, 0.5f}, 4, 5});  // in front of it, 3 of 21 times
  const auto lives = livesOf(viewsOf(blocks), {blocks[0]}, {2});
  EXPECT_EQ(lives, (std::vector<float>{kWholeLife, kWholeLife}));
}

TEST(PointLives, AreUnknownWhereNoCameraShowsThePointAtItsTime) {
  std::vector<Block> other = {kBlocks[0]};
  other[0].colour[1] = 0.9f;  // nothing in the images has this colour
  other.push_back({{100, 0, 5}, {0.5f, 0.5f, 0.5f}, 0, 10});
  const auto lives = livesOf(viewsOf({kBlocks[0]}), other, {2, 2});
  EXPECT_EQ(lives, (std::vector<float>(4, kUnknownLife)));
}

TEST(PointLives, OfWhatMovesOnEndHalfWayToTheNextTime) {
  const double always = std::nan("");
  std::vector<Block> blocks(4, kBlocks[0]);
  const auto lives = livesOf(viewsOf(kBlocks, 0.02), blocks, {always, 2, 4, 8});
  EXPECT_EQ(lives,
            (std::vector<float>{kWholeLife, kWholeLife, kWholeLife, 1, 1, 2, 2, kWholeLife}));
}

TEST(PointLives, AreNotAskedOfCamerasThatMove) {
  EXPECT_EQ(livesOf(viewsOf(kBlocks, 0.02), kBlocks, {5, 4, 1}),
            (std::vector<float>(6, kUnknownLife)));
  EXPECT_TRUE(livesOf(viewsOf(kBlocks), kBlocks, {}).empty()) << "points without times";
}

}  // namespace
}  // namespace stipple
