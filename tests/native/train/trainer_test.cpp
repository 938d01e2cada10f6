#include "train/loop/trainer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "colour_model.h"

namespace stipple {
namespace {

using testing::ColourModel;
using testing::ColourModelOptions;
using testing::colourViews;

/// Keeps what it is told; cancels where it is asked to.
class Listener : public FitObserver {
 public:
  void figures(const FitFigures& figures) override {
    all.push_back(figures);
    if (figures.iteration == cancel_at) progress.cancel();
  }
  void note(const std::string& text) override { notes.push_back(text); }
  bool wantsPreview() override { return preview_at <= all.size() && previews.empty(); }
  bool wantsContributions() override { return wants_contributions; }
  void preview(SplatCloud cloud, SplatQuantities seen) override {
    previews.push_back(std::move(cloud));
    previewed_at = all.size();
    seen_in_preview = std::move(seen);
  }
  void save(const TensorTable& table) override {
    if (disk_is_full) fail(ErrorCode::kIo, "a.safetensors cannot be written: No space left");
    saved.push_back(table);
  }

  std::vector<FitFigures> all;
  std::vector<std::string> notes;
  std::vector<SplatCloud> previews;
  SplatQuantities seen_in_preview;
  bool wants_contributions = false;
  std::vector<TensorTable> saved;
  Progress progress;
  uint64_t cancel_at = UINT64_MAX;
  size_t preview_at = SIZE_MAX;  // steps done before the one that it is wanted after
  size_t previewed_at = SIZE_MAX;
  bool disk_is_full = false;
};

TrainerOptions optionsOf(uint64_t iterations) {
  TrainerOptions options;
  options.iterations = iterations;
  options.measure_interval = 5;
  options.seed = 3;
  return options;
}

struct Fit {
  explicit Fit(const std::shared_ptr<const ViewSource>& views, const TrainerOptions& options,
               const ColourModelOptions& model_options = {}) {
    auto made = std::make_unique<ColourModel>(model_options);
    model = made.get();
    trainer = std::make_unique<Trainer>(*cpuBackends(), views, splitViews(*views, 8),
                                        std::move(made), options);
  }
  FitEnd run() { return trainer->run(listener, &listener.progress); }

  ColourModel* model = nullptr;
  std::unique_ptr<Trainer> trainer;
  Listener listener;
};

std::string messageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(FitViews, HoldsOutEveryEighthByName) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  const auto source = colourViews(17, 0.5f, 0.5f, 0.5f);
  for (size_t v = 17; v-- > 0;) views->add(source->camera(v), source->load(v), source->name(v));
  const FitViews split = splitViews(*views, 8);
  // Added in falling order of names: view 16 has the first name.
  EXPECT_EQ(split.held_out, (std::vector<size_t>{16, 8, 0}));
  EXPECT_EQ(split.training.size(), 14u);
  EXPECT_EQ(split.training.front(), 15u);
}

TEST(FitViews, HoldsNothingOutOfFewViews) {
  const FitViews split = splitViews(*colourViews(7, 0.5f, 0.5f, 0.5f), 8);
  EXPECT_TRUE(split.held_out.empty());
  EXPECT_EQ(split.training.size(), 7u);
  EXPECT_TRUE(splitViews(*colourViews(20, 0.5f, 0.5f, 0.5f), 0).held_out.empty());
}

TEST(ViewOrder, ShowsEveryViewOncePerRoundInChangingOrders) {
  ViewOrder order(9, 5);
  std::vector<std::vector<size_t>> rounds(3);
  for (uint64_t i = 0; i < 27; ++i) rounds[i / 9].push_back(order.at(i));
  for (const auto& round : rounds) {
    EXPECT_EQ(std::set<size_t>(round.begin(), round.end()).size(), 9u);
  }
  EXPECT_NE(rounds[0], rounds[1]);
  EXPECT_NE(rounds[1], rounds[2]);
  ViewOrder again(9, 5);
  EXPECT_EQ(again.at(20), rounds[2][2]);
  EXPECT_EQ(again.at(3), rounds[0][3]);
}

TEST(Trainer, FitsTheViewsAndMeasuresHeldOutOnes) {
  Fit fit(colourViews(16, 0.2f, 0.6f, 0.8f), optionsOf(120));
  EXPECT_EQ(fit.run(), FitEnd::kWhole);
  const FitHistory& history = fit.trainer->history();
  EXPECT_EQ(history.records.size(), 120u);
  EXPECT_EQ(history.measures.size(), 24u);
  EXPECT_TRUE(history.measured_on_held_out);
  EXPECT_EQ(history.training_view_count, 14u);
  EXPECT_EQ(history.measured_view_count, 2u);
  // Views differ by 0.02 and a splat shows 0.99 of its colour: both within 0.015, 36 dB.
  ASSERT_EQ(history.by_budget.size(), 1u);
  EXPECT_GT(history.by_budget[0].psnr, 36);
  EXPECT_GT(history.by_budget[0].psnr, history.measures[0].psnr + 1);
  EXPECT_NEAR(fit.model->colour()[2], 0.81, 0.02);
  EXPECT_EQ(fit.listener.all.back().iteration, 120u);
  EXPECT_TRUE(fit.listener.all.back().estimated_seconds.has_value());
  EXPECT_FALSE(fit.listener.all[18].estimated_seconds.has_value());
  EXPECT_STREQ(fit.listener.all.back().stage, "Colour");
}

TEST(Trainer, MeasuresBeforeOpacitiesAreLoweredAndNotRightAfter) {
  ColourModelOptions lowers;
  lowers.lowers_every = 10;
  Fit fit(colourViews(16, 0.2f, 0.6f, 0.8f), optionsOf(30), lowers);
  fit.run();
  std::vector<uint64_t> measured;
  for (const FitMeasure& measure : fit.trainer->history().measures) {
    measured.push_back(measure.iteration);
  }
  // At each fifth iteration; the last is measured whatever it ends with.
  EXPECT_EQ(measured, (std::vector<uint64_t>{5, 9, 15, 19, 25, 29, 30}));
}

TEST(Trainer, TellsNoMovingPixelsApartWhereNoCameraTookSeveralViews) {
  Fit still(colourViews(16, 0.2f, 0.6f, 0.8f), optionsOf(10));
  still.run();
  EXPECT_TRUE(std::isnan(still.trainer->history().by_budget[0].moving_psnr));
  EXPECT_FALSE(still.listener.all.back().best_moving_psnr.has_value());
}

TEST(Trainer, NeverLearnsFromHeldOutViews) {
  Fit fit(colourViews(16, 0.2f, 0.6f, 0.8f), optionsOf(28));
  fit.run();
  EXPECT_EQ(*std::max_element(fit.model->seen_views.begin(), fit.model->seen_views.end()), 13u);
  std::sort(fit.model->seen_views.begin(), fit.model->seen_views.end());
  for (size_t i = 0; i < 28; ++i) EXPECT_EQ(fit.model->seen_views[i], i / 2);
}

TEST(Trainer, KeepsTheBestOfAFitThatGetsWorse) {
  const auto views = colourViews(16, 0.2f, 0.6f, 0.8f);
  ColourModelOptions spoiling;
  spoiling.spoils_from = 61;
  Fit spoiled(views, optionsOf(120), spoiling);
  spoiled.run();
  const FitHistory& history = spoiled.trainer->history();
  EXPECT_GE(history.best_iteration, 60u);
  EXPECT_LE(history.best_iteration, 85u);  // steps lead away slowly at first
  EXPECT_LT(history.measures.back().psnr, history.by_budget[0].psnr - 1);
  Fit stopped(views, optionsOf(120), spoiling);
  stopped.listener.cancel_at = history.best_iteration;
  stopped.run();
  EXPECT_EQ(spoiled.model->colour(), stopped.model->colour());
}

/// Views whose held-out ones, every eighth, are of the colour that the model starts with.
std::shared_ptr<const ViewSource> viewsWhoseHeldOutOnesMislead() {
  const auto bright = colourViews(16, 0.8f, 0.8f, 0.8f), grey = colourViews(16, 0.5f, 0.5f, 0.5f);
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (size_t v = 0; v < 16; ++v) {
    views->add(bright->camera(v), (v % 8 == 0 ? grey : bright)->load(v), bright->name(v));
  }
  return views;
}

TEST(Trainer, ChoosesTheBestByViewsThatItLearnsFromAlone) {
  Fit fit(viewsWhoseHeldOutOnesMislead(), optionsOf(60));
  fit.run();
  const FitHistory& history = fit.trainer->history();
  EXPECT_GE(history.best_iteration, 40u);  // by the held-out ones it would be 5, the first
  const FitMeasure& best = history.measures.at(history.best_iteration / 5 - 1);
  for (const FitMeasure& measure : history.measures) {
    EXPECT_LE(measure.training_psnr, best.training_psnr);
  }
  EXPECT_LT(best.psnr, history.measures.front().psnr - 3);
  EXPECT_GT(best.training_psnr, history.measures.front().training_psnr + 3);
  ASSERT_EQ(history.by_budget.size(), 1u);
  EXPECT_EQ(history.by_budget[0].psnr, best.psnr);  // the two that are held out
  EXPECT_EQ(history.by_budget[0].training_psnr, best.training_psnr);
}

TEST(Trainer, GoesOnFromCheckpointsOfFewerFigures) {
  const auto views = colourViews(16, 0.2f, 0.6f, 0.8f);
  TrainerOptions saving = optionsOf(40);
  saving.checkpoint_interval = 20;
  Fit first(views, saving);
  first.run();
  // Of 7: the best was chosen by held-out views; of 8: moving pixels were not told apart.
  for (const uint64_t length : {7u, 8u}) {
    TensorTable old = first.listener.saved.at(0);
    Tensor& measures = old.at("history.measures");
    const auto rows = std::get<std::vector<double>>(measures.values);
    ASSERT_EQ(measures.shape, (std::vector<uint64_t>{4, 9}));
    std::vector<double> shorter;
    for (size_t i = 0; i < rows.size(); ++i) {
      if (i % 9 < length) shorter.push_back(rows[i]);
    }
    measures = {{4, length}, shorter};
    Fit second(views, optionsOf(40));
    second.trainer->restore(old);
    EXPECT_EQ(second.run(), FitEnd::kWhole);
    EXPECT_EQ(second.model->colour(), first.model->colour());
    const FitHistory& history = second.trainer->history();
    ASSERT_EQ(history.measures.size(), 8u);
    const FitHistory& whole = first.trainer->history();
    EXPECT_EQ(history.measures[3].psnr, whole.measures[3].psnr);
    EXPECT_EQ(std::isnan(history.measures[3].training_psnr), length == 7);
    EXPECT_TRUE(std::isnan(history.measures[3].moving_psnr));
    EXPECT_EQ(history.measures[4].training_psnr, whole.measures[4].training_psnr);
    EXPECT_EQ(history.best_iteration, 40u);
  }
}

TEST(Trainer, GoesOnBitForBitFromACheckpoint) {
  const auto views = colourViews(16, 0.2f, 0.6f, 0.8f, 0.5f);
  ColourModelOptions spoiling;
  spoiling.spoils_from = 18;  // so that the checkpoint has a best state of its own
  Fit whole(views, optionsOf(40), spoiling);
  whole.run();
  TrainerOptions saving = optionsOf(40);
  saving.checkpoint_interval = 20;
  Fit first(views, saving, spoiling);
  first.listener.cancel_at = 27;
  EXPECT_EQ(first.run(), FitEnd::kStopped);
  ASSERT_EQ(first.listener.saved.size(), 2u);  // at 20, and at 27 where it was stopped
  EXPECT_TRUE(first.listener.saved[0].count("best.raw.colour"));
  for (const TensorTable& saved : first.listener.saved) {
    Fit second(views, optionsOf(40), spoiling);
    second.trainer->restore(saved);
    EXPECT_EQ(second.run(), FitEnd::kWhole);
    EXPECT_EQ(second.model->state().at("raw.colour").values,
              whole.model->state().at("raw.colour").values);
    EXPECT_EQ(second.trainer->history().best_iteration, whole.trainer->history().best_iteration);
    ASSERT_EQ(second.trainer->history().records.size(), 40u);
    for (size_t i = 0; i < 40; ++i) {
      EXPECT_EQ(second.trainer->history().records[i].loss,
                whole.trainer->history().records[i].loss);
    }
    EXPECT_EQ(second.trainer->history().by_budget[0].psnr,
              whole.trainer->history().by_budget[0].psnr);
  }
}

TEST(Trainer, RefusesCheckpointsThatAreNotWhole) {
  const auto views = colourViews(16, 0.2f, 0.6f, 0.8f);
  TrainerOptions saving = optionsOf(40);
  saving.checkpoint_interval = 20;
  Fit first(views, saving);
  first.run();
  const TensorTable& saved = first.listener.saved.at(0);
  for (const char* name : {"iteration", "history.records", "history.measures"}) {
    TensorTable cut = saved;
    cut.erase(name);
    Fit second(views, optionsOf(40));
    EXPECT_NE(messageOf([&] { second.trainer->restore(cut); }).find(name), std::string::npos);
    EXPECT_EQ(second.trainer->iteration(), 0u);
  }
  Fit shorter(views, optionsOf(10));
  EXPECT_EQ(messageOf([&] { shorter.trainer->restore(saved); }),
            "the checkpoint is of iteration 20; the fit has 10");
}

TEST(Trainer, GivesTheSameBitsForAnyMemoryAndThreads) {
  const auto views = colourViews(16, 0.2f, 0.6f, 0.8f, 0.7f);
  Fit usual(views, optionsOf(40));
  usual.run();
  TrainerOptions streamed = optionsOf(40);
  streamed.picture_bytes = 3000;  // room for one picture of 16
  Fit other(views, streamed);
  withThreads(1, [&] { other.run(); });
  EXPECT_EQ(other.model->colour(), usual.model->colour());
  EXPECT_EQ(other.trainer->history().by_budget[0].psnr, usual.trainer->history().by_budget[0].psnr);
  EXPECT_LE(other.trainer->memoryBytes(), usual.trainer->memoryBytes());
}

TEST(Trainer, StopsWithTheBestAndSavesWhereItStood) {
  TrainerOptions options = optionsOf(1000);
  options.checkpoint_interval = 500;
  Fit fit(colourViews(16, 0.2f, 0.6f, 0.8f), options);
  fit.listener.cancel_at = 33;
  EXPECT_EQ(fit.run(), FitEnd::kStopped);
  EXPECT_EQ(fit.trainer->history().best_iteration, 33u);
  EXPECT_EQ(fit.trainer->history().by_budget.size(), 1u);
  ASSERT_EQ(fit.listener.saved.size(), 1u);
  EXPECT_EQ(std::get<std::vector<uint64_t>>(fit.listener.saved[0].at("iteration").values)[0], 33u);
}

TEST(Trainer, StopsBeforeTheFirstStep) {
  Fit fit(colourViews(16, 0.2f, 0.6f, 0.8f), optionsOf(100));
  fit.listener.progress.cancel();
  EXPECT_EQ(fit.run(), FitEnd::kStopped);
  EXPECT_EQ(fit.trainer->iteration(), 0u);
  EXPECT_TRUE(fit.trainer->history().by_budget.empty());
}

TEST(Trainer, KeepsTheBestWhereAStepFails) {
  const auto views = colourViews(16, 0.2f, 0.6f, 0.8f);
  ColourModelOptions failing;
  failing.fails_at = 43;
  Fit fit(views, optionsOf(60), failing);
  EXPECT_EQ(messageOf([&] { fit.run(); }), "the step fails");
  Fit good(views, optionsOf(60));
  good.listener.cancel_at = 40;
  good.run();
  EXPECT_EQ(fit.model->colour(), good.model->colour());
}

TEST(Trainer, GoesOnWhereACheckpointCannotBeWritten) {
  TrainerOptions options = optionsOf(40);
  options.checkpoint_interval = 10;
  Fit fit(colourViews(16, 0.2f, 0.6f, 0.8f), options);
  fit.listener.disk_is_full = true;
  EXPECT_EQ(fit.run(), FitEnd::kWhole);
  ASSERT_FALSE(fit.listener.notes.empty());
  EXPECT_EQ(fit.listener.notes[0],
            "the checkpoint is not saved: a.safetensors cannot be written: No space left");
}

TEST(Trainer, HandsOverAPreviewWhereItIsWanted) {
  Fit fit(colourViews(16, 0.2f, 0.6f, 0.8f), optionsOf(30));
  fit.listener.preview_at = 10;
  fit.run();
  ASSERT_EQ(fit.listener.previews.size(), 1u);
  EXPECT_EQ(fit.listener.previews[0].size(), 1u);
}

TEST(Trainer, HandsOverNoPreviewWhileOpacitiesComeBack) {
  ColourModelOptions lowers;
  lowers.lowers_every = 10;
  lowers.foggy_steps = 4;
  for (const size_t wanted : {8u, 9u, 11u, 13u, 14u, 19u}) {
    Fit fit(colourViews(16, 0.2f, 0.6f, 0.8f), optionsOf(30), lowers);
    fit.listener.preview_at = wanted;
    fit.run();
    // The tenth step lowers them; what the fourth after it leaves is clear.
    const size_t clear = wanted == 19 ? 23 : wanted >= 9 && wanted < 13 ? 13 : wanted;
    EXPECT_EQ(fit.listener.previewed_at, clear) << wanted;
  }
}

TEST(Trainer, PutsTransparentViewsBeforeTheBackground) {
  const auto first_backgrounds = [](BackgroundPolicy policy, float alpha) {
    TrainerOptions options = optionsOf(20);
    options.background = policy;
    Fit fit(colourViews(16, 0.2f, 0.6f, 0.8f, alpha), options);
    fit.run();
    return fit.model->seen_backgrounds;
  };
  const auto random = first_backgrounds(BackgroundPolicy::kRandom, 0.5f);
  EXPECT_EQ(std::set<double>(random.begin(), random.end()).size(), 20u);
  EXPECT_GT(*std::max_element(random.begin(), random.end()), 0.8);
  EXPECT_LT(*std::min_element(random.begin(), random.end()), 0.2);
  const std::vector<double> zeros(20, 0.0), ones(20, 1.0);
  EXPECT_EQ(first_backgrounds(BackgroundPolicy::kBlack, 0.5f), zeros);
  EXPECT_EQ(first_backgrounds(BackgroundPolicy::kWhite, 0.5f), ones);
  // A photograph has nothing behind it that a random colour could stand for.
  EXPECT_EQ(first_backgrounds(BackgroundPolicy::kRandom, 1.0f), zeros);
}

TEST(Trainer, LooksAtFewerPixelsOfLargeImagesFirst) {
  const auto widths = [](uint32_t width, uint32_t height, bool coarse_to_fine) {
    auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
    ViewPicture picture;
    picture.width = width;
    picture.height = height;
    picture.colour.assign(size_t{width} * height * 3, 0.7f);
    for (int v = 0; v < 2; ++v) views->add(testing::cameraAt(0.1 * v, width, height), picture);
    TrainerOptions options = optionsOf(10);
    options.measure_interval = 10;
    options.coarse_to_fine = coarse_to_fine;
    Fit fit(views, options);
    fit.run();
    // The mean of an image does not depend on how many pixels it has.
    EXPECT_LT(fit.trainer->history().records.back().loss, fit.trainer->history().records[0].loss);
    return fit.model->seen_widths;
  };
  using Widths = std::vector<uint32_t>;
  EXPECT_EQ(widths(800, 600, true), (Widths{200, 200, 200, 200, 400, 400, 400, 400, 400, 800}));
  EXPECT_EQ(widths(800, 600, false), Widths(10, 800));
  // A quarter of the width would leave less than 30,000 pixels, and half of it for the last ones.
  EXPECT_EQ(widths(400, 400, true), (Widths{200, 200, 200, 200, 200, 200, 200, 200, 200, 400}));
  EXPECT_EQ(widths(300, 300, true), Widths(10, 300));
}

TEST(Trainer, FitsOneViewAndMeasuresItself) {
  Fit fit(colourViews(1, 0.2f, 0.6f, 0.8f), optionsOf(60));
  fit.run();
  EXPECT_FALSE(fit.trainer->history().measured_on_held_out);
  EXPECT_GT(fit.trainer->history().by_budget[0].psnr, 30);
}

TEST(Trainer, RefusesOptionsOutOfRange) {
  const auto views = colourViews(3, 0.5f, 0.5f, 0.5f);
  EXPECT_EQ(messageOf([&] { Fit(views, optionsOf(0)); }),
            "iterations is 0; 1 to 10000000 is allowed");
  TrainerOptions options = optionsOf(10);
  options.checkpoint_seconds = -1;
  EXPECT_NE(messageOf([&] { Fit(views, options); }).find("checkpoint_seconds is -1"),
            std::string::npos);
  EXPECT_EQ(messageOf([&] {
              Trainer(*cpuBackends(), views, {}, std::make_unique<ColourModel>(), optionsOf(10));
            }),
            "there are no views to learn from; at least one is needed");
}

TEST(ViewMeasure, AgreesWithAPsnrByHand) {
  // Opaque grey over views of one colour: the error is the same at every pixel.
  const auto views = colourViews(1, 0.25f, 0.5f, 0.75f);
  PictureStore pictures(views, 1 << 20);
  ColourModel model;
  const double black[3] = {0, 0, 0};
  const size_t chosen[1] = {0};
  const FitMeasure seen =
      ViewMeasure(*cpuBackends()).measure(model.splats(0), pictures, chosen, black);
  // One splat lets 0.01 of the background through: 0.495 is drawn.
  const double squares = (0.245 * 0.245 + 0.005 * 0.005 + 0.255 * 0.255) / 3;
  // Targets are kept in 16 bits: 1e-5 of a dB.
  EXPECT_NEAR(seen.psnr, -10 * std::log10(squares), 1e-3);
  EXPECT_EQ(seen.foreground_psnr, seen.psnr);
}

TEST(ViewMeasure, CountsOnlyWhatMasksAndAlphaLeave) {
  ViewPicture picture;
  picture.width = 2;
  picture.height = 1;
  picture.colour = {0.495f, 0.495f, 0.495f, 0, 0, 0};
  picture.alpha = {1, 0};
  MemoryViewSource plain(ColourSpace::kDisplay);
  plain.add(testing::cameraAt(0, 2, 1), picture);
  picture.weights = {1, 0};
  MemoryViewSource masked(ColourSpace::kDisplay);
  masked.add(testing::cameraAt(0, 2, 1), picture);
  const double black[3] = {0, 0, 0};
  const size_t chosen[1] = {0};
  ColourModel model;
  PictureStore all(std::make_shared<MemoryViewSource>(plain), 1 << 20);
  PictureStore left(std::make_shared<MemoryViewSource>(masked), 1 << 20);
  const FitMeasure with = ViewMeasure(*cpuBackends()).measure(model.splats(0), all, chosen, black);
  const FitMeasure without =
      ViewMeasure(*cpuBackends()).measure(model.splats(0), left, chosen, black);
  EXPECT_NEAR(with.psnr, -10 * std::log10(0.495 * 0.495 / 2), 0.01);
  EXPECT_GT(with.foreground_psnr, 80);
  EXPECT_GT(without.psnr, 80);
}

TEST(FitViewEvaluator, DrawsAndJudgesTrainingViews) {
  const auto views = colourViews(3, 0.25f, 0.5f, 0.75f, 0.5f);
  PictureStore pictures(views, 1 << 20);
  ColourModel model;
  const double white[3] = {1, 1, 1};
  const std::vector<size_t> training = {2, 0};
  FitViewEvaluator evaluator(
      *cpuBackends(), [&] { return model.splats(0); }, pictures, training, white, 0.2);
  EXPECT_EQ(evaluator.viewCount(), 2u);
  EXPECT_EQ(&evaluator.camera(0), &views->camera(2));
  // Half of 0.27 and half of white; a grey splat that lets 0.01 of white through.
  // Colour and alpha are kept in 16 bits.
  EXPECT_NEAR(evaluator.target(0)[0], 0.635, 1.6e-5);
  EXPECT_NEAR(evaluator.picture(0)[0], 0.505, 1e-5);
  StatisticRequest request;
  request.contributions = true;
  request.screen_gradients = true;
  request.absolute_screen_gradients = true;
  request.blending_weights = true;
  const ViewStatistics& seen = evaluator.evaluate(0, request);
  EXPECT_EQ(seen.view, 0u);
  EXPECT_EQ(seen.width, 20u);
  ASSERT_EQ(seen.visible.size(), 1u);
  EXPECT_EQ(seen.visible[0], 1);
  ASSERT_EQ(seen.of(Statistic::kBlendingWeights).size(), 1u);
  EXPECT_NEAR(seen.of(Statistic::kBlendingWeights)[0], 0.99f * 240, 0.01);
  EXPECT_EQ(seen.of(Statistic::kScreenGradients).size(), 2u);
  EXPECT_TRUE(seen.of(Statistic::kEdgeWeights).empty());
  // By pixel |R| - |R without the splat|: targets 0.635, 0.76, 0.885; without it white is seen.
  const double with = 0.13 + 0.255 + 0.38, without = 0.365 + 0.24 + 0.115;
  EXPECT_NEAR(seen.of(Statistic::kContributions)[0], 240 * (with - without), 0.05);
  EXPECT_NE(messageOf([&] { evaluator.camera(2); }).find("view 2 was asked for"),
            std::string::npos);
}

TEST(CameraExtent, IsThePublishedOneAndNeverZero) {
  const auto views = colourViews(3, 0.5f, 0.5f, 0.5f);  // at x = 0, 0.1, 0.2
  const size_t all[3] = {0, 1, 2};
  EXPECT_NEAR(extentOfCameras(*views, all), 0.11, 1e-12);
  const size_t one[1] = {0};
  EXPECT_EQ(extentOfCameras(*views, one), 1.0);
  PointSet points;
  points.positions = {0, 0, 1};  // 4 m before the camera
  points.colours = {1, 1, 1};
  points.opacities = {1};
  views->setPoints(points);
  EXPECT_NEAR(extentOfCameras(*views, one), 4.0, 1e-12);
}

TEST(Trainer, TellsTheModelWhenEachPictureWasTaken) {
  const auto views = colourViews(9, 0.2f, 0.6f, 0.4f, 1, 0.5);
  Fit fit(views, optionsOf(20));
  fit.run();
  const FitViews split = splitViews(*views, 8);
  ASSERT_EQ(fit.model->seen_times.size(), 20u);
  for (size_t i = 0; i < 20; ++i) {
    EXPECT_EQ(fit.model->seen_times[i],
              0.5 * static_cast<double>(split.training[fit.model->seen_views[i]]));
  }
  EXPECT_EQ(fit.model->seen_moments, fit.model->seen_times);
}

TEST(Trainer, TellsTheModelWhereTheCamerasAreThatItLearnsFrom) {
  Fit fit(colourViews(9, 0.2f, 0.6f, 0.4f), optionsOf(2));
  fit.run();
  // At x = 0, 0.1 ... 0.8; the first and the last one are held out.
  ASSERT_EQ(fit.model->seen_centres.size(), 2u);
  for (const double x : fit.model->seen_centres) EXPECT_NEAR(x, 0.4, 1e-12);
}

}  // namespace
}  // namespace stipple
