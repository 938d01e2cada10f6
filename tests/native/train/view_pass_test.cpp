// A strategy is told the same of a view whether a fit learns from it or it is drawn between steps.

#include "train/backend/view_pass.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "backend_case.h"
#include "fit_scene.h"
#include "train/loop/view_evaluator.h"

namespace stipple {
namespace {

using namespace stipple::testing;
using ::testing::HasSubstr;

constexpr double kGrey[3] = {0.25, 0.25, 0.25};

/// One view with a mask, half of it, whose error counts less in the other half.
std::shared_ptr<MemoryViewSource> maskedView() {
  const auto whole = viewsOf(ballOfSplats(60, 1), camerasAround(1, 48));
  auto views = std::make_shared<MemoryViewSource>(whole->colourSpace());
  ViewPicture picture = whole->load(0);
  picture.alpha.clear();
  picture.weights.assign(48 * 48, 1.0f);
  std::fill_n(picture.weights.begin(), 48 * 20, 0.25f);
  views->add(whole->camera(0), std::move(picture));
  return views;
}

StatisticRequest everything() {
  StatisticRequest request;
  request.contributions = request.blending_weights = request.screen_gradients = true;
  request.absolute_screen_gradients = request.covered = request.error_maps = true;
  request.drawn_splats = true;
  request.edge_weights.assign(48 * 48, 0.5f);
  return request;
}

struct Told {
  ViewStatistics view;
  std::vector<std::vector<float>> arrays;
  std::vector<float> image, target, weights, structure;
};

Told keptOf(const ViewStatistics& view) {
  const auto kept = [](std::span<const float> values) {
    return std::vector<float>(values.begin(), values.end());
  };
  Told told{view,
            {},
            kept(view.errors.picture),
            kept(view.errors.target),
            kept(view.errors.weights),
            kept(view.errors.structure)};
  for (const auto& array : view.arrays) told.arrays.push_back(kept(array));
  for (const auto& array :
       {view.splats.positions, view.splats.rotations, view.splats.scales, view.splats.opacities}) {
    told.arrays.push_back(kept(array));
  }
  return told;
}

/// In: request: of the errors' map too, which `map` gets where it is called.
Told byABackend(const SplatCloud& cloud, const MemoryViewSource& views,
                const StatisticRequest& request) {
  const auto backend = makeCpuBackend();
  backend->upload(cloud);
  RenderOptions options;
  options.with_depth = false;
  options.with_background = true;
  std::copy_n(kGrey, 3, options.background);
  const ViewPicture picture = views.load(0);
  backend->forward(views.camera(0), options);
  backend->loss(picture.colour, lossFor(request, 0.2), picture.weights);
  backend->backward(request);
  ViewStatistics statistics;
  backend->lendStatistics(statistics);
  return keptOf(statistics);
}

Told byAnEvaluator(const SplatCloud& cloud, const std::shared_ptr<MemoryViewSource>& views,
                   const StatisticRequest& request) {
  PictureStore pictures(views, 1 << 24);
  const std::vector<size_t> training = {0};
  FitViewEvaluator evaluator(
      *cpuBackends(), [&] { return cloud; }, pictures, training, kGrey, 0.2);
  return keptOf(evaluator.evaluate(0, request));
}

/// As a backend draws them: scales and opacities have been logarithms and logits.
SplatCloud roundedCloud() {
  const auto backend = makeCpuBackend();
  backend->upload(ballOfSplats(50, 3));
  return backend->download();
}

TEST(ViewPass, AStepAndALookBetweenStepsTellTheSame) {
  // The start goes through logarithms and logits once more, which change no bit the second time in
  // all but a few splats; the derivatives that a backend keeps are not compared.
  const auto views = maskedView();
  const SplatCloud cloud = roundedCloud();
  const Told step = byABackend(cloud, *views, everything());
  const Told look = byAnEvaluator(cloud, views, everything());
  EXPECT_GT(step.view.loss, 0.01);
  EXPECT_NEAR(look.view.loss, step.view.loss, 1e-6 * step.view.loss);
  EXPECT_EQ(look.view.width, step.view.width);
  EXPECT_EQ(look.view.height, step.view.height);
  EXPECT_EQ(look.view.camera, step.view.camera);
  EXPECT_EQ(look.target.size(), size_t{48} * 48 * 3);
  EXPECT_EQ(look.weights, step.weights);
  EXPECT_EQ(look.weights.size(), size_t{48} * 48);
  EXPECT_EQ(look.structure.size(), size_t{48} * 48);
  EXPECT_EQ(look.image.size(), step.image.size());
  ASSERT_EQ(look.arrays.size(), step.arrays.size());
  for (size_t k = 0; k < look.arrays.size(); ++k) {
    ASSERT_EQ(look.arrays[k].size(), step.arrays[k].size()) << k;
    double difference = 0, size = 0;
    for (size_t i = 0; i < look.arrays[k].size(); ++i) {
      difference += std::abs(static_cast<double>(look.arrays[k][i] - step.arrays[k][i]));
      size += std::abs(static_cast<double>(step.arrays[k][i]));
    }
    EXPECT_LE(difference, 1e-5 * size) << k;  // one rounding of a scale, through some 2000 pixels
  }
}

TEST(ViewPass, WhoMakesAMapOfErrorsIsShownTheMaskInBoth) {
  const auto views = maskedView();
  const SplatCloud cloud = roundedCloud();
  std::vector<std::vector<float>> shown;
  StatisticRequest request;
  request.errors_of = [&](const ViewErrors& errors) {
    shown.emplace_back(errors.weights.begin(), errors.weights.end());
    return std::vector<float>(errors.target.size() / 3, 1.0f);
  };
  byABackend(cloud, *views, request);
  byAnEvaluator(cloud, views, request);
  ASSERT_EQ(shown.size(), 2u);
  EXPECT_EQ(shown[0], views->load(0).weights);
  EXPECT_EQ(shown[1], shown[0]);
}

TEST(ViewPass, ErrorsThatAreAskedForInTwoWaysAreRefusedInBoth) {
  const auto views = maskedView();
  const SplatCloud cloud = roundedCloud();
  StatisticRequest request;
  request.structure_errors = true;
  request.errors.assign(48 * 48, 1.0f);
  EXPECT_THAT(messageOf([&] { byABackend(cloud, *views, request); }), HasSubstr("in 2 ways"));
  EXPECT_THAT(messageOf([&] { byAnEvaluator(cloud, views, request); }), HasSubstr("in 2 ways"));
}

TEST(ViewPass, PixelsThatAMaskLeavesOutCountForNothingInContributions) {
  const auto views = maskedView();
  auto dark = std::make_shared<MemoryViewSource>(views->colourSpace());
  ViewPicture picture = views->load(0);
  for (float& weight : picture.weights) weight = 0;
  dark->add(views->camera(0), std::move(picture));
  StatisticRequest request;
  request.contributions = true;
  const SplatCloud cloud = roundedCloud();
  for (const Told& told :
       {byABackend(cloud, *dark, request), byAnEvaluator(cloud, dark, request)}) {
    const auto& contributions = told.arrays[static_cast<size_t>(Statistic::kContributions)];
    ASSERT_EQ(contributions.size(), 50u);
    for (const float value : contributions) EXPECT_EQ(value, 0.0f);
  }
}

}  // namespace
}  // namespace stipple
