#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "fit_views.h"

namespace stipple::test {
namespace {

namespace fs = std::filesystem;

TEST_F(FitTest, FitsPicturesAndReports) {
  StippleJob* job = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  const StippleFitFigures figures = figuresOf(job);
  EXPECT_EQ(figures.iteration, 60u);
  EXPECT_EQ(figures.measured_on_training, 0u);
  EXPECT_GT(figures.best_psnr, 15);
  EXPECT_GT(figures.best_iteration, 0u);
  EXPECT_GT(figures.estimated_seconds, 0);
  EXPECT_GT(figures.estimated_bytes, 0u);
  EXPECT_FALSE(result(job).empty());
  STIPPLE_ASSERT_OK(stipple_fit_report_save(job, path("r.json").c_str()));
  std::ifstream json(path("r.json")), svg(path("r.svg"));
  const std::string text((std::istreambuf_iterator<char>(json)), {});
  EXPECT_NE(text.find("\"strategy\": \"adaptive\""), std::string::npos);
  EXPECT_NE(text.find("\"iterations\": 60"), std::string::npos);
  EXPECT_TRUE(svg.good());
  uint32_t width = 0, height = 0;
  STIPPLE_ASSERT_OK(stipple_fit_report_draw(job, 1, 0, nullptr, &width, &height));
  EXPECT_EQ(width, 960u);
  std::vector<float> pixels(4 * size_t{width} * height, -1.0f);
  expectRefused(stipple_fit_report_draw(job, 1, pixels.size() - 1, pixels.data(), &width, &height),
                STIPPLE_ERROR_BUFFER_TOO_SMALL, "the image needs");
  STIPPLE_ASSERT_OK(stipple_fit_report_draw(job, 1, pixels.size(), pixels.data(), &width, &height));
  EXPECT_EQ(*std::max_element(pixels.begin(), pixels.end()), 1.0f);
  EXPECT_EQ(*std::min_element(pixels.begin(), pixels.end()), 0.0f);
  expectRefused(stipple_fit_report_draw(job, 0, 0, nullptr, &width, &height),
                STIPPLE_ERROR_INVALID_ARGUMENT, "scale");
  StippleModel* model = nullptr;
  EXPECT_EQ(stipple_job_model(job, &model), STIPPLE_ERROR_INVALID_ARGUMENT);
  expectRefused(stipple_fit_model(job, &model), STIPPLE_ERROR_UNSUPPORTED,
                "the explicit model has no field");
  stipple_job_free(job);
}

TEST_F(FitTest, ACancelKeepsTheBestAndAPreviewIsThere) {
  options_.iterations = 1000000;
  StippleJob* job = start();
  StippleCloud* preview = nullptr;
  for (int i = 0; i < 20000 && !preview; ++i) {
    STIPPLE_ASSERT_OK(stipple_fit_preview(job, &preview));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ASSERT_NE(preview, nullptr);
  EXPECT_GT(figuresOf(job).preview_iteration, 0u);
  stipple_cloud_free(preview);
  waitForIteration(job, 15);
  STIPPLE_ASSERT_OK(stipple_job_cancel(job));
  EXPECT_EQ(stipple_job_wait(job), STIPPLE_ERROR_CANCELLED);
  EXPECT_GT(figuresOf(job).best_psnr, 5);
  EXPECT_FALSE(result(job).empty());
  STIPPLE_EXPECT_OK(stipple_fit_report_save(job, path("r.json").c_str()));
  stipple_job_free(job);
}

/// What is known of each splat of a cloud.
std::vector<float> quantityOf(const StippleCloud* cloud, StippleSplatQuantity quantity) {
  uint64_t count = 0;
  STIPPLE_EXPECT_OK(stipple_cloud_quantity(cloud, quantity, 0, nullptr, &count));
  std::vector<float> values(count);
  STIPPLE_EXPECT_OK(stipple_cloud_quantity(cloud, quantity, count, values.data(), &count));
  return values;
}

TEST_F(FitTest, TellsWhatDensityControlSawOfTheResult) {
  options_.iterations = 300;
  StippleJob* job = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  StippleCloud* cloud = nullptr;
  STIPPLE_ASSERT_OK(stipple_fit_cloud(job, 0, &cloud));
  auto info = sized<StippleCloudInfo>();
  STIPPLE_ASSERT_OK(stipple_cloud_info(cloud, &info));
  const std::vector<float> ages = quantityOf(cloud, STIPPLE_QUANTITY_AGE);
  ASSERT_EQ(ages.size(), info.count);
  const float oldest = *std::max_element(ages.begin(), ages.end());
  EXPECT_GT(oldest, 0);
  EXPECT_LT(oldest, 300);
  EXPECT_GE(*std::min_element(ages.begin(), ages.end()), 0);
  EXPECT_EQ(quantityOf(cloud, STIPPLE_QUANTITY_SCORE).size(), info.count);
  EXPECT_EQ(quantityOf(cloud, STIPPLE_QUANTITY_SPLIT_AXIS).size(), 3 * info.count);
  // No view has more than all its pixels, which splats and what is behind them share.
  const std::vector<float> pixels = quantityOf(cloud, STIPPLE_QUANTITY_CONTRIBUTION);
  ASSERT_EQ(pixels.size(), info.count);
  double sum = 0;
  for (const float one : pixels) sum += static_cast<double>(one);
  EXPECT_GT(sum, 1);
  EXPECT_LT(sum, 1.0001 * 64 * 48);  // sums of floats
  uint64_t count = 0;
  float value = -1;
  expectRefused(stipple_cloud_quantity(cloud, STIPPLE_QUANTITY_AGE, info.count - 1, &value, &count),
                STIPPLE_ERROR_BUFFER_TOO_SMALL, "floats; ");
  EXPECT_EQ(count, info.count);
  EXPECT_EQ(value, -1);
  expectRefused(stipple_cloud_quantity(cloud, 4, 0, nullptr, &count),
                STIPPLE_ERROR_INVALID_ARGUMENT, "quantity is 4");
  stipple_cloud_free(cloud);
  stipple_job_free(job);
}

TEST_F(FitTest, PreviewsTellContributionsWhereTheyAreWatched) {
  options_.iterations = 1000000;
  StippleJob* job = start();
  expectRefused(stipple_fit_watch_contributions(job, 2), STIPPLE_ERROR_INVALID_ARGUMENT, "watched");
  const auto preview = [&] {
    StippleCloud* cloud = nullptr;
    for (int i = 0; i < 20000 && !cloud; ++i) {
      STIPPLE_EXPECT_OK(stipple_fit_preview(job, &cloud));
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return cloud;
  };
  StippleCloud* cloud = preview();
  ASSERT_NE(cloud, nullptr);
  EXPECT_FALSE(quantityOf(cloud, STIPPLE_QUANTITY_AGE).empty());
  EXPECT_TRUE(quantityOf(cloud, STIPPLE_QUANTITY_CONTRIBUTION).empty());
  stipple_cloud_free(cloud);
  STIPPLE_ASSERT_OK(stipple_fit_watch_contributions(job, 1));
  std::vector<float> pixels;
  for (int i = 0; i < 2000 && pixels.empty(); ++i) {
    cloud = preview();
    pixels = quantityOf(cloud, STIPPLE_QUANTITY_CONTRIBUTION);
    stipple_cloud_free(cloud);
  }
  EXPECT_FALSE(pixels.empty());
  STIPPLE_ASSERT_OK(stipple_job_cancel(job));
  stipple_job_free(job);
}

TEST_F(FitTest, PreviewsOfSplatsThatMoveShowTheTimeThatIsWatched) {
  options_.model = STIPPLE_FIT_MOTION;
  options_.iterations = 1000000;
  StippleJob* job = nullptr;
  expectRefused(stipple_fit_start(context_, views_, &options_, &job),
                STIPPLE_ERROR_INVALID_ARGUMENT, "all views have the same time");
  StippleViews* moving = nullptr;
  STIPPLE_ASSERT_OK(stipple_views_create(context_, STIPPLE_COLOUR_DISPLAY, &moving));
  addViews(moving, 1.0f, 0.25, false);
  STIPPLE_ASSERT_OK(stipple_fit_start(context_, moving, &options_, &job));
  expectRefused(stipple_fit_watch_time(job, std::nan("")), STIPPLE_ERROR_INVALID_ARGUMENT,
                "the time of previews");
  /// Opacities [3], made after it was called.
  const auto opacities = [&] {
    const uint64_t before = figuresOf(job).preview_iteration;
    std::vector<float> found;
    for (int i = 0; i < 20000; ++i) {
      StippleCloud* cloud = nullptr;
      STIPPLE_EXPECT_OK(stipple_fit_preview(job, &cloud));
      // The one that was under way may be of the time before.
      if (cloud && figuresOf(job).preview_iteration > before + 3) {
        const std::vector<float> all = taken(cloud);
        found.assign(all.begin() + 10 * 3, all.begin() + 11 * 3);
        return found;
      }
      stipple_cloud_free(cloud);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return found;
  };
  // Steps change nothing, so only the time does.
  const std::vector<float> at_begin = opacities();
  EXPECT_EQ(opacities(), at_begin);
  STIPPLE_ASSERT_OK(stipple_fit_watch_time(job, 11 * 0.25));
  const std::vector<float> at_end = opacities();
  ASSERT_EQ(at_end.size(), 3u);
  ASSERT_EQ(at_begin.size(), 3u);
  // One that has its moment at an end keeps 44 % of its opacity to the other.
  double most = 0;
  for (size_t i = 0; i < 3; ++i) {
    const double begin = static_cast<double>(at_begin[i]), end = static_cast<double>(at_end[i]);
    most = std::max(most, std::abs(end - begin) / std::max(begin, end));
  }
  EXPECT_GT(most, 0.3);
  STIPPLE_ASSERT_OK(stipple_job_cancel(job));
  stipple_job_free(job);
  stipple_views_free(moving);
}

TEST_F(FitTest, MeasuresWhereAViewSaysThatSomethingMoves) {
  options_.iterations = 5;
  const StippleCamera camera = frontCamera();
  const size_t pixels = size_t{camera.width} * camera.height;
  const std::vector<float> white(pixels * 4, 1.0f);
  std::vector<uint8_t> corner(pixels);
  corner[0] = 255;
  auto picture = sized<StippleViewImage>();
  picture.rgba = white.data();
  picture.split = STIPPLE_VIEW_SPLIT_TEST;
  picture.moving = corner.data();
  picture.camera_utf8 = "held out";
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera, &picture, "last"));
  StippleJob* job = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  // No splat is in the corner: black before white.
  EXPECT_NEAR(figuresOf(job).best_moving_psnr, 0.0, 0.01);
  EXPECT_GT(figuresOf(job).best_psnr, 0.05);
  stipple_job_free(job);

  // A caller that was built before: whatever lies behind his struct is not read.
  StippleViews* older = nullptr;
  STIPPLE_ASSERT_OK(stipple_views_create(context_, STIPPLE_COLOUR_DISPLAY, &older));
  addViews(older, 1.0f);
  picture.struct_size = offsetof(StippleViewImage, camera_utf8);
  STIPPLE_ASSERT_OK(stipple_views_add(older, &camera, &picture, "last"));
  std::swap(views_, older);
  job = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  EXPECT_TRUE(std::isnan(figuresOf(job).best_moving_psnr));
  stipple_job_free(job);
  stipple_views_free(older);
}

TEST_F(FitTest, ResumesBitForBit) {
  options_.iterations = 40;
  StippleJob* whole = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(whole));
  const std::vector<float> wanted = result(whole);
  stipple_job_free(whole);

  const std::string checkpoint = path("a.checkpoint.safetensors");
  options_.checkpoint_path_utf8 = checkpoint.c_str();
  options_.checkpoint_interval = 20;
  StippleJob* first = start();
  waitForIteration(first, 20);
  stipple_job_free(first);  // cancels, and saves where it stood
  ASSERT_TRUE(fs::exists(checkpoint));
  options_.resume = 1;
  StippleJob* second = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(second));
  EXPECT_EQ(result(second), wanted);
  stipple_job_free(second);

  options_.seed = 5;
  StippleJob* other = start();
  expectRefused(stipple_job_wait(other), STIPPLE_ERROR_INVALID_ARGUMENT,
                "a fit whose seed was 0; now it is 5");
  stipple_job_free(other);
  options_.seed = 0;
  fs::resize_file(checkpoint, fs::file_size(checkpoint) / 2);
  other = start();
  expectRefused(stipple_job_wait(other), STIPPLE_ERROR_FORMAT, "a.checkpoint.safetensors");
  stipple_job_free(other);
  fs::remove(checkpoint);
  other = start();
  expectRefused(stipple_job_wait(other), STIPPLE_ERROR_IO, "a.checkpoint.safetensors");
  StippleCloud* cloud = nullptr;
  expectRefused(stipple_fit_cloud(other, 0, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT,
                "the fit has no result");
  stipple_job_free(other);
}

TEST_F(FitTest, ACheckpointThatCannotBeWrittenIsANote) {
  const std::string checkpoint = path("missing/a.checkpoint.safetensors");
  options_.iterations = 20;
  options_.checkpoint_path_utf8 = checkpoint.c_str();
  options_.checkpoint_interval = 5;
  StippleJob* job = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  ASSERT_EQ(figuresOf(job).note_count, 1u);
  const char* text = nullptr;
  STIPPLE_ASSERT_OK(stipple_fit_note(job, 0, &text));
  EXPECT_NE(std::strstr(text, "the checkpoint is not saved: "), nullptr) << text;
  expectRefused(stipple_fit_note(job, 1, &text), STIPPLE_ERROR_INVALID_ARGUMENT, "there are 1");
  EXPECT_FALSE(result(job).empty());
  stipple_job_free(job);
}

TEST_F(FitTest, PresetsOfFieldsDoubleTheirAnchorsAndMakeFourSplatsOfEach) {
  uint64_t anchors = 4096;
  for (const uint32_t quality : {STIPPLE_FIT_FAST, STIPPLE_FIT_BALANCED, STIPPLE_FIT_FINE_DETAIL}) {
    STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_FIELD, quality));
    EXPECT_EQ(options_.gaussians_per_anchor, 4u) << quality;
    EXPECT_EQ(options_.max_anchors, anchors *= 2) << quality;
    EXPECT_EQ(options_.min_anchors, 1024u) << quality;
  }
}

TEST_F(FitTest, AFieldIsAModelOfAnyBudget) {
  STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_FIELD, STIPPLE_FIT_FAST));
  options_.iterations = 40;
  options_.min_anchors = 16;
  options_.max_anchors = 64;
  options_.gaussians_per_anchor = 4;
  StippleJob* job = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  const std::vector<float> wanted = result(job);
  EXPECT_EQ(wanted.size(), 64u * 4 * 14);
  StippleModel* fitted = nullptr;
  STIPPLE_ASSERT_OK(stipple_fit_model(job, &fitted));
  STIPPLE_EXPECT_OK(stipple_fit_report_save(job, path("r.json").c_str()));
  stipple_job_free(job);
  const std::string file = path("f.stipple.safetensors");
  STIPPLE_ASSERT_OK(stipple_model_save(fitted, file.c_str()));
  stipple_model_free(fitted);

  StippleModel* model = nullptr;
  STIPPLE_ASSERT_OK(stipple_model_load(context_, file.c_str(), &model));
  auto info = sized<StippleModelInfo>();
  STIPPLE_ASSERT_OK(stipple_model_info(model, &info));
  EXPECT_EQ(info.kind, uint32_t{STIPPLE_MODEL_FIELD});
  EXPECT_EQ(info.min_anchors, 16u);
  EXPECT_EQ(info.max_anchors, 64u);
  EXPECT_EQ(info.gaussians_per_anchor, 4u);
  StippleDensity* density = nullptr;
  STIPPLE_EXPECT_OK(stipple_model_density(model, &density));
  stipple_density_free(density);
  StippleDecodeOptions decode;
  stipple_decode_options_init(&decode);
  for (const uint64_t anchors : {64, 10, 500}) {
    decode.anchor_count = anchors;
    StippleCloud* cloud = nullptr;
    STIPPLE_ASSERT_OK(stipple_model_decode(model, &decode, &cloud));
    auto seen = sized<StippleCloudInfo>();
    STIPPLE_ASSERT_OK(stipple_cloud_info(cloud, &seen));
    EXPECT_EQ(seen.count, anchors * 4);
    if (anchors == 64) {
      // The file has lost nothing: the same seed gives the fit's own splats.
      std::vector<float> positions(64 * 4 * 3);
      auto buffers = sized<StippleCloudBuffers>();
      buffers.capacity = 64 * 4;
      buffers.positions = positions.data();
      STIPPLE_ASSERT_OK(stipple_cloud_read(cloud, &buffers));
      EXPECT_TRUE(std::equal(positions.begin(), positions.end(), wanted.begin()));
    }
    stipple_cloud_free(cloud);
  }
  decode.gaussians_per_anchor = 5;
  StippleCloud* cloud = nullptr;
  expectRefused(stipple_model_decode(model, &decode, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT,
                "this field was learned for 4");
  stipple_model_free(model);

  // Every cut of the file is refused, and nothing crashes.
  std::ifstream in(file, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  const std::string cut = path("cut.stipple.safetensors");
  for (size_t length = 0; length < bytes.size(); length += 1 + bytes.size() / 50) {
    std::ofstream(cut, std::ios::binary) << bytes.substr(0, length);
    EXPECT_NE(stipple_model_load(context_, cut.c_str(), &model), STIPPLE_OK) << length;
  }
}

TEST_F(FitTest, AFieldIsDecodedAndHandedOverByTwoThreadsAtOnce) {
  STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_FIELD, STIPPLE_FIT_FAST));
  options_.iterations = 20;
  options_.min_anchors = 16;
  options_.max_anchors = 64;
  StippleJob* job = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  // Whoever comes first freezes the density, which the thread sanitizer watches.
  StippleModel* model = nullptr;
  std::thread other([&] { STIPPLE_EXPECT_OK(stipple_fit_model(job, &model)); });
  const std::vector<float> wanted = result(job);
  other.join();
  EXPECT_EQ(result(job), wanted);
  stipple_job_free(job);
  StippleDecodeOptions decode;
  stipple_decode_options_init(&decode);
  decode.anchor_count = 64;
  StippleCloud* cloud = nullptr;
  STIPPLE_ASSERT_OK(stipple_model_decode(model, &decode, &cloud));
  EXPECT_EQ(taken(cloud), wanted);
  stipple_model_free(model);
}

TEST_F(FitTest, AFieldHasAShellWhereItIsAskedFor) {
  STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_FIELD, STIPPLE_FIT_FAST));
  options_.iterations = 20;
  options_.min_anchors = 16;
  options_.max_anchors = 256;
  for (const uint32_t shell :
       {STIPPLE_FIT_SHELL_AUTO, STIPPLE_FIT_SHELL_ON, STIPPLE_FIT_SHELL_OFF}) {
    options_.shell = shell;
    StippleJob* job = start();
    STIPPLE_ASSERT_OK(stipple_job_wait(job));
    const std::vector<float> numbers = result(job);
    float farthest = 0;
    for (size_t i = 0; i < 256 * 4 * 3; ++i) farthest = std::max(farthest, std::abs(numbers[i]));
    // The scene is 1.5 across; its views have alpha, which tells Auto what belongs to it.
    EXPECT_EQ(farthest > 5, shell == STIPPLE_FIT_SHELL_ON) << farthest;
    stipple_job_free(job);
  }
}

TEST_F(FitTest, AFieldResumesBitForBit) {
  STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_FIELD, STIPPLE_FIT_FAST));
  options_.iterations = 60;
  options_.min_anchors = 16;
  options_.max_anchors = 64;
  options_.gaussians_per_anchor = 4;
  StippleJob* whole = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(whole));
  const std::vector<float> wanted = result(whole);
  stipple_job_free(whole);
  const std::string checkpoint = path("a.checkpoint.safetensors");
  options_.checkpoint_path_utf8 = checkpoint.c_str();
  options_.checkpoint_interval = 10;
  StippleJob* first = start();
  waitForIteration(first, 35);
  stipple_job_free(first);
  options_.resume = 1;
  StippleJob* second = start();
  STIPPLE_ASSERT_OK(stipple_job_wait(second));
  EXPECT_EQ(result(second), wanted);
  stipple_job_free(second);
}

TEST_F(FitTest, GivesTheSameBitsForAnyThreads) {
  options_.iterations = 20;
  std::vector<float> results[2];
  for (uint32_t threads = 1; threads <= 2; ++threads) {
    StippleContext* context = withThreadCount(threads);
    StippleJob* job = nullptr;
    STIPPLE_ASSERT_OK(stipple_fit_start(context, views_, &options_, &job));
    STIPPLE_ASSERT_OK(stipple_job_wait(job));
    results[threads - 1] = result(job);
    stipple_job_free(job);
    stipple_context_free(context);
  }
  EXPECT_EQ(results[0], results[1]);
}

TEST_F(FitTest, RefusesViewsThatNothingCanBeLearnedFrom) {
  StippleViews* none = nullptr;
  STIPPLE_ASSERT_OK(stipple_views_create(context_, STIPPLE_COLOUR_DISPLAY, &none));
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_fit_start(context_, none, &options_, &job));
  expectRefused(stipple_job_wait(job), STIPPLE_ERROR_INVALID_ARGUMENT, "there are no views");
  stipple_job_free(job);
  stipple_views_free(none);

  StippleViews* black = nullptr;
  STIPPLE_ASSERT_OK(stipple_views_create(context_, STIPPLE_COLOUR_DISPLAY, &black));
  addViews(black, 0);
  STIPPLE_ASSERT_OK(stipple_fit_start(context_, black, &options_, &job));
  expectRefused(stipple_job_wait(job), STIPPLE_ERROR_INVALID_ARGUMENT, "black everywhere");
  stipple_job_free(job);
  stipple_views_free(black);
}

TEST_F(FitTest, RefusesMoreMemoryThanItsLimit) {
  uint64_t bytes = 0;
  STIPPLE_ASSERT_OK(stipple_fit_memory_bound(views_, &options_, &bytes));
  EXPECT_GT(bytes, 12u * 64 * 48 * 4);
  StippleContextOptions limited;
  stipple_context_options_init(&limited);
  limited.memory_limit_bytes = bytes - 1;
  StippleContext* context = nullptr;
  STIPPLE_ASSERT_OK(stipple_context_create(&limited, &context));
  StippleJob* job = nullptr;
  expectRefused(stipple_fit_start(context, views_, &options_, &job), STIPPLE_ERROR_MEMORY_LIMIT,
                "this fit would need up to");
  stipple_context_free(context);
}

TEST_F(FitTest, OtherJobsHaveNoFigures) {
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_cloud_load_start(context_, path("none.ply").c_str(), &job));
  auto figures = sized<StippleFitFigures>();
  expectRefused(stipple_fit_figures(job, &figures), STIPPLE_ERROR_INVALID_ARGUMENT,
                "this job does not fit splats to views");
  stipple_job_free(job);
}

}  // namespace
}  // namespace stipple::test
