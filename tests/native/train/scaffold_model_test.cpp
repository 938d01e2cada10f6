#include "train/anchors/scaffold_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "decode/anchors/scaffold_decoder.h"
#include "train/anchors/scaffold_steps.h"
#include "train/loop/trainer.h"
#include "train/toy_views.h"

namespace stipple {
namespace {

constexpr size_t kViews = 24;
constexpr uint32_t kSize = 64;

ScaffoldModelOptions smallOptions() {
  ScaffoldModelOptions options;
  options.most_anchors = 800;
  options.start_anchors = 200;
  options.gaussians_per_anchor = 5;
  options.antialias = Antialias::kMip;
  options.seed = 1;
  return options;
}

class Quiet : public FitObserver {
 public:
  void figures(const FitFigures&) override {}
  void note(const std::string&) override {}
  bool wantsPreview() override { return false; }
  bool wantsContributions() override { return false; }
  void preview(SplatCloud, SplatQuantities) override {}
  void save(const TensorTable& table) override { saved = table; }

  TensorTable saved;
};

/// A fit of the toy ball, from its points.
struct Fit {
  explicit Fit(uint64_t iterations, const ScaffoldModelOptions& options = smallOptions(),
               uint64_t checkpoint = 0)
      : views(viewsOfBall()) {
    TrainerOptions trainer_options;
    trainer_options.iterations = iterations;
    trainer_options.seed = 3;
    trainer_options.checkpoint_interval = checkpoint;
    const FitViews split = splitViews(*views, 6);
    auto made = makeScaffoldModel(*cpuBackends(), *views, split.training, options);
    model = made.get();
    trainer =
        std::make_unique<Trainer>(*cpuBackends(), views, split, std::move(made), trainer_options);
  }

  static std::shared_ptr<MemoryViewSource> viewsOfBall() {
    const auto views = toyViews(toyBall(3000), kViews, kSize);
    views->setPoints(toyPoints(toyBall(400)));
    return views;
  }

  const FitHistory& run() {
    trainer->run(observer, nullptr);
    return trainer->history();
  }

  std::shared_ptr<MemoryViewSource> views;
  FitModel* model;
  std::unique_ptr<Trainer> trainer;
  Quiet observer;
};

double psnrOf(const SplatCloud& cloud, const MemoryViewSource& views) {
  const SplatInstance instance{&cloud};
  double squares = 0;
  for (size_t v = 0; v < kViews; v += 6) {
    const RenderResult drawn = renderTiled({&instance, 1}, views.camera(v), {});
    const ViewPicture picture = views.load(v);
    for (size_t i = 0; i < drawn.colour.size(); i += 4) {
      for (size_t c = 0; c < 3; ++c) {
        const double d = static_cast<double>(drawn.colour[i + c] - picture.colour[i / 4 * 3 + c]);
        squares += d * d;
      }
    }
  }
  return -10 * std::log10(squares / (3.0 * kSize * kSize * kViews / 6));
}

TEST(ScaffoldModel, LearnsABallFromAFewAnchorsAndGrows) {
  Fit fit(600);
  const double before = psnrOf(fit.model->splats(0), *fit.views);
  const FitHistory& history = fit.run();
  const auto result = scaffoldResult(*fit.model);
  ASSERT_TRUE(result);
  EXPECT_GT(result->size(), 300u) << "200 at the start";
  EXPECT_LE(result->size(), 800u);
  const double after = psnrOf(fit.model->splats(0), *fit.views);
  EXPECT_GT(after, before + 5);
  EXPECT_GT(after, 26);
  // It is measured on the way, which chooses nothing: the last state is the result.
  EXPECT_GT(history.measures.size(), 3u);
  EXPECT_EQ(history.best_iteration, 600u);
  // Six octaves, and a larger budget is not worse.
  ASSERT_EQ(history.by_budget.size(), 6u);
  for (size_t i = 1; i < history.by_budget.size(); ++i) {
    EXPECT_GT(history.by_budget[i].psnr, history.by_budget[i - 1].psnr - 0.1) << i;
  }
}

TEST(ScaffoldModel, LearnsBudgetsBelowAllAnchors) {
  Fit fit(600);
  const FitHistory& history = fit.run();
  const auto result = scaffoldResult(*fit.model);
  EXPECT_EQ(result->coarsening, 0.5);
  const std::vector<FitMeasure>& measured = history.by_budget;
  const double whole = measured.back().psnr;
  // Without that half of them lack 10 dB and more: holes in what they show.
  EXPECT_GT(measured[measured.size() - 2].psnr, whole - 4);
  EXPECT_GT(measured[measured.size() - 3].psnr, whole - 6);
  // Anchors that were learned for it are better than the others.
  ScaffoldParameters last = *result;
  std::vector<uint32_t> rows;
  for (size_t a = result->size(); a-- > 0;) rows.push_back(static_cast<uint32_t>(a));
  keepAnchors(last, rows);
  DecodeRequest request;
  request.gaussians_per_anchor = result->gaussians;
  request.budget = result->size() / 4;
  const SplatCloud first_part = ScaffoldDecoder(result).decode(request);
  const SplatCloud last_part =
      ScaffoldDecoder(std::make_shared<const ScaffoldParameters>(last)).decode(request);
  EXPECT_GT(psnrOf(first_part, *fit.views), psnrOf(last_part, *fit.views) + 1);
  EXPECT_EQ(first_part.positions, fit.model->splats(request.budget).positions);
}

TEST(ScaffoldModel, PutsAnchorsInTheOrderOfWorthWhereItIsStoppedBeforeItLearnsBudgets) {
  struct Stops final : Quiet {
    void figures(const FitFigures& figures) override {
      if (figures.iteration == 250) progress.cancel();
    }
    Progress progress;
  } stops;
  Fit fit(600);
  fit.trainer->run(stops, &stops.progress);
  ASSERT_EQ(fit.trainer->iteration(), 250u);
  const auto result = scaffoldResult(*fit.model);
  EXPECT_EQ(result->coarsening, 0);
  DecodeRequest request;
  request.gaussians_per_anchor = result->gaussians;
  request.budget = result->size() / 2;
  ScaffoldParameters last = *result;
  std::vector<uint32_t> rows;
  for (size_t a = result->size(); a-- > 0;) rows.push_back(static_cast<uint32_t>(a));
  keepAnchors(last, rows);
  EXPECT_GT(
      psnrOf(ScaffoldDecoder(result).decode(request), *fit.views),
      psnrOf(ScaffoldDecoder(std::make_shared<const ScaffoldParameters>(last)).decode(request),
             *fit.views) +
          1);
}

TEST(ScaffoldSteps, NestAnchorsSoThatTheFirstAreSpreadOverAll) {
  // Along a line: of each two neighbours the one that is worth more, and of those again.
  std::vector<float> positions;
  std::vector<double> worth;
  for (int a = 0; a < 16; ++a) {
    positions.insert(positions.end(), {static_cast<float>(a), 0, 0});
    worth.push_back(a % 4 == 3 ? 2 : a % 2);
  }
  const std::vector<uint32_t> order = nestedOrder(positions, worth);
  std::vector<uint32_t> sorted = order;
  std::sort(sorted.begin(), sorted.end());
  for (uint32_t a = 0; a < 16; ++a) ASSERT_EQ(sorted[a], a);
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(order[i] % 4, 3u) << i;
  for (size_t i = 0; i < 8; ++i) EXPECT_EQ(order[i] % 2, 1u) << i;
  EXPECT_NE(order[0] / 8, order[1] / 8);  // two of them: one in each half
  EXPECT_EQ(nestedOrder({}, {}).size(), 0u);
  EXPECT_EQ(nestedOrder(std::vector<float>(9, 1.0f), std::vector<double>(3, 1.0)).size(), 3u);
}

TEST(ScaffoldSteps, DrawAllAnchorsInHalfOfTheStepsThatLearnBudgets) {
  FitMoment moment;
  moment.iterations = 2000;
  size_t whole = 0;
  for (moment.iteration = 1; moment.iteration < 1000; ++moment.iteration) {
    ASSERT_EQ(budgetOfStep(moment, 1, 640), 640u);
    ASSERT_FALSE(beginsBudgets(moment));
  }
  ASSERT_TRUE(beginsBudgets(moment));
  for (; moment.iteration < 2000; ++moment.iteration) {
    const uint64_t budget = budgetOfStep(moment, 1, 640);
    ASSERT_GE(budget, 20u);
    ASSERT_LE(budget, 640u);
    whole += budget == 640;
  }
  EXPECT_NEAR(static_cast<double>(whole), 500, 60);  // four standard deviations
  EXPECT_EQ(budgetOfStep(moment, 1, 1), 1u);
}

TEST(ScaffoldModel, GoesOnBitForBitFromItsCheckpoint) {
  ScaffoldModelOptions options = smallOptions();
  Fit whole(200, options);
  Fit resumed(200, options);
  // Half-way, where anchors have grown and a window is under way.
  Fit half(200, options, 103);
  struct StopsAt final : Quiet {
    void save(const TensorTable& table) override {
      if (saved.empty()) saved = table;
    }
  } stops;
  half.trainer->run(stops, nullptr);
  resumed.trainer->restore(stops.saved);
  EXPECT_EQ(resumed.trainer->iteration(), 103u);
  whole.run();
  resumed.run();
  const TensorTable one = whole.model->state(), other = resumed.model->state();
  ASSERT_EQ(one.size(), other.size());
  for (const auto& [name, tensor] : one) {
    EXPECT_EQ(tensor.values, other.at(name).values) << name;
  }
  EXPECT_EQ(whole.model->splats(0).sh, resumed.model->splats(0).sh);
}

TEST(ScaffoldModel, KeepsToItsLimits) {
  ScaffoldModelOptions options = smallOptions();
  options.most_anchors = 60;  // fewer than the points
  Fit fit(200, options);
  fit.run();
  EXPECT_LE(scaffoldResult(*fit.model)->size(), 60u);
  options = smallOptions();
  const auto views = Fit::viewsOfBall();
  const auto refuses = [&](const ScaffoldModelOptions& wrong, std::span<const size_t> training) {
    EXPECT_THROW(makeScaffoldModel(*cpuBackends(), *views, training, wrong), Error);
  };
  const std::vector<size_t> training = {0, 1};
  refuses(options, {});
  options.most_anchors = 0;
  refuses(options, training);
  options = smallOptions();
  options.gaussians_per_anchor = 33;
  refuses(options, training);
  options = smallOptions();
  options.sh_degree = 5;
  refuses(options, training);
}

TEST(ScaffoldModel, RefusesStatesOfOthers) {
  Fit fit(20);
  TensorTable table = fit.model->state();
  table.erase("adam.first.scaffold.offsets");
  EXPECT_THROW(fit.model->restore(table), Error);
  table = fit.model->state();
  table["window.seen"].values = std::vector<uint32_t>(3);
  EXPECT_THROW(fit.model->restore(table), Error);
  EXPECT_NO_THROW(fit.model->restore(fit.model->state()));
}

}  // namespace
}  // namespace stipple
