// Fits know their backend by its interface alone: through another one, in double and with its
// arrays kept to itself, they come out the same.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "densify/strategies.h"
#include "fit_scene.h"
#include "reference_backend.h"
#include "toy_views.h"
#include "train/loop/densify_cloud.h"
#include "train/loop/explicit_model.h"
#include "train/loop/field_model.h"
#include "train/loop/refine.h"
#include "train/loop/trainer.h"
#include "train/loop/visibility.h"

namespace stipple {
namespace {

using namespace stipple::testing;

constexpr uint64_t kSteps = 50;
constexpr double kBlack[3] = {0, 0, 0};

/// Opaque: a photograph, over nothing.
std::shared_ptr<MemoryViewSource> opaqueViews(size_t splats, size_t count, uint32_t size) {
  const auto whole = viewsOf(ballOfSplats(splats, 1), camerasAround(count, size));
  auto views = std::make_shared<MemoryViewSource>(whole->colourSpace());
  for (size_t v = 0; v < count; ++v) {
    ViewPicture picture = whole->load(v);
    picture.alpha.clear();
    picture.depth.clear();
    views->add(whole->camera(v), std::move(picture));
  }
  return views;
}

/// Reads what it declares, in steps as well as at an event, and edits by it.
class Careful : public Strategy {
 public:
  const char* name() const override { return "careful"; }
  StatisticRequest requests(const FitMoment& moment) const override {
    StatisticRequest request;
    request.blending_weights = request.drawn_splats = moment.iteration == 20;
    return request;
  }
  bool regularises(const FitMoment&) const override { return true; }
  double loss(const FitMoment&, const SplatCloud& cloud, const CloudGradient& by) override {
    double sum = 0;
    for (size_t i = 0; i < cloud.size(); ++i) {
      sum += 1e-3 * static_cast<double>(cloud.opacities[i]);
      by.opacities[i] += 1e-3f;
    }
    return sum / static_cast<double>(cloud.size());
  }
  void observe(const FitMoment&, const ViewStatistics& view) override {
    EXPECT_GT(view.loss, 0);
    const auto weights = view.of(Statistic::kBlendingWeights);
    heaviest_ =
        static_cast<uint32_t>(std::max_element(weights.begin(), weights.end()) - weights.begin());
    place_.assign(&view.splats.positions[heaviest_ * size_t{3}],
                  &view.splats.positions[heaviest_ * size_t{3}] + 3);
  }
  bool stepGate(const FitMoment& moment) const override { return moment.iteration != 10; }
  std::optional<SplatEdit> edit(const FitMoment& moment, const SplatStore& store) override {
    if (moment.iteration != 20) return {};
    SplatEdit edit;
    edit.append = rowsOf(store.splats(), {heaviest_});
    EXPECT_EQ(store.firstMoments().size(), store.size());
    std::copy(place_.begin(), place_.end(), edit.append.positions.begin());
    return edit;
  }

 private:
  uint32_t heaviest_ = 0;
  std::vector<float> place_;
};

struct FitOutcome {
  std::vector<double> losses;
  SplatCloud cloud;
};

FitOutcome explicitFit(const BackendFactory& backends, std::unique_ptr<Strategy> strategy) {
  const auto views = opaqueViews(30, 6, 40);
  SplatCloud start = ballOfSplats(30, 1);
  for (float& value : start.sh) value *= 0.3f;
  for (float& scale : start.scales) scale *= 1.2f;
  ExplicitModelOptions options;
  options.sh_degree = 0;
  const auto model = makeExplicitModel(backends, start, std::move(strategy), options);
  Fit fit(*views, *model, 1000);
  FitOutcome outcome;
  for (uint64_t i = 1; i <= kSteps; ++i) outcome.losses.push_back(fit.run(i).loss);
  outcome.cloud = model->splats(0);
  return outcome;
}

/// Root of the mean square of the differences, over that of the values.
double relativeDifference(const std::vector<float>& a, const std::vector<float>& b) {
  double difference = 0, size = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    difference += std::pow(static_cast<double>(a[i]) - static_cast<double>(b[i]), 2);
    size += std::pow(static_cast<double>(b[i]), 2);
  }
  return std::sqrt(difference / size);
}

/// In: tolerance, of the losses, relative.
void expectAlike(const std::vector<double>& losses, const std::vector<double>& expected,
                 double tolerance) {
  ASSERT_EQ(losses.size(), expected.size());
  double largest = 0;
  for (size_t i = 0; i < losses.size(); ++i) {
    EXPECT_NEAR(losses[i], expected[i], tolerance * expected[i]) << "step " << i + 1;
    largest = std::max(largest, std::abs(losses[i] / expected[i] - 1));
  }
  ::testing::Test::RecordProperty("largest_difference", std::to_string(largest));
  EXPECT_LT(expected.back(), 0.9 * expected.front());  // something was learned
}

TEST(RenderSeam, AFitOfExplicitSplatsAgreesWithTheReference) {
  const ReferenceBackends reference;
  const FitOutcome expected = explicitFit(reference, std::make_unique<Careful>());
  const FitOutcome seen = explicitFit(*cpuBackends(), std::make_unique<Careful>());
  EXPECT_EQ(reference.backends, 1);
  EXPECT_EQ(expected.cloud.size(), 31u);
  EXPECT_EQ(seen.cloud.size(), 31u);
  // A derivative in float32 is off by about 1e-6 of those it sums, and so is what it moves: the
  // losses of 50 steps differ by 1e-6. Ten times that is allowed. Where a sum nearly cancels, Adam
  // makes a larger step of what is left, so single numbers may differ by more.
  expectAlike(seen.losses, expected.losses, 1e-5);
  EXPECT_LT(relativeDifference(seen.cloud.positions, expected.cloud.positions), 1e-4);
  EXPECT_LT(relativeDifference(seen.cloud.scales, expected.cloud.scales), 1e-3);
  EXPECT_LT(relativeDifference(seen.cloud.sh, expected.cloud.sh), 1e-3);
}

/// Leaves a fifth of the splats out of each image, and draws the others as much more opaque.
class LeavesOut final : public Strategy {
 public:
  const char* name() const override { return "leaves_out"; }
  std::vector<float> opacityFactors(const FitMoment& moment, size_t count) const override {
    std::vector<float> factors(count, 1.25f);
    for (size_t i = moment.iteration % 5; i < count; i += 5) factors[i] = 0;
    return factors;
  }
};

/// Controls nothing.
class Nothing final : public Strategy {
 public:
  const char* name() const override { return "nothing"; }
};

TEST(RenderSeam, AFitThatLeavesSplatsOutAgreesWithTheReference) {
  const FitOutcome expected = explicitFit(ReferenceBackends(), std::make_unique<LeavesOut>());
  const FitOutcome seen = explicitFit(*cpuBackends(), std::make_unique<LeavesOut>());
  expectAlike(seen.losses, expected.losses, 1e-5);  // as above
  EXPECT_LT(relativeDifference(seen.cloud.opacities, expected.cloud.opacities), 1e-3);
  const FitOutcome whole = explicitFit(*cpuBackends(), std::make_unique<Nothing>());
  EXPECT_GT(relativeDifference(seen.cloud.opacities, whole.cloud.opacities), 1e-2);
}

TEST(RenderSeam, AFitOfAFieldAgreesWithTheReference) {
  const auto views = toyViews(toyBall(2000), 8, 24);
  FieldModelOptions options;
  options.least_anchors = 32;
  options.most_anchors = 96;
  options.gaussians_per_anchor = 4;
  options.leaf_level = 5;
  options.seed = 1;
  const auto fit = [&](const BackendFactory& backends) {
    const auto model = makeFieldModel(backends, *views, allViews(*views), options);
    std::vector<double> losses;
    for (uint64_t i = 1; i <= kSteps; ++i) {
      FitMoment moment;
      moment.iteration = i;
      moment.iterations = kSteps;
      StepView view;
      view.index = (i * 3) % 8;
      view.camera = &views->camera(view.index);
      const ViewPicture picture = views->load(view.index);
      view.target = picture.colour.data();
      losses.push_back(model->step(moment, view, nullptr, nullptr).loss);
    }
    return losses;
  };
  const ReferenceBackends reference;
  const std::vector<double> expected = fit(reference), seen = fit(*cpuBackends());
  EXPECT_EQ(reference.passes, 1);
  // As above; a network shares its numbers among all splats, so that few derivatives cancel.
  expectAlike(seen, expected, 1e-5);
}

/// Keeps the host's copy of the splats, and edits by it two steps later.
class Late final : public Strategy {
 public:
  const char* name() const override { return "late"; }
  std::optional<SplatEdit> edit(const FitMoment& moment, const SplatStore& store) override {
    if (moment.iteration == 1) kept_ = &store.splats();
    if (moment.iteration != 3) return {};
    SplatEdit edit;
    edit.append = rowsOf(*kept_, {0});
    return edit;
  }

 private:
  const RawSplats* kept_ = nullptr;
};

/// Reads splats that it did not ask for.
class Undeclared final : public Strategy {
 public:
  const char* name() const override { return "undeclared"; }
  StatisticRequest requests(const FitMoment&) const override {
    StatisticRequest request;
    request.blending_weights = true;
    return request;
  }
  void observe(const FitMoment&, const ViewStatistics& view) override {
    first_ = view.splats.positions[0];
  }
  std::optional<SplatEdit> edit(const FitMoment&, const SplatStore& store) override {
    SplatEdit edit;
    edit.append = rowsOf(store.splats(), {0});
    edit.append.positions[0] = first_;
    return edit;
  }

 private:
  float first_ = 0;
};

TEST(RenderSeam, AReadThatNobodyDeclaredFails) {
  EXPECT_NO_THROW(explicitFit(ReferenceBackends(), std::make_unique<Careful>()));
  EXPECT_THROW(explicitFit(ReferenceBackends(), std::make_unique<Late>()), Error);
  EXPECT_THROW(explicitFit(ReferenceBackends(), std::make_unique<Undeclared>()), Error);
}

/// Every strategy that needs no step-by-step copy: none is made in a step without an event.
TEST(RenderSeam, StrategiesReadSplatsAtEventsAlone) {
  class Counting final : public SplatReader {
   public:
    explicit Counting(const RawSplats& splats) : splats_(splats) {}
    const RawSplats& splats() const override { return ++count, splats_; }
    const RawSplats& firstMoments() const override { return ++count, splats_; }
    const RawSplats& secondMoments() const override { return ++count, splats_; }
    mutable int count = 0;

   private:
    const RawSplats& splats_;
  };
  const RawSplats splats = rawSplats(ballOfSplats(20, 1));
  for (const std::string& name : strategyNames()) {
    const auto strategy = makeStrategy(name);
    // The table of docs/architecture.md; a strategy with the part filter_3d has one too.
    EXPECT_EQ(strategy->parameterisation() != nullptr, name == "frequency") << name;
    EXPECT_TRUE(makeStrategy("mcmc+filter_3d")->parameterisation());
    if (strategy->parameterisation()) continue;  // raw numbers pass through the host in every step
    const Counting reader(splats);
    FitMoment moment;
    moment.iteration = 731;  // of 30,000: between two events
    moment.position_rate = 1e-4;
    EXPECT_FALSE(strategy->edit(moment, SplatStore(splats.size(), reader))) << name;
    EXPECT_EQ(reader.count, 0) << name;
    // The mean of opacities and scales is a formula of theirs.
    EXPECT_EQ(strategy->regularises(moment), name == "mcmc" || name == "metropolis") << name;
    strategy->afterStep(moment, SplatStore(splats.size(), reader));
    const bool has_noise = name == "mcmc";  // on places, drawn here by shapes and opacities
    EXPECT_EQ(reader.count > 0, has_noise) << name;
  }
}

TEST(RenderSeam, WhatDrawsIsMadeByTheFactory) {
  const auto views = opaqueViews(30, 9, 32);
  const SplatCloud cloud = ballOfSplats(30, 1);
  const ReferenceBackends reference;
  ExplicitModelOptions options;
  options.sh_degree = 0;
  options.strategy = "adaptive";
  TrainerOptions how;
  how.iterations = 1;
  Trainer trainer(reference, views, splitViews(*views, 8),
                  makeExplicitModel(reference, cloud, std::make_unique<Careful>(), options), how);
  FitObserver nobody;
  trainer.run(nobody);
  EXPECT_EQ(reference.backends, 1);
  EXPECT_EQ(reference.passes, 1);  // of views between steps
  EXPECT_EQ(reference.images, 1);  // of measurements
  EXPECT_GT(trainer.history().by_budget.at(0).psnr, 15);

  ViewRigOptions rig;
  rig.count = 2;
  rig.size = 24;
  const std::vector<Camera> cameras = viewsForVisibility(reference, cloud, rig);
  EXPECT_EQ(reference.images, 2);
  const std::vector<float> expected = splatVisibility(reference, cloud, cameras);
  EXPECT_EQ(reference.passes, 2);
  const std::vector<float> seen = splatVisibility(*cpuBackends(), cloud, cameras);
  for (size_t i = 0; i < seen.size(); ++i) EXPECT_NEAR(seen[i], expected[i], 1e-4) << i;
}

}  // namespace
}  // namespace stipple
