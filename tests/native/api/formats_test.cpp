#include <stdlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "api/fixtures.h"

namespace stipple::test {
namespace {

class Formats : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    std::string pattern = (std::filesystem::temp_directory_path() / "stipple_api_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  void TearDown() override {
    std::filesystem::remove_all(folder_);
    ApiTest::TearDown();
  }
  std::string path(const char* name) const { return (folder_ / name).string(); }
  std::string formatOf(const std::string& file) const {
    uint64_t index = 0;
    uint64_t count = 0;
    STIPPLE_EXPECT_OK(stipple_format_count(&count));
    STIPPLE_EXPECT_OK(stipple_format_of_file(file.c_str(), &index));
    if (index == count) return "";
    auto info = sized<StippleFormatInfo>();
    STIPPLE_EXPECT_OK(stipple_format_info(index, &info));
    return info.name;
  }

  std::filesystem::path folder_;
};

TEST_F(Formats, AreToldByContent) {
  StippleCloud* cloud = oneSplat(1, 0, 0);
  const char* const kFiles[][2] = {{"a.glb", "gltf"},    {"a.gltf", "gltf"}, {"a.sog", "sog"},
                                   {"meta.json", "sog"}, {"a.ply", "ply"},   {"a.splat", "splat"}};
  for (const auto& [name, format] : kFiles) {
    STIPPLE_ASSERT_OK(stipple_cloud_save(cloud, path(name).c_str(), nullptr));
    EXPECT_EQ(formatOf(path(name)), format) << name;
  }
  std::filesystem::rename(path("a.glb"), path("renamed"));
  EXPECT_EQ(formatOf(path("renamed")), "gltf");
  // A glTF file that does not name the extension holds meshes.
  std::ofstream(path("mesh.gltf")) << R"({"asset": {"version": "2.0"}, "meshes": []})";
  EXPECT_EQ(formatOf(path("mesh.gltf")), "");
  uint64_t index = 0;
  EXPECT_EQ(stipple_format_of_file(path("missing.ply").c_str(), &index), STIPPLE_ERROR_IO);
  EXPECT_EQ(stipple_format_of_file(nullptr, &index), STIPPLE_ERROR_INVALID_ARGUMENT);
  stipple_cloud_free(cloud);
}

TEST_F(Formats, SayWhatTheyKeepAndHowLargeFilesWillBe) {
  uint64_t count = 0;
  STIPPLE_ASSERT_OK(stipple_format_count(&count));
  for (uint64_t i = 0; i < count; ++i) {
    auto info = sized<StippleFormatInfo>();
    STIPPLE_ASSERT_OK(stipple_format_info(i, &info));
    uint64_t bytes = 1;
    StippleCloudSaveOptions options;
    stipple_cloud_save_options_init(&options);
    STIPPLE_ASSERT_OK(stipple_format_estimate(i, 1000, 3, &options, &bytes));
    EXPECT_EQ(bytes > 0, info.can_write == 1) << info.name;
    if (std::string(info.name) == "splat") {
      EXPECT_EQ(bytes, 32000u);
      EXPECT_EQ(info.keeps_frame + info.keeps_colour_space + info.keeps_antialias, 0u);
    }
    if (std::string(info.name) == "ply") {
      EXPECT_EQ(info.keeps_frame + info.keeps_colour_space + info.keeps_antialias, 3u);
      uint64_t plain = 0;
      options.sh_degree_limit = 0;
      STIPPLE_ASSERT_OK(stipple_format_estimate(i, 1000, 3, &options, &plain));
      EXPECT_LT(plain, bytes / 3);
    }
  }
  uint64_t bytes = 0;
  EXPECT_EQ(stipple_format_estimate(count, 1, 0, nullptr, &bytes), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(stipple_format_estimate(0, 1, 5, nullptr, &bytes), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(stipple_format_estimate(0, 1, 0, nullptr, nullptr), STIPPLE_ERROR_INVALID_ARGUMENT);
}

TEST_F(Formats, LevelsAreSavedAndTheFinestIsRead) {
  StippleCloud* fine = oneSplat(1, 0, 0);
  StippleCloud* coarse = oneSplat(0, 1, 0);
  const StippleCloud* levels[] = {fine, coarse};
  const std::string file = path("lod-meta.json");
  STIPPLE_ASSERT_OK(stipple_cloud_save_levels(levels, 2, coarse, file.c_str(), nullptr));
  StippleCloud* back = nullptr;
  STIPPLE_ASSERT_OK(stipple_cloud_load(context_, file.c_str(), &back));
  auto info = sized<StippleCloudInfo>();
  STIPPLE_ASSERT_OK(stipple_cloud_info(back, &info));
  EXPECT_EQ(info.count, 2u);  // the finest level's, and the environment's
  float sh[6] = {};
  auto buffers = sized<StippleCloudBuffers>();
  buffers.capacity = 2;
  buffers.sh = sh;
  STIPPLE_ASSERT_OK(stipple_cloud_read(back, &buffers));
  EXPECT_GT(sh[0], sh[1]);
  EXPECT_LT(sh[3], sh[4]);
  EXPECT_EQ(stipple_cloud_save_levels(levels, 0, nullptr, file.c_str(), nullptr),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  const StippleCloud* missing[] = {fine, nullptr};
  EXPECT_EQ(stipple_cloud_save_levels(missing, 2, nullptr, file.c_str(), nullptr),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(stipple_last_error_message()).find("levels[1]"), std::string::npos);
  for (StippleCloud* cloud : {fine, coarse, back}) stipple_cloud_free(cloud);
}

TEST_F(Formats, HoldSplatsAtTimesAndGiveThemBack) {
  const std::string file = path("walk.usdz");
  StippleSeriesWriter* writer = nullptr;
  STIPPLE_ASSERT_OK(stipple_series_writer_create(context_, file.c_str(), 12.5, nullptr, &writer));
  const auto red = [](const StippleCloud* cloud) {
    float sh[3] = {};
    auto buffers = sized<StippleCloudBuffers>();
    buffers.capacity = 1;
    buffers.sh = sh;
    STIPPLE_EXPECT_OK(stipple_cloud_read(cloud, &buffers));
    return sh[0];
  };
  float reds[2] = {};
  for (const size_t i : {0u, 1u}) {
    StippleCloud* cloud = oneSplat(0.25f + 0.5f * static_cast<float>(i), 0, 0);
    reds[i] = red(cloud);
    STIPPLE_EXPECT_OK(stipple_series_writer_add(writer, cloud, 3.0 + static_cast<double>(i)));
    stipple_cloud_free(cloud);
  }
  EXPECT_NE(reds[0], reds[1]);
  STIPPLE_ASSERT_OK(stipple_series_writer_finish(writer));
  stipple_series_writer_free(writer);
  StippleSeriesReader* reader = nullptr;
  STIPPLE_ASSERT_OK(stipple_series_reader_create(context_, file.c_str(), &reader));
  auto info = sized<StippleSeriesInfo>();
  STIPPLE_ASSERT_OK(stipple_series_reader_info(reader, &info));
  EXPECT_EQ(info.frame_count, 2u);
  EXPECT_EQ(info.frames_per_second, 12.5);
  double frame = 0;
  StippleCloud* cloud = nullptr;
  for (const uint64_t index : {1u, 0u}) {
    STIPPLE_ASSERT_OK(stipple_series_reader_read(reader, index, &frame, &cloud));
    EXPECT_EQ(frame, 3.0 + static_cast<double>(index));
    EXPECT_EQ(red(cloud), reds[index]);
    stipple_cloud_free(cloud);
  }
  EXPECT_EQ(stipple_series_reader_read(reader, 2, &frame, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(stipple_series_reader_read(reader, 0, nullptr, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT);
  stipple_series_reader_free(reader);
  stipple_series_reader_free(nullptr);
  EXPECT_EQ(stipple_series_reader_create(context_, path("gone.usda").c_str(), &reader),
            STIPPLE_ERROR_IO);
}

TEST_F(Formats, ThatHoldNoTimesAreNoSeriesAndAStillFileIsOneFrame) {
  StippleCloud* cloud = oneSplat(5, 0, 0);
  for (const char* name : {"still.ply", "still.usda"}) {
    STIPPLE_ASSERT_OK(stipple_cloud_save(cloud, path(name).c_str(), nullptr));
  }
  stipple_cloud_free(cloud);
  StippleSeriesReader* reader = nullptr;
  EXPECT_EQ(stipple_series_reader_create(context_, path("still.ply").c_str(), &reader),
            STIPPLE_ERROR_UNSUPPORTED);
  EXPECT_NE(std::string(stipple_last_error_message()).find("still.ply"), std::string::npos);
  STIPPLE_ASSERT_OK(stipple_series_reader_create(context_, path("still.usda").c_str(), &reader));
  auto info = sized<StippleSeriesInfo>();
  STIPPLE_ASSERT_OK(stipple_series_reader_info(reader, &info));
  EXPECT_EQ(info.frame_count, 0u);
  double frame = 9;
  STIPPLE_ASSERT_OK(stipple_series_reader_read(reader, 0, &frame, &cloud));
  EXPECT_EQ(frame, 0.0);
  auto found = sized<StippleCloudInfo>();
  STIPPLE_ASSERT_OK(stipple_cloud_info(cloud, &found));
  EXPECT_EQ(found.count, 1u);
  stipple_cloud_free(cloud);
  EXPECT_EQ(stipple_series_reader_read(reader, 1, &frame, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT);
  stipple_series_reader_free(reader);
}

}  // namespace
}  // namespace stipple::test
