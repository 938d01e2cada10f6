#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>

#include "base/error.h"
#include "io/reports/fit_report.h"
#include "measure/fit_accuracy.h"
#include "measure/picture_accuracy.h"
#include "measure/volume_accuracy.h"
#include "splat/random_scene.h"

// Small subjects, measured once: what the rows say of errors and counts; times are only sane.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::randomCloud;

Instances placed(size_t count) {
  CloudRecipe recipe;
  recipe.count = count;
  recipe.degree = 2;
  Instances made;
  made.shares.push_back(std::make_shared<const SplatCloud>(randomCloud(recipe, 8)));
  made.list.push_back(testing::instanceOf(*made.shares[0]));
  return made;
}

/// Counts what is drawn through it.
class CountedImages final : public ImageRendererFactory {
 public:
  std::unique_ptr<ImageRenderer> makeImageRenderer() const override {
    return std::make_unique<Counting>(drawn);
  }
  mutable int drawn = 0;

 private:
  class Counting final : public ImageRenderer {
   public:
    explicit Counting(int& drawn) : drawn_(drawn) {}
    void render(std::span<const SplatInstance> instances, const Camera& camera,
                const RenderOptions& options, const RenderAccuracy& accuracy, RenderResult& result,
                Progress* progress) override {
      ++drawn_;
      images_->render(instances, camera, options, accuracy, result, progress);
    }
    void order(std::span<const SplatInstance> instances, const Camera& camera,
               const DrawOrderOutput& output, Progress* progress) override {
      images_->order(instances, camera, output, progress);
    }
    uint64_t memoryBytes() const override { return images_->memoryBytes(); }

   private:
    int& drawn_;
    std::unique_ptr<ImageRenderer> images_ = makeCpuImageRenderer();
  };
};

TEST(PictureAccuracy, TheReferenceIsLastAndCutsHaveFewerSplats) {
  const Instances instances = placed(200);
  const Camera camera = frontCamera(70, 50, 60, 4);
  PictureAccuracyOptions options;
  options.accuracies = {accuracyOf(AccuracyLevel::kDraft), accuracyOf(AccuracyLevel::kFinal)};
  options.timing.repetitions = 2;
  options.reference_pixels = 0;
  ShotSettings shot;
  takeOutput(OutputColour::kComposited, instances, shot);
  validate(options, instances, camera);
  Progress progress;
  const CountedImages images;
  const MeasuredAccuracy made = measurePicture(images, instances, camera, shot, options, progress);
  // Of two settings, each drawn once to be compared and twice to be timed; the reference is not
  // the backend's.
  EXPECT_EQ(images.drawn, 6);
  ASSERT_EQ(made.report.rows.size(), 3u);
  ASSERT_EQ(made.accuracies.size(), 3u);
  EXPECT_EQ(made.report.compared_pixels, 70u * 50u);
  EXPECT_EQ(made.report.rows[0].name, "draft");
  EXPECT_EQ(made.report.rows[0].splat_count, 50u);
  EXPECT_EQ(made.report.rows[1].repetitions, 2u);
  EXPECT_EQ(made.report.rows[2].name, "reference");
  EXPECT_TRUE(std::isinf(made.report.rows[2].psnr));
  EXPECT_EQ(made.accuracies[2].level, AccuracyLevel::kReference);
  EXPECT_GT(made.report.rows[1].psnr, made.report.rows[0].psnr);
  for (const AccuracyRow& row : made.report.rows) EXPECT_GT(row.seconds, 0) << row.name;
}

TEST(PictureAccuracy, UsualSettingsFollowRaysWhereThereIsNoImagePlane) {
  const Camera flat = frontCamera(64, 64, 60, 4);
  Camera panorama = flat;
  panorama.model = CameraModel::kEquirectangular;
  const Instances instances = placed(5);
  EXPECT_EQ(usualAccuracies(instances, flat).size(), 14u);
  const std::vector<AccuracySettings> along_rays = usualAccuracies(instances, panorama);
  EXPECT_LT(along_rays.size(), 14u) << "what is the same along rays comes once";
  for (const AccuracySettings& accuracy : along_rays) {
    EXPECT_EQ(accuracy.projection, RayProjection::kRay);
  }
  PictureAccuracyOptions options;
  options.accuracies = usualAccuracies(instances, flat);
  EXPECT_THROW(validate(options, placed(5), panorama), Error);
  EXPECT_THROW(validate(options, Instances{}, flat), Error);
}

TEST(PictureAccuracy, SplatsWithoutHarmonicsHaveNoSettingOfTheirDegree) {
  const Camera camera = frontCamera(64, 64, 60, 4);
  const auto names = [&](int degree) {
    CloudRecipe recipe;
    recipe.count = 5;
    recipe.degree = degree;
    Instances made;
    made.shares.push_back(std::make_shared<const SplatCloud>(randomCloud(recipe, 8)));
    made.list.push_back(testing::instanceOf(*made.shares[0]));
    std::vector<std::string> found;
    for (const auto& accuracy : usualAccuracies(made, camera)) {
      found.push_back(accuracyName(accuracy));
    }
    return found;
  };
  EXPECT_EQ(std::ranges::count(names(1), "final + degree 0"), 1);
  EXPECT_EQ(std::ranges::count(names(0), "final + degree 0"), 0);
}

/// Splats in one corner of the image: where they overlap, orders differ; blocks that are spread
/// over the image meet the corner or miss it.
TEST(PictureAccuracy, AFewBlocksSayOfAWholeImageWhatAllPixelsSay) {
  CloudRecipe recipe;
  recipe.count = 400;
  recipe.degree = 0;
  SplatCloud cloud = randomCloud(recipe, 8);
  const float corner[3] = {0.55f, 0.3f, 0.0f};
  for (size_t i = 0; i < cloud.positions.size(); ++i) {
    cloud.positions[i] = 0.25f * cloud.positions[i] + corner[i % 3];
    cloud.scales[i] *= 0.5f;
  }
  Instances instances;
  instances.shares.push_back(std::make_shared<const SplatCloud>(std::move(cloud)));
  instances.list.push_back(testing::instanceOf(*instances.shares[0]));
  const Camera camera = frontCamera(512, 320, 400, 4);
  ShotSettings shot;
  takeOutput(OutputColour::kComposited, instances, shot);
  PictureAccuracyOptions options;
  options.accuracies = usualAccuracies(instances, camera);
  options.timing.repetitions = 1;
  options.timing.most_seconds = 1e-6;  // double precision is drawn in the blocks alone
  const auto measured = [&](uint64_t pixels) {
    options.reference_pixels = pixels;
    Progress progress;
    return measurePicture(CountedImages(), instances, camera, shot, options, progress).report;
  };
  const AccuracyReport all = measured(0), some = measured(4 * 64 * 64);
  ASSERT_EQ(some.compared_pixels, 4u * 64 * 64);
  ASSERT_EQ(all.rows.size(), some.rows.size());
  EXPECT_TRUE(std::ranges::any_of(some.rows, [](const AccuracyRow& row) {
    return row.is_estimated && row.name == "final + precision double";
  }));
  for (size_t i = 0; i < all.rows.size(); ++i) {
    if (all.rows[i].psnr > 60) continue;  // closer to the reference than its stand-in: blocks judge
    // The stand-in is 25 dB closer to the reference: its share of the mean square is a percent.
    EXPECT_NEAR(some.rows[i].psnr, all.rows[i].psnr, 0.2) << all.rows[i].name;
  }
}

TEST(VolumeAccuracy, TheFinestJudgesTheOthersAndIsLast) {
  const Instances instances = placed(30);
  VolumeAccuracyOptions options;
  options.finest.resolution = 24;
  options.timing.repetitions = 1;
  validate(options, instances);
  Progress progress;
  const AccuracyReport report = measureVolume(instances, options, UINT64_MAX, progress);
  ASSERT_EQ(report.rows.size(), 7u);
  EXPECT_TRUE(std::isinf(report.rows.back().psnr));
  for (size_t i = 0; i + 1 < report.rows.size(); ++i) {
    EXPECT_GT(report.rows[i].value, report.rows[i + 1].value) << "voxels get finer";
    EXPECT_LT(report.rows[i].splat_count, report.rows[i + 1].splat_count);
    EXPECT_TRUE(std::isfinite(report.rows[i].psnr));
  }
  EXPECT_THROW(validate(options, Instances{}), Error);
}

TEST(FitAccuracy, OnlyMeasurementsThatBroughtSomethingAreOnTheFront) {
  FitHistory history;
  history.records.resize(3);
  for (FitRecord& record : history.records) record.render_seconds = 1.0f;
  for (const auto& [iteration, psnr] : {std::pair{1u, 20.0}, {2u, 19.0}, {3u, 25.0}}) {
    FitMeasure measure;
    measure.iteration = iteration;
    measure.psnr = psnr;
    measure.splat_count = 10;
    history.measures.push_back(measure);
  }
  const std::string path = (std::filesystem::temp_directory_path() /
                            ("stipple_fit_accuracy_" + std::to_string(getpid()) + ".json"))
                               .string();
  writeFitReport({"explicit", "adaptive", "{}"}, history, path);
  const AccuracyReport report = fitAccuracy(path);
  std::filesystem::remove(path);
  ASSERT_EQ(report.rows.size(), 3u);
  EXPECT_TRUE(report.rows[0].is_on_front);
  EXPECT_FALSE(report.rows[1].is_on_front);
  EXPECT_TRUE(report.rows[2].is_on_front);
  EXPECT_NEAR(report.rows[2].seconds, 3, 1e-5);
  EXPECT_EQ(report.rows[2].repetitions, 1u);
}

}  // namespace
}  // namespace stipple
