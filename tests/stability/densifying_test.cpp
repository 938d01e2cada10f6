#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/random.h"
#include "densify/known_views.h"
#include "densify/quantities/edge_weights.h"
#include "densify/strategies.h"

// Strategies that are told extreme things about extreme splats, with traps on: their edits stay
// valid and finite, and within the cap.

namespace stipple {
namespace {

constexpr size_t kCount = 240;

/// Numbers of all kinds, chosen for each row by a key.
struct Kinds {
  std::vector<float> values;
  float at(uint64_t row, uint64_t what) const {
    return values[keyedBits(what, RandomUse::kThinning, row) % values.size()];
  }
};

/// Needles and discs of 1e6 and more, at the ends of what numbers can be, faint and opaque.
RawSplats extremeSplats() {
  const Kinds places{{0, 1, -1, 1e6f, 1e-30f, -1e15f}};
  const Kinds turns{{1, 0.5f, -0.3f, 1e-18f, 1e15f}};
  const Kinds sizes{{-69, -20, -13.8f, -5, 0, 3, 20, 40}};
  const Kinds logits{{-80, -13.8f, -5.3f, -4.6f, 0, 1.4f, 13.8f, 80}};
  RawSplats splats;
  splats.sh_degree = 1;
  splats.resize(kCount);
  for (size_t k = 0; k < kCount * 3; ++k) {
    splats.positions[k] = places.at(k, 1);
    splats.log_scales[k] = sizes.at(k, 2);
  }
  for (size_t k = 0; k < kCount * 4; ++k) splats.rotations[k] = turns.at(k, 3);
  for (size_t k = 0; k < kCount; ++k) splats.logits[k] = logits.at(k, 4);
  return splats;
}

/// Every statistic, of values from nothing to as large as pictures allow. In: same: all alike.
struct Told {
  std::array<std::vector<float>, kStatisticCount> arrays;
  std::vector<uint8_t> visible;

  Told(size_t count, uint64_t what, bool same) {
    const Kinds kinds{{0, 1e-38f, 1e-30f, 1e-12f, 1e-4f, 1, 1e4f, 1e12f}};
    for (size_t k = 0; k < count; ++k) {
      visible.push_back(keyedBits(what, RandomUse::kPalette, k) % 4 > 0);
    }
    for (size_t s = 0; s < kStatisticCount; ++s) {
      const bool pair = s == static_cast<size_t>(Statistic::kScreenGradients) ||
                        s == static_cast<size_t>(Statistic::kAbsoluteScreenGradients);
      for (size_t k = 0; k < count * (pair ? 2 : 1); ++k) {
        arrays[s].push_back(same ? kinds.values[what % 8] : kinds.at(k, what * 16 + s));
      }
    }
  }
};

constexpr uint64_t kViews = 8;

/// What views show: pictures of hard colours, one from behind everything.
testing::KnownViews hardViews(const RawSplats& splats, const Strategy& strategy, bool same) {
  testing::KnownViews views;
  views.cloud = activated(splats);
  if (strategy.parameterisation()) strategy.parameterisation()->activate(splats, views.cloud);
  const Kinds colours{{0, 1, 0.5f, -1, 1e6f, 1e-30f}};
  for (uint64_t v = 0; v < kViews; ++v) {
    testing::KnownView view = testing::plainView(testing::forwardCamera(64, 32, 50), 0.5f, 0.5f);
    if (v == 2) view.camera.world_to_camera(2, 3) = -1e18;
    for (size_t k = 0; k < view.target.size() && !same; ++k) {
      view.target[k] = colours.at(k, v);
      view.picture[k] = colours.at(k, v + 8);
    }
    const Told told(splats.size(), v, same);
    view.visible = told.visible;
    view.statistics = told.arrays;
    views.views.push_back(view);
  }
  return views;
}

void expectFinite(const RawSplats& splats) {
  for (size_t i = 0; i < arrayCount(splats); ++i) {
    for (const float value : arrayOf(splats, static_cast<RawArray>(i))) {
      ASSERT_TRUE(std::isfinite(value));
    }
  }
}

/// In: extent of the cameras; cap; same: every statistic is the same for all splats.
void drive(const std::string& name, double extent, uint64_t cap, bool same) {
  SCOPED_TRACE(name + ", extent " + std::to_string(extent));
  const auto strategy = makeStrategy(name);
  RawSplats splats = extremeSplats();
  for (const ExtraParameter& extra : strategy->parameters()) {
    splats.extra_lengths.push_back(extra.row_length);
  }
  splats.extras = strategy->initialExtras(splats);
  FitMoment moment;
  moment.extent = extent;
  moment.max_splats = cap;
  moment.position_rate = 1e-3;
  moment.view_count = kViews;
  for (const uint64_t iteration :
       {300, 591, 599, 600, 1500, 3000, 3300, 3399, 3400, 14600, 14900}) {
    if (splats.size() == 0) break;
    moment.iteration = iteration;
    testing::KnownViews views = hardViews(splats, *strategy, same);
    const size_t view = iteration % kViews;
    const TrainingView seen{view, 64, 32, views.views[view].target};
    moment.view = &seen;
    strategy->requests(moment);
    strategy->observe(moment, views.observed(view));
    if (strategy->wantsSweep(moment)) strategy->sweep(moment, views);
    const RawSplats moments = zerosLike(splats);
    for (const auto& edit : {strategy->afterStep(moment, {splats, moments, moments}),
                             strategy->edit(moment, {splats, moments, moments})}) {
      if (!edit) continue;
      const size_t before = splats.size();
      validate(*edit, splats);
      const EditTarget target_of_edit{&splats, false};
      applyEdit(*edit, {&target_of_edit, 1});
      expectFinite(splats);
      EXPECT_LE(splats.size(), std::max<size_t>(before, cap));
    }
    strategy->restore(strategy->state());
  }
  EXPECT_TRUE(same || splats.size() != kCount);
}

TEST(DensifyingStability, GradientsOfEverySizeOnSplatsOfEverySize) {
  for (const char* name :
       {"adaptive", "absolute", "improved", "direction", "direction(power=1000)", "taming",
        "revised", "adaptive+long_axis_split+recovery_pruning+edge_aware_score+growth_control",
        "absolute+opacity_correction", "improved+long_axis_split(offset=10,long=0.01,minor=0.01)",
        "volumetric", "volumetric(exponent=1,least_shrink=1,largest_shrink=1000000)", "mcmc",
        "mcmc(noise=1e12)", "metropolis", "metropolis(released=1,crowding=0)", "frequency",
        "frequency(threshold=1e-12,quantile=0)"}) {
    for (const double extent : {0.0, 1e-12, 5.0, 1e12}) {
      drive(name, extent, 400, false);
      drive(name, extent, 400, true);
    }
  }
}

TEST(DensifyingStability, EdgesOfHardPictures) {
  for (const float value : {0.0f, 1.0f, 0.5f, -1e30f, 3e38f, 1e-40f}) {
    for (const auto& [width, height] :
         {std::pair{1u, 1u}, {1u, 9u}, {2u, 2u}, {3u, 3u}, {40u, 30u}}) {
      std::vector<float> picture(size_t{width} * height * 3, value);
      for (const float weight : edgeWeights(width, height, picture)) EXPECT_EQ(weight, 0.0f);
      picture[0] = 1;
      for (const float weight : edgeWeights(width, height, picture)) {
        EXPECT_TRUE(weight >= 0 && weight <= 1);
      }
    }
  }
}

}  // namespace
}  // namespace stipple
