#include "fit/fit_views.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "train/series_views.h"

namespace stipple {
namespace {

using testing::SeriesViews;

TEST(FitViews, HoldOutWholeCamerasOfASeries) {
  const SeriesViews views(9, 5);
  const FitViews split = splitAsTold(views, 4);
  // Cameras 0, 4 and 8, with all their frames, and nothing of others.
  EXPECT_EQ(split.held_out.size(), 15u);
  EXPECT_EQ(split.training.size(), 30u);
  for (const size_t v : split.held_out) EXPECT_EQ(v / 5 % 4, 0u);
  for (const size_t v : split.training) EXPECT_NE(v / 5 % 4, 0u);
  EXPECT_EQ(heldOutCameras(views, split),
            "6 cameras are learned from and 3 held out: cam0, cam4, cam8 (15 of 45 images)");
}

TEST(FitViews, HoldOutNoFrameOfTooFewCameras) {
  const SeriesViews views(3, 50);
  const FitViews split = splitAsTold(views, 8);
  EXPECT_TRUE(split.held_out.empty());
  EXPECT_EQ(split.training.size(), 150u);
  EXPECT_EQ(heldOutCameras(views, split),
            "none of the 3 cameras is held out; figures are of views that are learned from");
}

TEST(FitViews, HoldOutTheCamerasThatTheDataSetNames) {
  SeriesViews views(4, 3);
  views.test_camera = 2;
  const FitViews split = splitAsTold(views, 8);
  EXPECT_EQ(split.held_out, (std::vector<size_t>{6, 7, 8}));
  EXPECT_EQ(heldOutCameras(views, split),
            "3 cameras are learned from and 1 held out: cam2 (3 of 12 images)");
}

TEST(FitViews, TellWhereTheDataSetDividesTheImagesOfACamera) {
  const SeriesViews views(2, 3);
  FitViews split;
  split.held_out = {0};
  split.training = {1, 2, 3, 4, 5};
  EXPECT_EQ(heldOutCameras(views, split),
            "the data set holds out images of cameras that are learned from at other times");
}

}  // namespace
}  // namespace stipple
