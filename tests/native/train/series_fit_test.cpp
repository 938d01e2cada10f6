#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <vector>

#include "colour_model.h"
#include "series_views.h"
#include "train/loop/trainer.h"

namespace stipple {
namespace {

using testing::ColourModel;
using testing::ColourModelOptions;

class Listener : public FitObserver {
 public:
  void figures(const FitFigures& figures) override { last = figures; }
  FitFigures last;
};

TrainerOptions optionsOf(uint64_t iterations) {
  TrainerOptions options;
  options.iterations = iterations;
  options.measure_interval = 5;
  options.seed = 3;
  return options;
}

/// A series, whose held-out camera may show anything.
class SpoiltSeries : public testing::SeriesViews {
 public:
  explicit SpoiltSeries(bool is_spoilt) : SeriesViews(4, 6), is_spoilt_(is_spoilt) {
    test_camera = 1;
  }
  ViewPicture load(size_t view) const override {
    ViewPicture picture = SeriesViews::load(view);
    if (role(view) != ViewRole::kTest) return picture;
    ++held_out_loads;
    if (is_spoilt_) {
      for (float& value : picture.colour) value = 1 - value;
    }
    return picture;
  }
  mutable std::atomic<int> held_out_loads{0};

 private:
  bool is_spoilt_;
};

FitViews splitByRole(const ViewSource& views) {
  FitViews split;
  for (size_t v = 0; v < views.count(); ++v) {
    (views.role(v) == ViewRole::kTest ? split.held_out : split.training).push_back(v);
  }
  return split;
}

TEST(FitOfSeries, ChoosesTheSameStateWhateverHeldOutCamerasShow) {
  std::vector<TensorTable> results;
  std::vector<uint64_t> best;
  std::vector<double> psnr;
  for (const bool is_spoilt : {false, true}) {
    const auto views = std::make_shared<SpoiltSeries>(is_spoilt);
    ColourModelOptions spoils;
    spoils.spoils_from = 60;  // so that the best is not the last
    Trainer trainer(*cpuBackends(), views, splitByRole(*views),
                    std::make_unique<ColourModel>(spoils), optionsOf(100));
    Listener listener;
    trainer.run(listener);
    results.push_back(trainer.model().state());
    best.push_back(trainer.history().best_iteration);
    psnr.push_back(trainer.history().by_budget[0].psnr);
    EXPECT_GT(views->held_out_loads, 0);
  }
  EXPECT_LT(best[0], 100u);
  EXPECT_EQ(best[0], best[1]);
  EXPECT_EQ(std::get<std::vector<float>>(results[0].at("raw.colour").values),
            std::get<std::vector<float>>(results[1].at("raw.colour").values));
  EXPECT_GT(std::abs(psnr[0] - psnr[1]), 1);
}

/// Counts the images that are loaded, and those that are in memory at once.
class CountedSeries final : public testing::SeriesViews {
 public:
  CountedSeries() : SeriesViews(6, 20) { test_camera = 0; }
  std::shared_ptr<const PackedPicture> packed(size_t view) const override {
    ++loads;
    most_alive = std::max(most_alive.load(), ++*alive_);
    return {new PackedPicture(load(view)), [alive = alive_](const PackedPicture* picture) {
              --*alive;
              delete picture;
            }};
  }
  mutable std::atomic<int> loads{0};
  mutable std::atomic<int> most_alive{0};

 private:
  std::shared_ptr<std::atomic<int>> alive_ = std::make_shared<std::atomic<int>>(0);
};

TEST(FitOfSeries, KeepsNoMoreImagesOfASeriesThanItIsAllowed) {
  struct Seen {
    int loads, most_alive;
    std::vector<float> colour;
  };
  const auto seen = [](uint64_t kept_images) {
    const auto views = std::make_shared<CountedSeries>();
    TrainerOptions options = optionsOf(200);
    options.picture_bytes = kept_images * PackedPicture(views->load(1)).bytes();
    auto model = std::make_unique<ColourModel>();
    const ColourModel& fitted = *model;
    Trainer trainer(*cpuBackends(), views, splitByRole(*views), std::move(model), options);
    Listener listener;
    trainer.run(listener);
    return Seen{views->loads, views->most_alive, fitted.colour()};
  };
  const Seen few = seen(5), all = seen(120);
  // Besides five that are kept: one at work and one that is loaded ahead.
  EXPECT_LE(few.most_alive, 7);
  EXPECT_GE(few.loads, 190);
  // Each image once.
  EXPECT_LE(all.loads, 120);
  EXPECT_GE(all.most_alive, 100);
  EXPECT_EQ(few.colour, all.colour);
}

/// Cameras that know where something moves: in the last column.
struct ToldSeries final : SpoiltSeries {
  ToldSeries() : SpoiltSeries(false) {}
  std::vector<bool> moving(size_t) const override {
    std::vector<bool> last(64);
    for (size_t i = 7; i < 64; i += 8) last[i] = true;
    return last;
  }
};

TEST(FitOfSeries, MeasuresPixelsThatAreSaidToMoveAndNoOthers) {
  const auto views = std::make_shared<ToldSeries>();
  Trainer trainer(*cpuBackends(), views, splitByRole(*views), std::make_unique<ColourModel>(),
                  optionsOf(60));
  Listener listener;
  trainer.run(listener);
  const SplatCloud cloud = trainer.model().splats(0);
  const double colour = 0.99 * static_cast<double>(cloud.sh[0] * kShC0 + 0.5f);
  const double error =
      -10 * (std::log10(std::abs(colour - 0.3)) + std::log10(std::abs(colour - 0.7)));
  // As above; told by differences it would be of the columns from 3 on, more than 0.3 dB off.
  EXPECT_NEAR(trainer.history().by_budget[0].moving_psnr, error, 0.3);
}

TEST(FitOfSeries, MeasuresMovingPixelsOfSeriesApart) {
  const auto views = std::make_shared<SpoiltSeries>(false);
  Trainer trainer(*cpuBackends(), views, splitByRole(*views), std::make_unique<ColourModel>(),
                  optionsOf(60));
  Listener listener;
  trainer.run(listener);
  for (const FitMeasure& measure : trainer.history().measures) {
    // One colour is learned: the half that moves is farther from it than all.
    EXPECT_LT(measure.moving_psnr, measure.psnr);
  }
  const FitMeasure& end = trainer.history().by_budget[0];
  // Means of the left half, 0.3, and of the moving columns, 0.3 and 0.7 in turn: the model has
  // about 0.4. Columns 3 to 7 move, since their neighbours do: of them the first stays at 0.3.
  double error = 0;
  const double colour = [&] {
    const SplatCloud cloud = trainer.model().splats(0);
    return 0.99 * static_cast<double>(cloud.sh[0] * kShC0 + 0.5f);
  }();
  for (const double moved : {0.3, 0.7}) {
    const double squares = (std::pow(colour - 0.3, 2) + 4 * std::pow(colour - moved, 2)) / 5;
    error += -10 * std::log10(squares) / 2;
  }
  // A splat covers 0.99 of a pixel, 8-bit values of the images are rounded: 0.3 dB.
  EXPECT_NEAR(end.moving_psnr, error, 0.3);
  ASSERT_TRUE(listener.last.best_moving_psnr.has_value());
}

}  // namespace
}  // namespace stipple
