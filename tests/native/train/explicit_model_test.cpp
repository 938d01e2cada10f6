#include "train/loop/explicit_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/sh_degree.h"
#include "densify/strategies.h"
#include "train/allocation_count.h"
#include "train/fit_scene.h"
#include "train/sphere_views.h"

namespace stipple {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace stipple::testing;

/// 12 views of 60 splats, 64 x 64 pixels.
const SplatCloud& truth() {
  static const SplatCloud cloud = ballOfSplats(60, 1);
  return cloud;
}
const MemoryViewSource& scene() {
  static const std::shared_ptr<MemoryViewSource> views = [] {
    auto made = viewsOf(truth(), camerasAround(12, 64));
    made->setPoints(pointsOf(truth(), 0.05f, 2));
    return made;
  }();
  return *views;
}

std::unique_ptr<FitModel> startModel(const MemoryViewSource& views,
                                     const ExplicitModelOptions& options = {}) {
  return makeExplicitModel(*cpuBackends(), views, allViews(views), options);
}

ExplicitModelOptions plain() {
  ExplicitModelOptions options;
  options.sh_degree = 0;
  return options;
}

void expectSame(const TensorTable& a, const TensorTable& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [name, tensor] : a) {
    ASSERT_TRUE(b.contains(name)) << name;
    EXPECT_TRUE(tensor.values == b.at(name).values) << name;
    EXPECT_EQ(tensor.shape, b.at(name).shape) << name;
  }
}

std::string messageOf(const std::function<void()>& call, ErrorCode code) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  return "nothing thrown";
}

TEST(ExplicitModel, FitsAKnownCloudFromPointsThatAreOff) {
  const auto model = startModel(scene(), plain());
  const double before = meanPsnr(model->splats(0), scene());
  const StepReport report = Fit(scene(), *model, 1200).run(1200);
  const double after = meanPsnr(model->splats(0), scene());
  EXPECT_GT(after, before + 10);
  EXPECT_GT(after, 28);
  EXPECT_LT(report.loss, 0.05);
  EXPECT_STREQ(report.stage, "Splats");
  EXPECT_GT(report.seconds.render, 0);
  EXPECT_GT(report.seconds.optimiser, 0);
}

TEST(ExplicitModel, AdaptiveControlAddsSplatsWhereDetailIsMissing) {
  // A third of the points: what lies between has to be grown.
  ExplicitModelOptions options = plain();
  options.start_splats = 20;
  const auto model = startModel(scene(), options);
  options.max_splats = 20;
  const auto fixed = startModel(scene(), options);
  ASSERT_EQ(model->splats(0).size(), 20u);
  for (FitModel* each : {model.get(), fixed.get()}) Fit(scene(), *each, 1200).run(1200);
  EXPECT_GT(model->splats(0).size(), 60u);
  EXPECT_LT(model->splats(0).size(), 2000u);
  EXPECT_EQ(fixed->splats(0).size(), 20u);
  EXPECT_GT(meanPsnr(model->splats(0), scene()), meanPsnr(fixed->splats(0), scene()) + 3);
  EXPECT_THAT(model->budgets(), ElementsAre(model->splats(0).size()));
}

/// Looks at the ball from one side.
std::vector<Camera> camerasInFront(size_t count, uint32_t size) {
  std::vector<Camera> cameras;
  for (size_t i = 0; i < count; ++i) {
    const double turn = 2.399963 * static_cast<double>(i);
    const double aside =
        0.5 * std::sqrt((static_cast<double>(i) + 0.5) / static_cast<double>(count));
    const Vec3d place(1, aside * std::cos(turn), aside * std::sin(turn));
    cameras.push_back(lookingAtOrigin(3.5 * place.normalized(), size));
  }
  return cameras;
}

// 24.2 and 15.9 dB. Grey splats in the whole volume, which stand where pictures tell nothing, make
// 17.9 with 1333 of 2000 left, and 11.9.
TEST(ExplicitModel, FitsViewsWithoutPointsAndKeepsItsSplats) {
  for (const Behind behind : {Behind::kNothing, Behind::kPattern}) {
    std::vector<Camera> training, held_out;
    for (const Camera& camera :
         behind == Behind::kNothing ? camerasAround(30, 64) : camerasInFront(30, 64)) {
      (training.size() < 7 * (held_out.size() + 1) ? training : held_out).push_back(camera);
    }
    const auto views = sphereViews(training, behind);
    ExplicitModelOptions options = plain();
    options.start_splats = 2000;
    const auto model = startModel(*views, options);
    EXPECT_GT(model->splats(0).size(), 1800u);
    Fit fit(*views, *model, 600);
    fit.run(300);  // edits are after 100 and 200
    EXPECT_GT(model->splats(0).size(), 2000u);
    EXPECT_GT(meanPsnr(model->splats(0), *sphereViews(held_out, behind)),
              behind == Behind::kNothing ? 22.5 : 14.5);
  }
}

TEST(ExplicitModel, NeverExceedsTheHardCap) {
  ExplicitModelOptions options = plain();
  options.max_splats = 40;
  const auto model = startModel(scene(), options);
  EXPECT_EQ(model->splats(0).size(), 40u);  // of 60 points
  Fit fit(scene(), *model, 300);
  fit.moment().max_splats = 50;  // the smaller one counts
  for (uint64_t iteration = 10; iteration <= 300; iteration += 10) {
    EXPECT_LE(fit.run(iteration).splat_count, 40u);
  }
  EXPECT_EQ(model->splats(0).size(), 40u);
}

TEST(ExplicitModel, GoesOnFromItsStateBitForBit) {
  ExplicitModelOptions options;
  options.sh_degree = 1;
  const auto whole = startModel(scene(), options), half = startModel(scene(), options);
  Fit fit(scene(), *whole, 240);
  fit.run(240);
  Fit first(scene(), *half, 240);
  first.run(97);  // in the middle of a window of statistics
  const TensorTable saved = half->state();
  const auto resumed = startModel(scene(), options);
  Fit(scene(), *resumed, 240).run(11);  // whatever was there before
  resumed->restore(saved);
  expectSame(resumed->state(), saved);
  Fit second(scene(), *resumed, 240);
  second.moment().iteration = 98;
  second.run(240);
  expectSame(resumed->state(), whole->state());
  EXPECT_NE(whole->splats(0).size(), 60u);
}

TEST(ExplicitModel, GivesTheSameBitsForAnyNumberOfThreads) {
  TensorTable states[2];
  for (const unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] {
      ExplicitModelOptions options;
      options.sh_degree = 1;
      const auto model = startModel(scene(), options);
      Fit(scene(), *model, 220).run(150);  // an edit comes after 100
      states[threads - 1] = model->state();
    });
  }
  expectSame(states[0], states[1]);
}

TEST(ExplicitModel, TakesStepsWithoutAllocating) {
  const auto model = startModel(scene(), plain());
  Fit fit(scene(), *model, 1000000);  // no edit is due
  // One thread: how many are at work at once, and so want memory of their own, is then the same.
  withThreads(1, [&] {
    fit.run(12);
    const size_t before = allocationCount();
    fit.run(24);
    EXPECT_EQ(allocationCount() - before, 0u);
  });
}

TEST(ExplicitModel, HarmonicsComeOneDegreeAtATime) {
  ExplicitModelOptions options;
  options.sh_degree = 2;
  const auto model = startModel(scene(), options);
  Fit fit(scene(), *model, 300);  // a degree every 10 iterations
  const auto largest = [&](size_t begin, size_t end) {
    const SplatCloud cloud = model->splats(0);
    float value = 0;
    for (size_t i = 0; i < cloud.size(); ++i) {
      for (size_t k = begin * 3; k < end * 3; ++k) {
        value = std::max(value, std::abs(cloud.sh[i * cloud.shStride() + k]));
      }
    }
    return value;
  };
  fit.run(9);
  EXPECT_EQ(largest(1, 9), 0);
  fit.run(19);
  EXPECT_GT(largest(1, 4), 0);
  EXPECT_EQ(largest(4, 9), 0);
  fit.run(29);
  EXPECT_GT(largest(4, 9), 0);
}

TEST(ExplicitModel, PixelsOfWeightZeroTeachNothing) {
  // One splat in a corner that is masked out: a target of another colour there moves nothing.
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (const Camera& camera : camerasAround(3, 32)) {
    ViewPicture picture;
    picture.width = picture.height = 32;
    picture.colour.assign(32 * 32 * 3, 0.9f);
    picture.weights.assign(32 * 32, 0.0f);
    views->add(camera, std::move(picture));
  }
  views->setPoints(pointsOf(truth(), 0, 3));
  const auto model = startModel(*views, plain());
  const SplatCloud before = model->splats(0);
  EXPECT_EQ(Fit(*views, *model, 1000).run(5).loss, 0);
  const SplatCloud after = model->splats(0);
  EXPECT_EQ(after.positions, before.positions);
  EXPECT_EQ(after.sh, before.sh);
}

/// Notes the order of its hooks, gates steps, moves splats after them, and makes one edit.
class Noting final : public Strategy {
 public:
  std::vector<std::string>& log;
  bool gate_is_open = true;
  uint64_t appended = 0;

  explicit Noting(std::vector<std::string>& notes) : log(notes) {}
  const char* name() const override { return "noting"; }
  std::vector<ExtraParameter> parameters() const override { return {{"offset", 3, 1e-2}}; }
  std::vector<std::vector<float>> initialExtras(const RawSplats& splats) const override {
    return {std::vector<float>(splats.size() * 3, 0.0f)};
  }
  const Parameterisation* parameterisation() const override { return &offsets_; }
  StatisticRequest requests(const FitMoment&) const override {
    log.push_back("requests");
    StatisticRequest request;
    request.contributions = true;
    return request;
  }
  bool regularises(const FitMoment&) const override { return true; }
  double loss(const FitMoment&, const SplatCloud& cloud, const CloudGradient& gradient) override {
    log.push_back("loss");
    for (float& value : gradient.opacities) value += 0.5f;
    return static_cast<double>(cloud.size());
  }
  void observe(const FitMoment&, const ViewStatistics& view) override {
    log.push_back("observe");
    EXPECT_EQ(view.visible.size(), view.of(Statistic::kContributions).size());
    EXPECT_EQ(view.width, 64u);
    ASSERT_NE(view.camera, nullptr);
  }
  bool stepGate(const FitMoment&) const override {
    log.push_back("gate");
    return gate_is_open;
  }
  std::optional<SplatEdit> afterStep(const FitMoment&, const SplatStore& store) override {
    log.push_back("afterStep");
    EXPECT_EQ(store.splats().extras[0].size(), store.splats().positions.size());
    return {};
  }
  bool wantsSweep(const FitMoment& moment) const override { return moment.iteration == 2; }
  void sweep(const FitMoment&, ViewEvaluator& views) override {
    log.push_back("sweep of " + std::to_string(views.viewCount()));
  }
  std::optional<SplatEdit> edit(const FitMoment& moment, const SplatStore& store) override {
    log.push_back("edit");
    if (moment.iteration != 2) return {};
    SplatEdit edit;
    edit.append = rowsOf(store.splats(), std::vector<uint32_t>(appended, 0));
    return edit;
  }
  TensorTable state() const override { return {{"appended", {{1}, std::vector<uint64_t>{9}}}}; }
  void restore(const TensorTable& table) override {
    if (!table.contains("appended")) fail(ErrorCode::kFormat, "no 'appended'");
  }

 private:
  class Offsets final : public Parameterisation {
   public:
    void activate(const RawSplats& raw, SplatCloud& cloud) const override {
      for (size_t i = 0; i < cloud.positions.size(); ++i) cloud.positions[i] += raw.extras[0][i];
    }
    void adjoint(const RawSplats&, const SplatCloud&, const CloudGradient& by_cloud,
                 RawSplats& by_raw) const override {
      for (size_t i = 0; i < by_cloud.positions.size(); ++i) {
        by_raw.extras[0][i] = by_cloud.positions[i];
      }
    }
  };
  Offsets offsets_;
};

class NoViews final : public ViewEvaluator {
 public:
  size_t viewCount() const override { return 12; }
  const SplatCloud& splats() override { return truth(); }
  const Camera& camera(size_t view) const override { return scene().camera(view); }
  std::vector<float> target(size_t) override { return {}; }
  std::vector<float> picture(size_t) override { return {}; }
  const ViewStatistics& evaluate(size_t, const StatisticRequest&) override { return statistics_; }

 private:
  ViewStatistics statistics_;
};

TEST(ExplicitModel, BeginsWithSplatsThatAreThere) {
  SplatCloud start = withShDegree(truth(), 1);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(-0.5f, 0.5f);
  for (size_t i = 0; i < start.sh.size(); ++i) {
    if (i % start.shStride() >= 3) start.sh[i] = uniform(random);
  }
  const auto views = viewsOf(start, camerasAround(12, 64));
  ExplicitModelOptions options;
  options.strategy = "mcmc";  // which makes what it starts itself fainter and smaller
  options.sh_degree = 2;
  const auto model = makeExplicitModel(*cpuBackends(), start, options);
  const SplatCloud begun = model->splats(0);
  EXPECT_EQ(begun.positions, start.positions);
  EXPECT_EQ(begun.sh, withShDegree(start, 2).sh);
  EXPECT_EQ(begun.sh.size(), 60u * 27);
  for (size_t i = 0; i < 60; ++i) EXPECT_NEAR(begun.opacities[i], start.opacities[i], 1e-6f);
  // The views show these splats, their harmonics included: nothing is lost at the first step.
  Fit fit(*views, *model, 1000);
  EXPECT_LT(fit.run(1).l1, 1e-5);

  options.sh_degree = 0;
  EXPECT_EQ(makeExplicitModel(*cpuBackends(), start, options)->splats(0).sh, truth().sh);
  EXPECT_THAT(messageOf([&] { makeExplicitModel(*cpuBackends(), SplatCloud(), options); },
                        ErrorCode::kInvalidArgument),
              HasSubstr("no splats to begin with"));
}

TEST(ExplicitModel, CallsTheHooksOfAStrategyInTheirOrder) {
  std::vector<std::string> log;
  auto strategy = std::make_unique<Noting>(log);
  Noting& noting = *strategy;
  noting.appended = 2;
  SplatCloud start = truth();
  const auto model = makeExplicitModel(*cpuBackends(), start, std::move(strategy), plain());
  Fit fit(scene(), *model, 1000);
  NoViews views;
  StepReport report = fit.run(1, &views);
  EXPECT_THAT(log, ElementsAre("requests", "loss", "observe", "gate", "afterStep", "edit"));
  EXPECT_GT(report.loss, 60);
  log.clear();
  fit.run(2, &views);
  EXPECT_THAT(
      log, ElementsAre("requests", "loss", "observe", "gate", "afterStep", "sweep of 12", "edit"));
  EXPECT_EQ(model->splats(0).size(), 62u);
  // Extra numbers are trained, and move what is drawn.
  const TensorTable state = model->state();
  const auto& raw = std::get<std::vector<float>>(state.at("raw.positions").values);
  const auto& extra = std::get<std::vector<float>>(state.at("raw.extra0").values);
  const SplatCloud drawn = model->splats(0);
  EXPECT_EQ(extra.size(), 62u * 3);
  EXPECT_NE(extra, std::vector<float>(62 * 3, 0.0f));
  for (size_t i = 0; i < raw.size(); ++i) EXPECT_EQ(drawn.positions[i], raw[i] + extra[i]);
  // And are in a checkpoint.
  auto other_strategy = std::make_unique<Noting>(log);
  const auto other = makeExplicitModel(*cpuBackends(), start, std::move(other_strategy), plain());
  other->restore(state);
  EXPECT_EQ(other->splats(0).positions, drawn.positions);
}

TEST(ExplicitModel, DerivativesAddUpWhileTheGateIsClosed) {
  std::vector<std::string> log;
  auto strategy = std::make_unique<Noting>(log);
  Noting& noting = *strategy;
  const auto model = makeExplicitModel(*cpuBackends(), truth(), std::move(strategy), plain());
  Fit fit(scene(), *model, 1000);
  noting.gate_is_open = false;
  fit.run(3);
  const SplatCloud before = model->splats(0);
  for (size_t i = 0; i < 60; ++i) {
    // There and back again through the logit.
    EXPECT_NEAR(before.opacities[i], truth().opacities[i], 1e-6f);
  }
  EXPECT_TRUE(model->state().contains("kept.logits"));
  const TensorTable saved = model->state();
  noting.gate_is_open = true;
  fit.run(4);
  EXPECT_FALSE(model->state().contains("kept.logits"));
  EXPECT_NE(model->splats(0).opacities, before.opacities);
  // The first moment is a tenth of four derivatives: mostly those of the regulariser, 0.5 o (1-o).
  const TensorTable now = model->state();
  const auto& moments = std::get<std::vector<float>>(now.at("adam.first.logits").values);
  const auto& kept = std::get<std::vector<float>>(saved.at("kept.logits").values);
  for (size_t i = 0; i < 60; ++i) {
    EXPECT_NEAR(moments[i], 0.1f * kept[i] / 3 * 4, 0.002f);
    EXPECT_NEAR(kept[i], 1.5f * truth().opacities[i] * (1 - truth().opacities[i]), 0.02f);
  }
  // What was kept goes on, too.
  auto other_strategy = std::make_unique<Noting>(log);
  const auto other = makeExplicitModel(*cpuBackends(), truth(), std::move(other_strategy), plain());
  other->restore(saved);
  Fit second(scene(), *other, 1000);
  second.moment().iteration = 4;
  second.run(4);
  expectSame(other->state(), model->state());
}

TEST(ExplicitModel, AStrategyThatIgnoresTheCapIsStopped) {
  std::vector<std::string> log;
  auto strategy = std::make_unique<Noting>(log);
  strategy->appended = 100;
  ExplicitModelOptions options = plain();
  options.max_splats = 100;
  const auto model = makeExplicitModel(*cpuBackends(), truth(), std::move(strategy), options);
  EXPECT_THAT(messageOf([&] { Fit(scene(), *model, 10).run(2); }, ErrorCode::kInternal),
              HasSubstr("noting makes 160 splats; at most 100"));
}

TEST(ExplicitModel, RefusesStatesOfOtherFits) {
  const auto model = startModel(scene(), plain());
  Fit(scene(), *model, 100).run(3);
  const TensorTable good = model->state();
  const auto refused = [&](const TensorTable& table) {
    const std::string message = messageOf([&] { model->restore(table); }, ErrorCode::kFormat);
    expectSame(model->state(), good);
    return message;
  };
  TensorTable table = good;
  table["strategy.name"] = {{3}, std::vector<uint8_t>{'o', 'd', 'd'}};
  EXPECT_THAT(refused(table), HasSubstr("of strategy 'odd'; this fit has 'adaptive'"));
  table = good;
  table.erase("adam.first.sh");
  EXPECT_THAT(refused(table), HasSubstr("no 'adam.first.sh'"));
  table = good;
  std::get<std::vector<float>>(table["raw.positions"].values).pop_back();
  EXPECT_THAT(refused(table), HasSubstr("'raw.positions' of the checkpoint holds 179 values"));
  table = good;
  std::get<std::vector<float>>(table["raw.sh"].values)[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(refused(table), HasSubstr("nan"));
  table = good;
  table["adam.step"] = {{1}, std::vector<float>{1}};
  EXPECT_THAT(refused(table), HasSubstr("another type"));
  table = good;
  ASSERT_EQ(table.erase("strategy.state.screen_pull.gradient_sums"), 1u);
  EXPECT_THAT(refused(table), HasSubstr("no 'gradient_sums'"));
}

TEST(ExplicitModel, RefusesOptionsOutOfRange) {
  const auto refused = [&](const ExplicitModelOptions& options) {
    return messageOf([&] { startModel(scene(), options); }, ErrorCode::kInvalidArgument);
  };
  ExplicitModelOptions options;
  options.strategy = "none";
  EXPECT_THAT(refused(options), HasSubstr("strategy is 'none'; there is adaptive"));
  options = {};
  options.sh_degree = 5;
  EXPECT_THAT(refused(options), HasSubstr("sh_degree is 5; 0 to 4"));
  options = {};
  options.ssim_share = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refused(options), HasSubstr("0 to 1 is allowed"));
  EXPECT_THAT(
      messageOf([&] { makeExplicitModel(*cpuBackends(), scene(), {}, ExplicitModelOptions()); },
                ErrorCode::kInvalidArgument),
      HasSubstr("no views to learn from"));
}

TEST(ExplicitModel, ASplatTakesAsManyBytesAsItCounts) {
  for (const int degree : {0, 3}) {
    uint64_t bytes[2];
    const size_t counts[2] = {2000, 12000};
    for (int k = 0; k < 2; ++k) {
      SplatCloud cloud = ballOfSplats(counts[k], 4, 0.01);
      cloud.sh_degree = degree;
      cloud.sh.resize(counts[k] * cloud.shStride());
      const auto views = viewsOf(ballOfSplats(30, 1), camerasAround(2, 32));
      const auto model = makeExplicitModel(*cpuBackends(), cloud, makeStrategy("absolute"), {});
      Fit(*views, *model, 3000).run(3);
      bytes[k] = model->memoryBytes();
    }
    // A fit holds the model, its best state and a checkpoint: less than three times as much, as
    // what drawing keeps is there once.
    const double each = 3.0 * static_cast<double>(bytes[1] - bytes[0]) / 10000;
    EXPECT_LE(each, 1.2 * static_cast<double>(bytesPerSplat(degree))) << degree;
    EXPECT_GE(each, 0.5 * static_cast<double>(bytesPerSplat(degree))) << degree;
  }
}

}  // namespace
}  // namespace stipple
