#include <gtest/gtest.h>

#include <cmath>

#include "densify/strategies.h"
#include "train/fit_scene.h"
#include "train/loop/densify_cloud.h"
#include "train/loop/explicit_model.h"
#include "train/loop/moving_splats.h"
#include "train/loop/picture_store.h"
#include "train/loop/view_evaluator.h"

// Fits of views that say little, wrong things or nothing, with traps on: every number stays finite.

namespace stipple {
namespace {

using namespace stipple::testing;

void expectFinite(const TensorTable& table) {
  for (const auto& [name, tensor] : table) {
    const auto* values = std::get_if<std::vector<float>>(&tensor.values);
    if (!values) continue;
    for (const float value : *values) ASSERT_TRUE(std::isfinite(value)) << name;
  }
}

/// A fit of `iterations`, of the schedule of 3000, so that edits and resets come.
std::unique_ptr<FitModel> fitted(const MemoryViewSource& views, uint64_t iterations,
                                 const ExplicitModelOptions& options = {}, double extent = 3.85) {
  auto model = makeExplicitModel(*cpuBackends(), views, allViews(views), options);
  Fit fit(views, *model, 3000);
  fit.moment().extent = extent;
  for (uint64_t done = 100; done <= iterations; done += 100) {
    EXPECT_TRUE(std::isfinite(fit.run(done).loss));
    expectFinite(model->state());
  }
  validate(model->splats(0), "fitted");
  return model;
}

std::shared_ptr<MemoryViewSource> constantViews(float colour, float alpha, size_t count) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (const Camera& camera : camerasAround(count, 24)) {
    ViewPicture picture;
    picture.width = picture.height = 24;
    picture.colour.assign(24 * 24 * 3, colour * alpha);
    picture.alpha.assign(24 * 24, alpha);
    views->add(camera, std::move(picture));
  }
  views->setPoints(pointsOf(ballOfSplats(50, 3), 0, 1));
  return views;
}

std::shared_ptr<MemoryViewSource> onePixelViews() {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (const Camera& camera : camerasAround(3, 1)) {
    ViewPicture picture;
    picture.width = picture.height = 1;
    picture.colour = {0.9f, 0.1f, 0.4f};
    views->add(camera, std::move(picture));
  }
  views->setPoints(pointsOf(ballOfSplats(50, 3), 0, 1));
  return views;
}

ExplicitModelOptions small() {
  ExplicitModelOptions options;
  options.sh_degree = 1;
  options.max_splats = 300;
  return options;
}

TEST(FittingStability, OneCameraAndNoExtent) {
  const SplatCloud truth = ballOfSplats(40, 1);
  const auto views = viewsOf(truth, camerasAround(1, 32));
  views->setPoints(pointsOf(truth, 0.02f, 2));
  const auto model = fitted(*views, 700, small(), 0.0);
  EXPECT_GT(model->splats(0).size(), 0u);
}

TEST(FittingStability, ViewsThatAreBlackOrTransparentEverywhere) {
  for (const float alpha : {1.0f, 0.0f}) {
    const auto model = fitted(*constantViews(0, alpha, 4), 700, small());
    EXPECT_GT(model->splats(0).size(), 0u);
  }
}

/// Flat pictures have no edges, and nothing pulls once they are matched.
TEST(FittingStability, FlatViewsByEveryStrategy) {
  for (const std::string& name : strategyNames()) {
    SCOPED_TRACE(name);
    ExplicitModelOptions options = small();
    options.strategy = name;
    EXPECT_GT(fitted(*constantViews(0.5f, 1, 4), 700, options)->splats(0).size(), 0u);
    EXPECT_GT(fitted(*constantViews(0.5f, 0, 1), 500, options, 0.0)->splats(0).size(), 0u);
  }
}

/// Nine splats of ten are left out of the last images, and the rest is as opaque as can be.
TEST(FittingStability, NearlyAllSplatsAreLeftOut) {
  for (const std::string& name : strategyNames()) {
    SCOPED_TRACE(name);
    ExplicitModelOptions options = small();
    options.strategy = name + "+splat_dropout(rate=0.9)";
    EXPECT_GT(fitted(*constantViews(0.5f, 1, 2), 700, options)->splats(0).size(), 0u);
    EXPECT_GT(fitted(*constantViews(0.5f, 0, 1), 500, options, 0.0)->splats(0).size(), 0u);
  }
}

/// Two views of one clip that say different things: at the same place in time almost, far away from
/// each other and from 0, and with nothing to see.
TEST(FittingStability, MovingSplatsOfHardClips) {
  for (const char* strategy : {"temporal", "frequency", "adaptive+filter_3d", "mcmc+offset_warp",
                               "temporal+splat_dropout"}) {
    for (const double apart : {1e-9, 1.0, 1e12}) {
      for (const float alpha : {0.0f, 1.0f}) {
        SCOPED_TRACE(std::string(strategy) + ", " + std::to_string(apart));
        auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
        for (size_t v = 0; v < 4; ++v) {
          const auto one = constantViews(v % 2 == 0 ? 0.2f : 0.9f, alpha, 1);
          views->add(camerasAround(4, 24)[v], one->load(0), {}, static_cast<double>(v % 2) * apart);
        }
        views->setPoints(pointsOf(ballOfSplats(50, 3), 0, 1));
        ExplicitModelOptions options = small();
        options.strategy = strategy;
        options.clip = clipOfViews(*views);
        const auto model = fitted(*views, 400, options);
        const MotionCloud moving = *motionResult(*model);
        validate(moving, "moving");
        for (const double time : {-1e300, 0.0, apart / 3, apart, 1e300}) {
          validate(splatsAt(moving, time), "at a time");
        }
      }
    }
  }
}

TEST(FittingStability, ViewsOfColoursFarAboveWhite) {
  fitted(*constantViews(1e3f, 1, 4), 400, small());
}

TEST(FittingStability, SplatsBehindEveryCamera) {
  const auto views = constantViews(0.5f, 1, 1);
  PointSet points = pointsOf(ballOfSplats(50, 3), 0, 1);
  const Vec3d behind = 3 * cameraCentre(views->camera(0));
  for (size_t i = 0; i < points.positions.size(); ++i) {
    points.positions[i] += static_cast<float>(behind[static_cast<Eigen::Index>(i % 3)]);
  }
  views->setPoints(points);
  ExplicitModelOptions options = small();
  // None beside the points.
  options.start_splats = 50;
  const auto model = fitted(*views, 200, options);  // size is not judged yet
  EXPECT_EQ(model->splats(0).size(), 50u);
  EXPECT_EQ(model->splats(0).positions, points.positions);
}

TEST(FittingStability, PointsFarFromTheOriginAndFarFromEachOther) {
  const SplatCloud truth = ballOfSplats(40, 1);
  std::vector<Camera> cameras = camerasAround(4, 24);
  SplatCloud far = truth;
  for (float& value : far.positions) value += 1e5f;
  for (Camera& camera : cameras) {
    camera.world_to_camera.topRightCorner<3, 1>() -=
        camera.world_to_camera.topLeftCorner<3, 3>() * Vec3d(1e5, 1e5, 1e5);
  }
  const auto views = viewsOf(far, cameras);
  PointSet points = pointsOf(far, 0.02f, 2);
  points.positions[0] = 1e12f;
  points.positions[4] = -1e15f;
  views->setPoints(points);
  fitted(*views, 400, small());
}

TEST(FittingStability, EveryPointAtOnePlace) {
  const auto views = constantViews(0.5f, 1, 3);
  PointSet points = pointsOf(ballOfSplats(50, 3), 0, 1);
  std::fill(points.positions.begin(), points.positions.end(), 0.25f);
  views->setPoints(points);
  fitted(*views, 400, small());
}

TEST(FittingStability, PicturesOfOnePixel) {
  const auto views = onePixelViews();
  views->setPoints({});
  fitted(*views, 300, small());
}

/// Of methods that look at further views, or whose splats are filtered.
constexpr const char* kLookingStrategies[] = {"revised", "taming", "adaptive+filter_3d",
                                              "taming+filter_3d+growth_control"};

TEST(FittingStability, StrategiesThatLookAroundWhereViewsSayNothing) {
  const double black[3] = {0, 0, 0};
  for (const char* strategy : kLookingStrategies) {
    for (const auto& views : {constantViews(0, 1, 4), constantViews(0.5f, 0, 4),
                              constantViews(1e3f, 1, 1), onePixelViews()}) {
      SCOPED_TRACE(strategy);
      ExplicitModelOptions options = small();
      options.strategy = strategy;
      const std::vector<size_t> training = allViews(*views);
      const auto model = makeExplicitModel(*cpuBackends(), *views, training, options);
      PictureStore pictures(views, 1 << 20);
      FitViewEvaluator evaluator(
          *cpuBackends(), [&] { return model->splats(0); }, pictures, training, black, 0.2);
      Fit fit(*views, *model, 3000);
      for (uint64_t iteration = 1; iteration <= 410; ++iteration) {
        evaluator.forgetSplats();
        EXPECT_TRUE(std::isfinite(fit.run(iteration, &evaluator).loss));
      }
      expectFinite(model->state());
      validate(model->splats(0), "fitted");
    }
  }
}

TEST(FittingStability, FinishedSplatsOfAnySizeAreDensified) {
  SplatCloud cloud = ballOfSplats(50, 3);
  std::fill_n(&cloud.scales[0], 3, 1e-30f);
  std::fill_n(&cloud.scales[3], 3, 1e20f);
  cloud.scales[6] = 1e3f;
  cloud.scales[7] = 1e-6f;
  cloud.opacities[9] = 0.0f;
  cloud.opacities[10] = 1.0f;
  for (const char* strategy : kLookingStrategies) {
    for (const auto& views : {constantViews(0, 1, 4), constantViews(1e3f, 1, 1), onePixelViews()}) {
      SCOPED_TRACE(strategy);
      DensifyOptions options;
      options.strategy = strategy;
      options.event_count = 2;
      const SplatCloud made = densifyCloud(*cpuBackends(), cloud, views, allViews(*views), options);
      validate(made, "densified");
      EXPECT_LE(made.size(), 100u);
    }
  }
}

}  // namespace
}  // namespace stipple
