#include "train/anchors/relay_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "train/anchors/relay_segments.h"
#include "train/loop/trainer.h"
#include "train/toy_views.h"

namespace stipple {
namespace {

using testing::ElementsAre;

constexpr uint32_t kFrames = 13;
constexpr size_t kCameras = 6;
constexpr uint32_t kSize = 40;

KeyFrameClip clipOf(uint32_t frames, uint32_t spacing, KeyFrameBlend blend) {
  KeyFrameClip clip;
  clip.frames_per_second = 10;
  clip.frame_count = frames;
  clip.spacing = spacing;
  clip.blend = blend;
  return clip;
}

/// A ball that goes to the side and back; a camera of the last name is held out.
std::shared_ptr<MemoryViewSource> movingBall() {
  SplatCloud ball = toyBall(1200, 0.6f);
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (uint32_t frame = 0; frame < kFrames; ++frame) {
    SplatCloud moved = ball;
    const float aside = 0.4f * std::sin(0.5f * static_cast<float>(frame));
    for (size_t i = 0; i < moved.size(); ++i) moved.positions[i * 3] += aside;
    const auto shown = toyViews(moved, kCameras, kSize);
    for (size_t v = 0; v < kCameras; ++v) {
      views->add(shown->camera(v), shown->load(v), std::to_string(v) + "/" + std::to_string(frame),
                 0.1 * frame);
    }
  }
  views->setPoints(toyPoints(toyBall(300, 0.6f)));
  return views;
}

RelayModelOptions smallOptions(uint64_t iterations) {
  RelayModelOptions options;
  options.anchors.most_anchors = 400;
  options.anchors.start_anchors = 150;
  options.anchors.gaussians_per_anchor = 4;
  options.anchors.antialias = Antialias::kMip;
  options.anchors.seed = 1;
  options.clip = clipOf(kFrames, 6, KeyFrameBlend::kLearned);
  options.clip.first_key = firstKeyOf(options.clip);  // key frames 3 and 9
  options.iterations = iterations;
  return options;
}

class Quiet : public FitObserver {
 public:
  void figures(const FitFigures&) override {}
  void save(const TensorTable& table) override {
    if (saved.empty()) saved = table;
  }
  TensorTable saved;
};

/// Counts what is asked of it.
class CountingStore final : public KeyFrameStore {
 public:
  void clear() override { parts_.clear(); }
  void put(const std::string& name, const TensorTable& table) override {
    names.push_back(name);
    parts_.put(name, table);
  }
  std::optional<TensorTable> get(const std::string& name) const override {
    return parts_.get(name);
  }
  std::vector<std::string> names;

 private:
  MemoryKeyFrames parts_;
};

struct Fit {
  explicit Fit(const RelayModelOptions& options, uint64_t checkpoint = 0,
               std::shared_ptr<CountingStore> parts = std::make_shared<CountingStore>())
      : views(movingBall()), store(std::move(parts)) {
    TrainerOptions trainer_options;
    trainer_options.iterations = options.iterations;
    trainer_options.seed = 3;
    trainer_options.checkpoint_interval = checkpoint;
    FitViews split;
    for (size_t v = 0; v < views->count(); ++v) {
      (v % kCameras == kCameras - 1 ? split.held_out : split.training).push_back(v);
    }
    auto made = makeRelayModel(*cpuBackends(), *views, split.training, options, store);
    model = made.get();
    trainer =
        std::make_unique<Trainer>(*cpuBackends(), views, split, std::move(made), trainer_options);
  }

  /// The first steps, which the model alone makes.
  void runTo(uint64_t steps, uint64_t iterations) {
    for (uint64_t i = 0; i < steps; ++i) {
      FitMoment moment;
      moment.iteration = i + 1;
      moment.iterations = iterations;
      moment.extent = 1;
      const size_t index = *model->viewAt(i);
      const size_t v = index / (kCameras - 1) * kCameras + index % (kCameras - 1);
      StepView view;
      view.camera = &views->camera(v);
      view.time = views->time(v);
      const ViewPicture picture = views->load(v);
      view.target = picture.colour.data();
      model->step(moment, view, nullptr, nullptr);
    }
  }

  std::shared_ptr<MemoryViewSource> views;
  std::shared_ptr<CountingStore> store;
  FitModel* model;
  std::unique_ptr<Trainer> trainer;
  Quiet observer;
};

TEST(RelaySegments, HaveAllStagesInTheirOrder) {
  const KeyFrameClip clip = clipOf(25, 8, KeyFrameBlend::kLearned);  // three key frames
  const std::vector<RelaySegment> segments = relaySegments(1000, clip);
  ASSERT_EQ(segments.size(), 1u + 3 + 3 + 2);
  EXPECT_EQ(segments.front().begin, 0u);
  EXPECT_EQ(segments.front().end, 400u);
  EXPECT_EQ(segments.back().end, 1000u);
  for (size_t i = 1; i < segments.size(); ++i) {
    EXPECT_EQ(segments[i].begin, segments[i - 1].end) << i;
  }
  for (uint32_t key = 0; key < 3; ++key) {
    EXPECT_EQ(segments[1 + 2 * key].stage, RelayStage::kKeyFrame);
    EXPECT_EQ(segments[2 + 2 * key].stage, RelayStage::kWindow) << "before the next key frame";
    EXPECT_EQ(segments[1 + 2 * key].key, key);
    EXPECT_EQ(segments[2 + 2 * key].key, key);
    EXPECT_EQ(segments[7 + std::min(key, 1u)].stage, RelayStage::kBlend);
  }
  EXPECT_NEAR(static_cast<double>(segments[4].end - segments[4].begin), 500.0 / 3, 1);
  // Without blending its steps go to the windows; few steps leave one for each segment.
  EXPECT_EQ(relaySegments(1000, clipOf(25, 8, KeyFrameBlend::kNone)).size(), 7u);
  for (const RelaySegment& one : relaySegments(3, clip)) EXPECT_GT(one.end, one.begin);
}

TEST(RelaySegments, LearnFromTheViewsOfTheirTime) {
  const KeyFrameClip clip = clipOf(25, 8, KeyFrameBlend::kLearned);
  std::vector<double> times;
  for (int frame = 0; frame < 25; ++frame) times.push_back(0.1 * frame);
  const auto framesOf = [&](RelayStage stage, uint32_t key) {
    return viewsOfSegment({stage, key, 0, 1}, clip, times);
  };
  EXPECT_EQ(framesOf(RelayStage::kGlobal, 0).size(), 25u);
  EXPECT_THAT(framesOf(RelayStage::kKeyFrame, 1), ElementsAre(7u, 8u, 9u));
  EXPECT_EQ(framesOf(RelayStage::kWindow, 1).front(), 8u) << "the nearest first";
  EXPECT_EQ(framesOf(RelayStage::kWindow, 1).back(), 16u);
  const std::vector<size_t> window = framesOf(RelayStage::kWindow, 1);
  EXPECT_EQ(std::count(window.begin(), window.end(), 8u), 4) << "the key frame";
  EXPECT_EQ(std::count(window.begin(), window.end(), 11u), 3);
  EXPECT_EQ(std::count(window.begin(), window.end(), 16u), 1) << "the next one";
  EXPECT_EQ(framesOf(RelayStage::kBlend, 1).front(), 8u);
  EXPECT_EQ(framesOf(RelayStage::kBlend, 1).back(), 16u);
  // Key frames without views take the nearest.
  times = {0.0, 0.1, 2.4};
  EXPECT_THAT(framesOf(RelayStage::kKeyFrame, 1), ElementsAre(1u));
}

TEST(RelaySegments, WindowsReachFurtherWithEveryStep) {
  const KeyFrameClip clip = clipOf(25, 8, KeyFrameBlend::kLearned);
  std::vector<double> times;
  for (int frame = 0; frame < 25; ++frame) times.push_back(0.1 * frame);
  const RelaySegment window = {RelayStage::kWindow, 1, 0, 100};
  const std::vector<size_t> views = viewsOfSegment(window, clip, times);
  const auto furthest = [&](double done) {
    const size_t count = viewsInReach(window, clip, times, views, done);
    size_t most = 0;
    for (size_t i = 0; i < count; ++i) {
      most = std::max(most, views[i] > 8 ? views[i] - 8 : 8 - views[i]);
    }
    return most;
  };
  EXPECT_EQ(furthest(0.0), 0u) << "the key frame alone: the next is an eighth of the spacing away";
  EXPECT_EQ(furthest(0.1), 1u);
  EXPECT_EQ(furthest(0.35), 4u);
  EXPECT_EQ(furthest(0.7), 8u);
  EXPECT_EQ(viewsInReach(window, clip, times, views, 1.0), views.size());
  // Other stages have all of their views at once, and a window without a near one has the nearest.
  const RelaySegment global = {RelayStage::kGlobal, 0, 0, 100};
  const std::vector<size_t> all = viewsOfSegment(global, clip, times);
  EXPECT_EQ(viewsInReach(global, clip, times, all, 0.0), 25u);
  times = {0.0, 1.6};
  const std::vector<size_t> few = viewsOfSegment(window, clip, times);
  EXPECT_EQ(viewsInReach(window, clip, times, few, 0.0), 1u);
}

TEST(RelaySegments, WhatOneKeyFrameShowsAloneCountsAlike) {
  KeyFrameClip clip = clipOf(25, 8, KeyFrameBlend::kLearned);
  clip.first_key = 4;
  std::vector<double> times;
  for (int frame = 0; frame < 25; ++frame) times.push_back(0.1 * frame);
  const auto draws = [&](uint32_t key, size_t view) {
    const auto views = viewsOfSegment({RelayStage::kWindow, key, 0, 1}, clip, times);
    return std::count(views.begin(), views.end(), view);
  };
  EXPECT_EQ(draws(0, 0), 4);
  EXPECT_EQ(draws(0, 9), 2);
  EXPECT_EQ(draws(1, 4), 1);
  EXPECT_EQ(draws(2, 24), 4);
  EXPECT_EQ(draws(2, 15), 2);
}

TEST(RelaySegments, LevelsFollowHowVariedFeaturesAre) {
  std::vector<float> features(10 * kScaffoldFeatures, 0.0f);
  for (size_t a = 0; a < 10; ++a) {
    features[a * kScaffoldFeatures] = static_cast<float>(9 - a);  // the first is the most varied
  }
  EXPECT_THAT(levelsOfFeatures(features, {0.5, 0.8}), ElementsAre(2, 2, 1, 1, 1, 0, 0, 0, 0, 0));
  // All alike: by their order.
  EXPECT_THAT(levelsOfFeatures(features, {0.9, 1.0}), ElementsAre(1, 0, 0, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(levelsOfFeatures(std::vector<float>(64, 0.5f), {0.5, 0.8}), ElementsAre(0, 1));
}

/// Of the held-out camera's image at a frame, dB.
double psnrAt(Fit& fit, uint32_t frame) {
  const auto shown = toyViews(fit.model->splatsAt(0, 0.1 * frame), kCameras, kSize);
  const std::vector<float> seen = shown->load(kCameras - 1).colour;
  const std::vector<float> truth = fit.views->load(frame * kCameras + kCameras - 1).colour;
  double sum = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    const double apart = static_cast<double>(seen[i]) - static_cast<double>(truth[i]);
    sum += apart * apart;
  }
  return -10 * std::log10(sum / static_cast<double>(seen.size()));
}

TEST(RelayModel, LearnsAClipThatAnchorsAtRestCannot) {
  Fit fit(smallOptions(900));
  fit.trainer->run(fit.observer, nullptr);
  ScaffoldModelOptions still = smallOptions(900).anchors;
  TrainerOptions trainer_options;
  trainer_options.iterations = 900;
  trainer_options.seed = 3;
  FitViews split;
  for (size_t v = 0; v < fit.views->count(); ++v) {
    (v % kCameras == kCameras - 1 ? split.held_out : split.training).push_back(v);
  }
  Trainer at_rest(*cpuBackends(), fit.views, split,
                  makeScaffoldModel(*cpuBackends(), *fit.views, split.training, still),
                  trainer_options);
  Quiet observer;
  at_rest.run(observer, nullptr);
  const double moving = fit.trainer->history().by_budget.back().psnr;
  const double resting = at_rest.history().by_budget.back().psnr;
  // 29.0 and 21.1 dB.
  EXPECT_GT(moving, resting + 6);
  // Where one key frame is alone: 29.0 and 27.5 dB.
  EXPECT_GT(psnrAt(fit, 0), moving - 3);
  EXPECT_GT(psnrAt(fit, kFrames - 1), moving - 3);
  // Every part was written once: all of the clip, two key frames, two windows, a pair.
  EXPECT_THAT(fit.store->names, ElementsAre("global", "key0.stage2", "key0.stage3", "key1.stage2",
                                            "key1.stage3", "pair0.stage4"));
  const KeyFrameSource source = relayResult(*fit.model);
  ASSERT_TRUE(source);
  EXPECT_TRUE(source(0)->deformation.isThere());
  EXPECT_NE(source(0)->blend[0], 0.0f) << "blending was learned";
  // Budgets were learned: splats of fewer anchors are larger, and what half of them shows is near
  // to what all show.
  EXPECT_EQ(source(0)->scaffold.coarsening, 0.5);
  const auto& budgets = fit.trainer->history().by_budget;
  ASSERT_EQ(budgets.size(), 3u);
  EXPECT_GT(budgets[1].psnr, moving - 3.5) << "1.6 dB less";
}

TEST(RelayModel, EachStageStartsWhereTheLastEnded) {
  const RelayModelOptions options = smallOptions(400);
  const std::vector<RelaySegment> segments = relaySegments(400, options.clip);
  Fit fit(options);
  uint64_t end_of_keys = 0;
  for (const RelaySegment& one : segments) {
    if (one.stage == RelayStage::kKeyFrame) end_of_keys = one.end;
  }
  fit.runTo(end_of_keys, 400);
  const KeyFrameSource source = relayResult(*fit.model);
  const std::shared_ptr<const KeyFrame> key = source(1);
  EXPECT_FALSE(key->deformation.isThere());
  // As the window begins: a deformation whose heads are zeros.
  KeyFrame begun = *key;
  HexPlaneShape shape;
  begun.deformation = makeDeformation(shape, begun.scaffold.gaussians);
  for (const double tau : {-1.0, -0.3, 0.0, 0.8}) {
    KeyFrameTape tapes[2];
    SplatCloud before, after;
    splatsOfKeyFrame(*key, key->scaffold.size(), tau, tapes[0], before);
    splatsOfKeyFrame(begun, begun.scaffold.size(), tau, tapes[1], after);
    EXPECT_EQ(before.positions, after.positions);
    EXPECT_EQ(before.sh, after.sh);
    EXPECT_EQ(before.opacities, after.opacities);
  }
}

/// The root of the mean squared difference of the features of anchors that both have.
double apart(const ScaffoldParameters& one, const ScaffoldParameters& other) {
  double sum = 0;
  size_t count = 0;
  for (size_t a = 0; a < one.size(); ++a) {
    for (size_t b = 0; b < other.size(); ++b) {
      if (!std::equal(&one.positions[a * 3], &one.positions[a * 3] + 3, &other.positions[b * 3])) {
        continue;
      }
      for (size_t i = 0; i < kScaffoldFeatures; ++i) {
        const double d = static_cast<double>(one.features[a * kScaffoldFeatures + i]) -
                         static_cast<double>(other.features[b * kScaffoldFeatures + i]);
        sum += d * d;
      }
      ++count;
    }
  }
  EXPECT_GT(count, 100u) << "anchors that both have";
  return std::sqrt(sum / static_cast<double>(count));
}

TEST(RelayModel, AKeyFrameBeginsWithWhatTheWindowBeforeHasLearned) {
  const RelayModelOptions options = smallOptions(400);
  Fit fit(options);
  const std::vector<RelaySegment> segments = relaySegments(400, options.clip);
  fit.runTo(segments[3].end, 400);  // the second key frame, 10 steps; a window has 100
  const auto scaffoldOf = [&](const char* part) {
    const ScaffoldShape shape = {options.anchors.gaussians_per_anchor, options.anchors.sh_degree};
    return keyFrameOfTensors(*fit.store->get(part), "", shape).scaffold;
  };
  const ScaffoldParameters global = scaffoldOf("global"), window = scaffoldOf("key0.stage3"),
                           second = scaffoldOf("key1.stage2");
  EXPECT_LT(apart(window, second), 0.5 * apart(global, second));
}

TEST(RelayModel, GoesOnBitForBitFromEveryStage) {
  const RelayModelOptions options = smallOptions(200);
  Fit whole(options);
  whole.trainer->run(whole.observer, nullptr);
  const SplatCloud wanted = whole.model->splatsAt(0, 0.35);
  // Inside the global stage, a key frame, its window, where the next key frame takes over (135),
  // inside that one's window and a pair.
  for (const uint64_t stop : {31, 82, 121, 135, 150, 195}) {
    auto store = std::make_shared<CountingStore>();
    Fit half(options, stop, store);
    half.trainer->run(half.observer, nullptr);
    Fit resumed(options, 0, store);
    resumed.trainer->restore(half.observer.saved);
    ASSERT_EQ(resumed.trainer->iteration(), stop);
    resumed.trainer->run(resumed.observer, nullptr);
    const SplatCloud seen = resumed.model->splatsAt(0, 0.35);
    EXPECT_EQ(seen.positions, wanted.positions) << stop;
    EXPECT_EQ(seen.opacities, wanted.opacities) << stop;
    EXPECT_EQ(seen.sh, wanted.sh) << stop;
  }
}

TEST(RelayModel, RefusesACheckpointOfOtherKeyFrames) {
  RelayModelOptions options = smallOptions(200);
  Fit half(options, 31);
  half.trainer->run(half.observer, nullptr);
  options.clip.first_key = 0;
  Fit elsewhere(options);
  try {
    elsewhere.trainer->restore(half.observer.saved);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kFormat);
    EXPECT_THAT(error.what(), testing::HasSubstr("key frames stand at other frames"));
  }
}

TEST(RelayModel, RefusesACheckpointWhoseKeyFramesAllBeganAlike) {
  const RelayModelOptions options = smallOptions(200);
  Fit half(options, 31);
  half.trainer->run(half.observer, nullptr);
  ASSERT_EQ(half.observer.saved.erase("relay.hands_on"), 1u) << "as before 30 November 2026";
  Fit resumed(options);
  try {
    resumed.trainer->restore(half.observer.saved);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kFormat);
    EXPECT_THAT(error.what(), testing::HasSubstr("began alike"));
  }
}

TEST(RelayModel, SaysWhichKeyFrameIsMissing) {
  const RelayModelOptions options = smallOptions(200);
  Fit half(options, 121);
  half.trainer->run(half.observer, nullptr);
  Fit resumed(options);  // with a store of its own, which is empty
  resumed.trainer->restore(half.observer.saved);
  try {
    resumed.trainer->run(resumed.observer, nullptr);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("is not there"));
  }
  // What was learned until then can still be kept.
  EXPECT_TRUE(resumed.model->state().contains("scaffold.features"));
}

}  // namespace
}  // namespace stipple
