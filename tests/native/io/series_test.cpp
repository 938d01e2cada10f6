#include "io/views/series.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "dataset_scene.h"
#include "io/views/numbered_frames.h"
#include "io/views/series_choice.h"
#include "npy_builder.h"

namespace stipple {
namespace {

class SeriesTest : public DatasetScene {
 protected:
  /// "cam00/0003.png" of cameras x frames, each in a grey of its own.
  void storeFrames(size_t cameras, size_t frames, const std::string& below = "") const {
    for (size_t c = 0; c < cameras; ++c) {
      for (size_t f = 0; f < frames; ++f) storeFrame(c, f, below);
    }
  }
  static std::string frameName(size_t camera, size_t frame) {
    return "cam0" + std::to_string(camera) + "/000" + std::to_string(frame) + ".png";
  }
  void storeFrame(size_t camera, size_t frame, const std::string& below = "") const {
    storeGrey(below + frameName(camera, frame), greyOf(camera, frame));
  }
  static float greyOf(size_t camera, size_t frame) {
    return static_cast<float>(camera * 10 + frame) / 255.0f;
  }
  void storeBounds(size_t cameras) const {
    store("poses_bounds.npy", poseBoundsFile(cameras, 2, 4, 3));
  }
  std::unique_ptr<Dataset> open(const SeriesOptions& series) const {
    DatasetOptions options;
    options.series = series;
    return openDataset(folder(), options);
  }
  static SeriesOptions withFrames() {
    SeriesOptions series;
    series.with_frames = true;
    return series;
  }
  std::string refusal(const SeriesOptions& series = withFrames()) const {
    try {
      open(series);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }
  /// Cameras in a row as nerfstudio has them, each with the name of its first image.
  void storeRow(size_t cameras, const std::string& keys = "") const {
    std::string frames;
    for (size_t c = 0; c < cameras; ++c) {
      frames += (c > 0 ? "," : "") + std::string("{\"file_path\": \"images/") + frameName(c, 0) +
                "\", \"transform_matrix\": [[1,0,0," + std::to_string(c) +
                "],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}";
    }
    storeTransforms(keys + "\"fl_x\": 3, \"w\": 4, \"h\": 2, ", frames);
  }
};

TEST_F(SeriesTest, FindsTheNumberAtTheEndOfAName) {
  EXPECT_EQ(frameNumber("0012.png"), 12u);
  EXPECT_EQ(frameNumber("cam00_0000.jpg"), 0u);
  EXPECT_EQ(frameNumber("frame7"), 7u);
  EXPECT_EQ(frameNumber("0000000000000000012.png"), 12u);
  EXPECT_FALSE(frameNumber("image.png").has_value());
  EXPECT_FALSE(frameNumber("12a.png").has_value());
  EXPECT_FALSE(frameNumber("1234567890.png").has_value());
}

TEST_F(SeriesTest, ReadsAFolderOfFramesForEachCameraOfPosesBounds) {
  storeBounds(3);
  storeFrames(3, 4);
  const auto dataset = open(withFrames());
  ASSERT_EQ(dataset->count(), 12u);
  EXPECT_EQ(dataset->name(6), "cam01/0002.png");
  EXPECT_EQ(dataset->cameraName(6), "cam01");
  EXPECT_EQ(dataset->time(6), 2.0 / 30);
  EXPECT_EQ(dataset->load(6).colour[0], greyOf(1, 2));
  EXPECT_EQ(dataset->camera(6).world_to_camera(0, 3), -1);
  EXPECT_EQ(dataset->role(6), ViewRole::kNone);
  EXPECT_TRUE(dataset->notes().empty());
  EXPECT_EQ(dataset->series().image_count, 12u);
  EXPECT_EQ(dataset->series().camera_count, 3u);
  EXPECT_EQ(dataset->series().frame_count, 4u);
  EXPECT_EQ(dataset->series().time_end, 0.1);
}

TEST_F(SeriesTest, TakesTheFirstFrameOfEachCameraWhereNoFramesAreAskedFor) {
  storeBounds(3);
  storeFrames(3, 4);
  const auto dataset = open({});
  ASSERT_EQ(dataset->count(), 3u);
  EXPECT_EQ(dataset->name(2), "cam02/0000.png");
}

TEST_F(SeriesTest, ReadsFramesInAFolderImagesOfEachCamera) {
  storeBounds(2);
  for (size_t f = 0; f < 2; ++f) {
    for (size_t c = 0; c < 2; ++c) {
      storeGrey("cam0" + std::to_string(c) + "/images/" + std::to_string(f) + ".png", 0.2f);
    }
  }
  const auto dataset = open(withFrames());
  ASSERT_EQ(dataset->count(), 4u);
  EXPECT_EQ(dataset->cameraName(3), "cam01");
}

TEST_F(SeriesTest, ScalesFocalLengthsToImagesThatAreSmaller) {
  store("poses_bounds.npy", poseBoundsFile(2, 2028, 2704, 1460));
  for (size_t c = 0; c < 2; ++c) {
    for (size_t f = 0; f < 2; ++f) storeGrey(frameName(c, f), 0.5f, 1352, 1014);
  }
  const auto dataset = open(withFrames());
  EXPECT_EQ(dataset->camera(3).width, 1352u);
  EXPECT_EQ(dataset->camera(3).fx, 730);
  EXPECT_EQ(dataset->camera(3).cy, 507);
  for (size_t c = 0; c < 2; ++c) {
    for (size_t f = 0; f < 2; ++f) storeGrey(frameName(c, f), 0.5f, 1352, 900);
  }
  EXPECT_NE(refusal().find("is 1352 x 900 pixels"), std::string::npos) << refusal();
}

TEST_F(SeriesTest, FramesThatAreMissingStayMissingAndAreANote) {
  storeBounds(3);
  storeFrames(3, 5);
  std::filesystem::remove(path("cam01/0001.png"));
  std::filesystem::remove(path("cam01/0003.png"));
  std::filesystem::remove(path("cam02/0000.png"));
  const auto dataset = open(withFrames());
  ASSERT_EQ(dataset->count(), 12u);
  EXPECT_EQ(dataset->name(6), "cam01/0002.png");
  EXPECT_EQ(dataset->time(6), 2.0 / 30);
  ASSERT_EQ(dataset->notes().size(), 1u);
  EXPECT_NE(dataset->notes()[0].find("of 5 frames some cameras have not all: cam01 lacks 2 (1 is "
                                     "the first), cam02 lacks 1 (0 is the first)"),
            std::string::npos)
      << dataset->notes()[0];
}

TEST_F(SeriesTest, RefusesVideosWithWhatMakesImagesOfThem) {
  storeBounds(2);
  store("cam00.mp4", "video");
  store("cam01.mp4", "video");
  const std::string message = refusal();
  EXPECT_NE(message.find("holds 2 videos (cam00.mp4 is the first)"), std::string::npos) << message;
  EXPECT_NE(message.find("mkdir cam00 && ffmpeg -i cam00.mp4 -start_number 0 cam00/%04d.png"),
            std::string::npos);
  EXPECT_NE(message.find("in Blender"), std::string::npos);
}

TEST_F(SeriesTest, RefusesFoldersThatAreNotThoseOfTheCameras) {
  storeBounds(3);
  storeFrames(2, 2);
  EXPECT_NE(refusal().find("is of 3 cameras, and beside it are 2 folders of numbered images (cam00 "
                           "is the first, cam01 the last)"),
            std::string::npos)
      << refusal();
  makeFolder("cam02");
  EXPECT_NE(refusal().find("cam02 holds no numbered images"), std::string::npos) << refusal();
  storeGrey("cam02/left.png", 0.5f);
  EXPECT_NE(refusal().find("cam02 holds no numbered images"), std::string::npos);
  storeFrame(2, 0);
  EXPECT_EQ(open(withFrames())->count(), 5u);
  storeGrey("cam02/0.png", 0.5f);
  EXPECT_NE(refusal().find("holds two images of frame 0, 0.png and 0000.png"), std::string::npos)
      << refusal();
}

TEST_F(SeriesTest, RefusesAnotherSizeWithinACameraWhenTheSetIsOpened) {
  storeBounds(2);
  storeFrames(2, 4);
  storeGrey("cam01/0002.png", 0.5f, 5, 2);
  const std::string message = refusal();
  EXPECT_NE(message.find("cam01/0002.png is 5 x 2 pixels; other images of its camera are 4 x 2"),
            std::string::npos)
      << message;
}

TEST_F(SeriesTest, FindsFramesBesideTheImagesOfTransformsJson) {
  storeRow(2);
  storeFrames(2, 3, "images/");
  EXPECT_EQ(open({})->count(), 2u);
  const auto dataset = open(withFrames());
  ASSERT_EQ(dataset->count(), 6u);
  EXPECT_EQ(dataset->name(4), "images/cam01/0001.png");
  EXPECT_EQ(dataset->cameraName(4), "cam01");
  EXPECT_EQ(dataset->time(4), 1.0 / 30);
  EXPECT_EQ(dataset->load(4).colour[0], greyOf(1, 1));
}

TEST_F(SeriesTest, TakesTheSizeOfFramesWhereTheCamerasSayNone) {
  std::string frames;
  for (const char* name : {"cam00/0000", "cam01/0000"}) {
    frames += (frames.empty() ? "" : ",") + frame(name);
  }
  storeTransforms("\"camera_angle_x\": 1, ", frames);
  storeFrames(2, 3);
  EXPECT_EQ(open(withFrames())->camera(5).width, 4u);
  storeGrey("cam01/0002.png", 0.5f, 6, 2);
  EXPECT_NE(refusal().find("cam01/0002.png is 6 x 2 pixels"), std::string::npos) << refusal();
}

TEST_F(SeriesTest, FindsFramesBesideTheImagesOfAColmapModel) {
  storeColmap("PINHOLE 4 2 3 3 2 1", {"cam00/0000.png", "cam01/0000.png"});
  storeFrames(2, 3, "images/");
  storeGrey("images/cam01/depth_0001.png", 0.5f);  // is called otherwise
  storeGrey("masks/cam01/0002.png", 0.0f);
  EXPECT_EQ(open({})->count(), 2u);
  const auto dataset = open(withFrames());
  ASSERT_EQ(dataset->count(), 6u);
  EXPECT_EQ(dataset->cameraName(0), "cam00");
  EXPECT_EQ(dataset->name(5), "cam01/0002.png");
  EXPECT_EQ(dataset->load(5).weights, std::vector<float>(8, 0.0f));
  EXPECT_TRUE(dataset->load(4).weights.empty());
}

TEST_F(SeriesTest, ACameraThatMovesListsItsFramesItself) {
  // The images of cam01 are listed one by one, those of cam00 by its first.
  storeColmap("PINHOLE 4 2 3 3 2 1", {"cam00/0000.png", "cam01/0000.png", "cam01/0002.png"});
  storeFrames(2, 3, "images/");
  const auto dataset = open(withFrames());
  ASSERT_EQ(dataset->count(), 5u);
  EXPECT_EQ(dataset->name(4), "cam01/0002.png");
  EXPECT_EQ(dataset->time(4), 2.0 / 30);
  EXPECT_EQ(dataset->cameraName(4), "cam01");
  storeColmap("PINHOLE 4 2 3 3 2 1", {"cam00/0000.png", "cam01/0000.png", "cam01/left.png"});
  storeGrey("images/cam01/left.png", 0.5f);
  EXPECT_NE(refusal().find("'cam01/left.png' does not end in the number of its frame"),
            std::string::npos)
      << refusal();
}

TEST_F(SeriesTest, TakesTimesByTheirNamesAndFramesByTheRate) {
  storeGrey("a.png", 0.5f);
  storeGrey("b.png", 0.5f);
  const auto timesOf = [&](const std::string& first, const std::string& second, double rate) {
    storeTransforms("\"fl_x\": 3, \"w\": 4, \"h\": 2, ",
                    frame("a.png", first) + "," + frame("b.png", second));
    SeriesOptions series;
    series.frame_rate = rate;
    const auto dataset = open(series);
    return std::vector<double>{dataset->time(0), dataset->time(1)};
  };
  EXPECT_EQ(timesOf("\"time\": 0.25, ", "\"time\": 1, ", 0), (std::vector<double>{0.25, 1}));
  EXPECT_EQ(timesOf("\"timestamp\": 0.25, ", "\"timestamp\": 1, ", 0),
            (std::vector<double>{0.25, 1}));
  EXPECT_EQ(timesOf("\"timestep_index\": 3, ", "\"timestep_index\": 6, ", 0),
            (std::vector<double>{0.1, 0.2}));
  EXPECT_EQ(timesOf("\"timestep_index\": 3, ", "\"timestep_index\": 6, ", 10),
            (std::vector<double>{0.3, 0.6}));
  // What is said in seconds wins.
  EXPECT_EQ(timesOf("\"time\": 0, \"timestep_index\": 3, ", "\"time\": 7, \"timestamp\": 8, ", 10),
            (std::vector<double>{0, 7}));
  EXPECT_THROW(timesOf("\"timestamp\": \"now\", ", "", 0), Error);
  EXPECT_THROW(timesOf("\"time\": 1e999, ", "", 0), Error);
  EXPECT_THROW(timesOf("\"timestep_index\": 0.5, ", "", 0), Error);
  EXPECT_THROW(timesOf("\"timestep_index\": -1, ", "", 0), Error);
  EXPECT_THROW(timesOf("\"timestep_index\": 1e12, ", "", 0), Error);
}

TEST_F(SeriesTest, ARateMakesTimesOfTheNamesOfListedImages) {
  storeColmap("PINHOLE 4 2 3 3 2 1", {"video_0003.png", "video_0006.png"});
  storeGrey("images/video_0003.png", 0.5f);
  storeGrey("images/video_0006.png", 0.5f);
  EXPECT_EQ(open({})->time(1), 0);
  SeriesOptions series;
  series.frame_rate = 60;
  EXPECT_EQ(open(series)->time(1), 0.1);
}

TEST_F(SeriesTest, ViewsOfOnePlaceAndOtherTimesAreOfOneCamera) {
  std::string frames;
  for (size_t f = 0; f < 3; ++f) {
    for (size_t c = 0; c < 2; ++c) {
      const std::string name = "t" + std::to_string(f) + "_c" + std::to_string(c) + ".png";
      storeGrey(name, 0.5f);
      frames += (frames.empty() ? "" : ",") + std::string("{\"file_path\": \"") + name +
                "\", \"time\": " + std::to_string(f) + ", \"transform_matrix\": [[1,0,0," +
                std::to_string(c) + "],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}";
    }
  }
  storeTransforms("\"fl_x\": 3, \"w\": 4, \"h\": 2, ", frames);
  const auto dataset = open({});
  EXPECT_EQ(dataset->series().camera_count, 2u);
  EXPECT_EQ(dataset->cameraName(0), dataset->cameraName(2));
  EXPECT_NE(dataset->cameraName(0), dataset->cameraName(1));
  EXPECT_EQ(dataset->cameraName(1), "t0_c1.png");
}

TEST_F(SeriesTest, ChoosesFramesByTheirNumbers) {
  storeBounds(2);
  for (size_t c = 0; c < 2; ++c) {
    for (size_t f = 1; f < 9; ++f) storeFrame(c, f);
  }
  SeriesOptions series = withFrames();
  series.last_frame = 8;
  series.frame_step = 3;
  const auto dataset = open(series);
  // From 1, the first that is there.
  ASSERT_EQ(dataset->count(), 6u);
  EXPECT_EQ(dataset->name(1), "cam00/0004.png");
  EXPECT_EQ(dataset->name(2), "cam00/0007.png");
  EXPECT_EQ(dataset->series().image_count, 16u);
  series.first_frame = 3;
  series.last_frame = 4;
  series.frame_step = 1;
  EXPECT_EQ(open(series)->count(), 4u);
  series.first_frame = 10;
  series.last_frame = 20;
  EXPECT_NE(refusal(series).find("frames 10 to 20 are asked for; there are frames 1 to 8"),
            std::string::npos)
      << refusal(series);
  series.last_frame = 9;
  EXPECT_NE(refusal(series).find("may not come before the first"), std::string::npos);
  series.last_frame = 20;
  series.frame_step = 0;
  EXPECT_NE(refusal(series).find("the step of frames is 0"), std::string::npos);
  series.frame_step = 1;
  for (const double rate : {-1.0, 1e-9, 1e9}) {
    series.frame_rate = rate;
    EXPECT_NE(refusal(series).find("the frame rate is"), std::string::npos) << rate;
  }
}

TEST_F(SeriesTest, CountsFramesOfGivenTimesInTheirOrder) {
  std::string frames;
  for (const char* time : {"0.9", "0.1", "0.5"}) {
    const std::string name = std::string("v") + time + ".png";
    storeGrey(name, 0.5f);
    frames += (frames.empty() ? "" : ",") + frame(name, "\"time\": " + std::string(time) + ", ");
  }
  storeTransforms("\"fl_x\": 3, \"w\": 4, \"h\": 2, ", frames);
  SeriesOptions series;
  series.first_frame = series.last_frame = 1;
  const auto dataset = open(series);
  ASSERT_EQ(dataset->count(), 1u);
  EXPECT_EQ(dataset->time(0), 0.5);
}

TEST_F(SeriesTest, HoldsOutCamerasByName) {
  storeBounds(3);
  storeFrames(3, 2);
  SeriesOptions series = withFrames();
  series.held_out_cameras = "cam00,cam02";
  const auto dataset = open(series);
  for (size_t v = 0; v < 6; ++v) {
    const bool is_held_out = dataset->cameraName(v) != "cam01";
    EXPECT_EQ(dataset->role(v), is_held_out ? ViewRole::kTest : ViewRole::kTrain) << v;
  }
  series.held_out_cameras = "cam07";
  EXPECT_NE(refusal(series).find("'cam07' is to be held out; cameras are called cam00 to cam02"),
            std::string::npos)
      << refusal(series);
  series.held_out_cameras = "cam00,cam01,cam02";
  EXPECT_NE(refusal(series).find("all 3 cameras are to be held out"), std::string::npos);
  series.held_out_cameras = "cam00,";
  EXPECT_NE(refusal(series).find("'' is to be held out"), std::string::npos);
}

TEST_F(SeriesTest, KeepsOnlyTheImagesThatFitIntoTheCache) {
  storeBounds(2);
  storeFrames(2, 6);
  DatasetOptions options;
  options.series = withFrames();
  options.cache_bytes = 3 * PackedPicture(open(withFrames())->load(0)).bytes();
  const auto dataset = openDataset(folder(), options);
  for (int round = 0; round < 2; ++round) {
    for (size_t v = 0; v < dataset->count(); ++v) {
      EXPECT_EQ(dataset->load(v).colour[0], greyOf(v / 6, v % 6));
      EXPECT_LE(dataset->cachedBytes(), options.cache_bytes);
    }
  }
  EXPECT_EQ(dataset->cachedBytes(), options.cache_bytes);
}

std::vector<SeriesPlace> grid(size_t frames, size_t cameras) {
  std::vector<SeriesPlace> places;
  for (size_t c = 0; c < cameras; ++c) {
    for (size_t f = 0; f < frames; ++f) places.push_back({f, c});
  }
  return places;
}

TEST(SeriesChoice, SpreadsEvenlyOverFramesAndCameras) {
  const std::vector<SeriesPlace> places = grid(30, 24);
  for (const uint64_t most : {1u, 7u, 24u, 30u, 60u, 100u, 360u, 719u}) {
    const std::vector<size_t> chosen = evenChoice(places, most);
    ASSERT_EQ(chosen.size(), most);
    EXPECT_TRUE(std::is_sorted(chosen.begin(), chosen.end()));
    EXPECT_EQ(std::set<size_t>(chosen.begin(), chosen.end()).size(), most);
    std::map<uint64_t, uint64_t> by_frame, by_camera;
    for (size_t f = 0; f < 30; ++f) by_frame[f] = 0;
    for (size_t c = 0; c < 24; ++c) by_camera[c] = 0;
    for (const size_t i : chosen) {
      ++by_frame[places[i].frame];
      ++by_camera[places[i].camera];
    }
    for (const auto* counts : {&by_frame, &by_camera}) {
      const auto [least, largest] =
          std::minmax_element(counts->begin(), counts->end(),
                              [](const auto& a, const auto& b) { return a.second < b.second; });
      EXPECT_LE(largest->second - least->second, 1u) << most;
    }
  }
  EXPECT_EQ(evenChoice(places, 720).size(), 720u);
  EXPECT_EQ(evenChoice(places, 1000).size(), 720u);
  EXPECT_TRUE(evenChoice({}, 5).empty());
}

TEST(SeriesChoice, FramesThatHaveFewImagesGiveTheirShare) {
  std::vector<SeriesPlace> places = grid(10, 8);
  // Frame 4 has one camera left.
  std::erase_if(places, [](const SeriesPlace& p) { return p.frame == 4 && p.camera != 2; });
  const std::vector<size_t> chosen = evenChoice(places, 36);
  ASSERT_EQ(chosen.size(), 36u);
  std::map<uint64_t, uint64_t> by_frame;
  for (const size_t i : chosen) ++by_frame[places[i].frame];
  for (size_t f = 0; f < 10; ++f) {
    if (f == 4) continue;
    EXPECT_NEAR(static_cast<double>(by_frame[f]), 8.0 * 36 / 73, 1) << f;
  }
}

TEST(SeriesPoints, AreThoseOfTheFramesThatAreUsed) {
  PointSet points;
  for (int i = 0; i < 6; ++i) {
    const auto value = static_cast<float>(i);
    points.positions.insert(points.positions.end(), {value, 0, 0});
    points.colours.insert(points.colours.end(), {value, 1, 1});
    points.opacities.push_back(1);
    points.times.push_back(i == 0 ? std::nan("") : 0.5 * i);
  }
  const auto chosen = [&](double begin, double end, double frame_seconds) {
    PointSet copy = points;
    choosePoints({.time_begin = begin, .time_end = end, .frame_seconds = frame_seconds}, copy);
    EXPECT_EQ(copy.positions.size(), 3 * copy.size());
    EXPECT_EQ(copy.colours.size(), 3 * copy.size());
    EXPECT_EQ(copy.times.size(), copy.size());
    EXPECT_TRUE(copy.normals.empty());
    std::vector<float> which;
    for (size_t i = 0; i < copy.size(); ++i) {
      which.push_back(copy.positions[i * 3]);
      EXPECT_EQ(copy.colours[i * 3], copy.positions[i * 3]);
    }
    return which;
  };
  using Which = std::vector<float>;
  EXPECT_EQ(chosen(1, 2, 0), (Which{0, 1, 2, 3, 4, 5}));  // all frames are used
  EXPECT_EQ(chosen(1, 2, 0.1), (Which{0, 2, 3, 4}));
  EXPECT_EQ(chosen(1.04, 2, 0.1), (Which{0, 2, 3, 4}));  // half a frame before
  EXPECT_EQ(chosen(1.6, 1.7, 0.1), (Which{0, 3}));  // none is inside: those of the nearest time
}

}  // namespace
}  // namespace stipple
