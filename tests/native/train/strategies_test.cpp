// Every strategy, in short fits of a cloud that is known.

#include <gtest/gtest.h>

#include <string>

#include "base/parallel.h"
#include "densify/strategies.h"
#include "splat/render/render_backward.h"
#include "train/fit_scene.h"
#include "train/loop/explicit_model.h"
#include "train/loop/picture_store.h"
#include "train/loop/view_evaluator.h"

namespace stipple {
namespace {

using namespace stipple::testing;

constexpr size_t kViews = 10;
constexpr size_t kCap = 150;

const std::shared_ptr<MemoryViewSource>& scene() {
  static const std::shared_ptr<MemoryViewSource> views = [] {
    const SplatCloud truth = ballOfSplats(60, 1);
    auto made = viewsOf(truth, camerasAround(kViews, 48));
    made->setPoints(pointsOf(truth, 0.05f, 2));
    return made;
  }();
  return views;
}

/// A fit whose strategy may look around between steps, of the schedule of 3000 iterations.
class Looking {
 public:
  explicit Looking(const std::string& strategy)
      : model_(makeExplicitModel(*cpuBackends(), *scene(), allViews(*scene()), options(strategy))),
        training_(allViews(*scene())),
        pictures_(scene(), 1 << 24),
        views_(
            *cpuBackends(), [this] { return model_->splats(0); }, pictures_, training_, kBlack,
            0.2),
        fit_(*scene(), *model_, 3000) {}

  void run(uint64_t last) {
    while (fit_.moment().iteration <= last) {
      views_.forgetSplats();
      fit_.run(fit_.moment().iteration, &views_);
      most_ = std::max(most_, static_cast<size_t>(model_->budgets()[0]));
    }
  }
  /// Goes on where another one stands.
  void follow(const Looking& other) {
    model_->restore(other.model_->state());
    fit_.moment() = other.moment();
  }
  const FitMoment& moment() const { return const_cast<Fit&>(fit_).moment(); }
  FitModel& model() { return *model_; }
  size_t most() const { return most_; }  ///< splats that there were at one time

 private:
  static constexpr double kBlack[3] = {0, 0, 0};
  static ExplicitModelOptions options(const std::string& strategy) {
    ExplicitModelOptions options;
    options.sh_degree = 1;
    options.max_splats = kCap;
    options.strategy = strategy;
    return options;
  }

  std::unique_ptr<FitModel> model_;
  std::vector<size_t> training_;
  PictureStore pictures_;
  FitViewEvaluator views_;
  Fit fit_;
  size_t most_ = 0;
};

void expectSame(const TensorTable& a, const TensorTable& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [name, tensor] : a) {
    ASSERT_TRUE(b.contains(name)) << name;
    EXPECT_TRUE(tensor.values == b.at(name).values) << name;
  }
}

class EveryStrategy : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryStrategy, LearnsTheViewsWithinTheCap) {
  Looking fit(GetParam());
  fit.run(10);
  const double before = meanPsnr(fit.model().splats(0), *scene());
  fit.run(700);
  const SplatCloud found = fit.model().splats(0);
  validate(found, "fitted");
  EXPECT_LE(fit.most(), kCap);
  EXPECT_GE(found.size(), 20u);
  EXPECT_GT(meanPsnr(found, *scene()), before + 6);
  EXPECT_GT(meanPsnr(found, *scene()), 22);
  RecordProperty("psnr", std::to_string(meanPsnr(found, *scene())));
  RecordProperty("splats", std::to_string(found.size()));
}

TEST_P(EveryStrategy, GivesTheSameBitsForAnyNumberOfThreads) {
  Looking one(GetParam()), two(GetParam());
  withThreads(1, [&] { one.run(220); });
  withThreads(2, [&] { two.run(220); });
  expectSame(one.model().state(), two.model().state());
}

TEST_P(EveryStrategy, GoesOnBitForBitFromACheckpoint) {
  Looking first(GetParam()), other(GetParam());
  first.run(150);
  other.follow(first);
  first.run(310);
  other.run(310);
  expectSame(first.model().state(), other.model().state());
}

INSTANTIATE_TEST_SUITE_P(Fit, EveryStrategy, ::testing::ValuesIn(strategyNames()),
                         [](const auto& strategy) { return strategy.param; });

/// Each part in the strategy that most are made for.
class EveryPart : public ::testing::TestWithParam<std::string> {};

std::vector<std::string> partNames() {
  std::vector<std::string> names;
  for (const StrategyEntry& entry : partEntries()) names.emplace_back(entry.name);
  return names;
}

TEST_P(EveryPart, LearnsTheViewsWithinTheCap) {
  Looking fit("adaptive+" + GetParam());
  fit.run(10);
  const double before = meanPsnr(fit.model().splats(0), *scene());
  fit.run(510);  // a reset at 300, a recovery at 400
  validate(fit.model().splats(0), "fitted");
  EXPECT_LE(fit.most(), kCap);
  EXPECT_GT(meanPsnr(fit.model().splats(0), *scene()),
            before + 2);  // growth_control still holds the number back
}

INSTANTIATE_TEST_SUITE_P(Fit, EveryPart, ::testing::ValuesIn(partNames()),
                         [](const auto& part) { return part.param; });

TEST(Strategies, PartsGoTogether) {
  Looking fit(
      "direction+edge_aware_score+long_axis_split+recovery_pruning+growth_control+"
      "multi_step_update");
  fit.run(510);
  validate(fit.model().splats(0), "fitted");
  EXPECT_LE(fit.most(), kCap);
  EXPECT_GT(meanPsnr(fit.model().splats(0), *scene()), 20);
}

/// Shares of the weight of edges that splats and the background take add up to the whole.
TEST(Strategies, EdgesAreSharedByWhatCoversThem) {
  // One opaque splat that fills the picture, in front of nothing.
  SplatCloud cloud = ballOfSplats(60, 1);
  const Camera camera = camerasAround(1, 48)[0];
  const std::vector<float> edges(48 * 48, 1.0f);
  for (const size_t count : {size_t{1}, size_t{60}}) {
    if (count == 1) {
      cloud.resize(1);
      std::fill_n(cloud.scales.begin(), 3, 0.5f);
    } else {
      cloud = ballOfSplats(60, 1);
    }
    const SplatInstance instance{&cloud};
    const RenderResult drawn = renderTiled({&instance, 1}, camera, {});
    BackwardInput input;
    const std::vector<float> none(48 * 48 * 4, 0.0f);
    input.colour_gradient = none;
    input.edge_weights = edges;
    input.with_blending_weights = true;
    const BackwardResult result = renderBackward({&instance, 1}, camera, {}, input);
    double by_splats = 0, behind = 0;
    for (const float weight : result.instances[0].edge_weights) {
      by_splats += static_cast<double>(weight);
    }
    for (size_t i = 3; i < drawn.colour.size(); i += 4) {
      behind += 1 - static_cast<double>(drawn.colour[i]);
    }
    // Sums of 2304 pixels in float32.
    EXPECT_NEAR(by_splats + behind, 48 * 48, 48 * 48 * 1e-5);
    EXPECT_GT(by_splats, 48);
    EXPECT_EQ(result.instances[0].edge_weights, result.instances[0].blending_weights);
  }
}

}  // namespace
}  // namespace stipple
