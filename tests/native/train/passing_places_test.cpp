#include "train/anchors/passing_places.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <vector>

#include "decode/anchors/scaffold_decoder.h"
#include "math/colour.h"
#include "train/anchors/relay_model.h"
#include "train/anchors/relay_segments.h"
#include "train/toy_views.h"

namespace stipple {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::Gt;
using testing::IsEmpty;

constexpr uint32_t kFrames = 13;
constexpr size_t kCameras = 6;
constexpr float kAside = 1.0f;
/// Frames that show what comes.
constexpr uint32_t kComes = 8;

/// In: colour: display.
SplatCloud ballOf(size_t count, float radius, float aside, const std::array<float, 3>& colour) {
  SplatCloud ball = toyBall(count, radius);
  for (size_t i = 0; i < ball.size(); ++i) {
    ball.positions[i * 3] += aside;
    for (size_t c = 0; c < 3; ++c) ball.sh[i * 3 + c] = (colour[c] - 0.5f) / kShC0;
  }
  return ball;
}

SplatCloud ballAtRest(size_t count) {
  return ballOf(count, 0.6f, 0, {0.2f, 0.4f, 0.8f});
}

SplatCloud ballThatComes(size_t count) {
  return ballOf(count, 0.2f, kAside, {0.9f, 0.6f, 0.1f});
}

/// With the colours that the splats have.
PointSet pointsOf(const SplatCloud& ball) {
  PointSet points = toyPoints(ball);
  for (size_t i = 0; i < points.colours.size(); ++i) {
    points.colours[i] = srgbToLinear(0.5f + kShC0 * ball.sh[i]);
  }
  return points;
}

void add(std::vector<float>& to, const std::vector<float>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// A ball at rest, and a small one beside it from frame 8 on. Points of the large one were seen at
/// its first frame, those of the small one at frame 9.
std::shared_ptr<MemoryViewSource> aBallThatComes() {
  const SplatCloud rest = ballAtRest(1200);

  SplatCloud both = rest;
  const SplatCloud coming = ballThatComes(500);
  add(both.positions, coming.positions);
  add(both.rotations, coming.rotations);
  add(both.scales, coming.scales);
  add(both.opacities, coming.opacities);
  add(both.sh, coming.sh);

  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (uint32_t frame = 0; frame < kFrames; ++frame) {
    const auto shown = toyViews(frame < kComes ? rest : both, kCameras, 40);
    for (size_t v = 0; v < kCameras; ++v) {
      views->add(shown->camera(v), shown->load(v), std::to_string(v) + "/" + std::to_string(frame),
                 0.1 * frame);
    }
  }
  PointSet points = pointsOf(ballAtRest(300));
  points.times.assign(points.size(), 0.0);
  const PointSet of_coming = pointsOf(ballThatComes(100));
  add(points.positions, of_coming.positions);
  add(points.normals, of_coming.normals);
  add(points.colours, of_coming.colours);
  add(points.opacities, of_coming.opacities);
  add(points.areas, of_coming.areas);
  add(points.weights, of_coming.weights);
  points.times.resize(points.size(), 0.9);
  views->setPoints(points);
  return views;
}

std::vector<size_t> allOf(const ViewSource& views) {
  std::vector<size_t> all(views.count());
  std::iota(all.begin(), all.end(), size_t{0});
  return all;
}

/// Places about the ball that comes.
size_t aboutComing(const std::vector<float>& positions) {
  size_t count = 0;
  for (size_t i = 0; i < positions.size(); i += 3) {
    count += std::hypot(positions[i] - kAside, positions[i + 1], positions[i + 2]) < 0.3f;
  }
  return count;
}

TEST(PassingPlaces, AreThoseOfWhatComes) {
  const auto views = aBallThatComes();
  const PassingPlaces passing = passingPlaces(*views, allOf(*views), 1);
  ASSERT_GT(passing.size(), 50u);
  // A few points of the other ball stand at its border, where pixels are of both.
  EXPECT_GT(aboutComing(passing.positions), passing.size() * 8 / 10);
  EXPECT_EQ(aboutComing(passing.between(0.0, 0.6)), 0u);
  EXPECT_EQ(aboutComing(passing.between(0.9, 0.9)), aboutComing(passing.positions));
  EXPECT_EQ(aboutComing(passing.between(1.2, 5.0)), aboutComing(passing.positions))
      << "it stays until the end";
}

TEST(PassingPlaces, AreNoneWherePointsHaveNoTimes) {
  const auto views = toyViews(toyBall(300), 3, 24);
  EXPECT_EQ(passingPlaces(*views, allOf(*views), 1).size(), 0u);
  EXPECT_THAT(PassingPlaces().between(-1e9, 1e9), IsEmpty());
}

TEST(PassingPlaces, AnchorsThatAreFaintestMakeRoom) {
  ScaffoldShape shape;
  shape.gaussians = 3;
  shape.seed = 5;
  auto scaffold = std::make_shared<ScaffoldParameters>(makeScaffold(shape));
  for (int a = 0; a < 6; ++a) {
    const float place[3] = {static_cast<float>(a), 0, 0};
    std::vector<float> features(kScaffoldFeatures);
    for (size_t i = 0; i < features.size(); ++i) {
      features[i] = std::sin(1.7f * static_cast<float>(a) + 2.3f * static_cast<float>(i));
    }
    addAnchor(*scaffold, place, features.data(), 0.1f);
  }
  // What an anchor's splats come to, from a decoder of that anchor alone.
  std::vector<double> opacities;
  for (uint32_t a = 0; a < 6; ++a) {
    auto one = std::make_shared<ScaffoldParameters>(*scaffold);
    keepAnchors(*one, {a});
    DecodeRequest request;
    request.budget = 1;
    request.gaussians_per_anchor = 3;
    const SplatCloud cloud = ScaffoldDecoder(one).decode(request);
    opacities.push_back(std::accumulate(cloud.opacities.begin(), cloud.opacities.end(), 0.0));
  }
  const std::vector<uint32_t> rows = allButFaintest(*scaffold, 2);
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
  double faintest_kept = HUGE_VAL;
  for (const uint32_t row : rows) faintest_kept = std::min(faintest_kept, opacities[row]);
  std::vector<double> sorted = opacities;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(faintest_kept, sorted[2]);
  EXPECT_THAT(allButFaintest(*scaffold, 0), ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(allButFaintest(*scaffold, 9), IsEmpty());
}

/// What a network of opacities says of features.
std::vector<float> saidOf(const Mlp& opacity, const std::vector<float>& features) {
  MlpTape tape;
  opacity.forward(features, 1, tape);
  return {tape.output().begin(), tape.output().end()};
}

TEST(PassingPlaces, FeaturesOfNewAnchorsShowAllTheirSplats) {
  ScaffoldShape shape;
  shape.seed = 5;
  Mlp opacity = makeScaffold(shape).opacity;
  // As a fit begins features of 0 do.
  EXPECT_THAT(faintFeatures(opacity), Each(0.0f));
  // As it goes on they need not.
  std::vector<float>& biases = opacity.layers().back().biases;
  for (size_t k = 0; k < biases.size(); k += 2) biases[k] = -0.3f - 0.05f * static_cast<float>(k);
  for (float& weight : opacity.layers().back().weights) weight *= 20;
  const std::vector<float> zeros(kScaffoldFeatures, 0.0f);
  std::vector<float> said = saidOf(opacity, zeros);
  ASSERT_LT(*std::min_element(said.begin(), said.end()), -0.2f);
  said = saidOf(opacity, faintFeatures(opacity));
  EXPECT_GT(*std::min_element(said.begin(), said.end()), 0.09f);
  // A network that hears nothing of features stays as it is, and so do they.
  for (float& weight : opacity.layers().back().weights) weight = 0;
  EXPECT_THAT(faintFeatures(opacity), Each(0.0f));
}

TEST(PassingPlaces, KeyFramesBeginWithAnchorsThere) {
  const auto views = aBallThatComes();
  RelayModelOptions options;
  options.anchors.most_anchors = 150;  // the global ones take all of them
  options.anchors.gaussians_per_anchor = 4;
  options.anchors.seed = 1;
  options.clip.frames_per_second = 10;
  options.clip.frame_count = kFrames;
  options.clip.spacing = 3;  // key frames 0, 3, 6 and 9
  options.iterations = 40;
  const std::vector<size_t> training = allOf(*views);
  const auto store = std::make_shared<MemoryKeyFrames>();
  const auto model = makeRelayModel(*cpuBackends(), *views, training, options, store);
  const std::vector<RelaySegment> segments = relaySegments(options.iterations, options.clip);
  ASSERT_EQ(segments[7].stage, RelayStage::kKeyFrame);
  ASSERT_EQ(segments[7].key, 3u);
  for (uint64_t i = 0; i < segments[7].end; ++i) {
    FitMoment moment;
    moment.iteration = i + 1;
    moment.iterations = options.iterations;
    moment.extent = 1;
    const size_t v = *model->viewAt(i);
    StepView view;
    view.camera = &views->camera(v);
    view.time = views->time(v);
    const ViewPicture picture = views->load(v);
    view.target = picture.colour.data();
    model->step(moment, view, nullptr, nullptr);
  }
  const KeyFrameSource source = relayResult(*model);
  std::vector<size_t> there, all;
  for (uint32_t key = 0; key < 4; ++key) {
    there.push_back(aboutComing(source(key)->scaffold.positions));
    all.push_back(source(key)->scaffold.size());
  }
  EXPECT_GT(there[3], there[0] + 20);
  EXPECT_EQ(there[1], there[0]);
  EXPECT_THAT(all, Each(testing::Le(options.anchors.most_anchors)));
  EXPECT_THAT(all, Each(Gt(0u)));
}

}  // namespace
}  // namespace stipple
