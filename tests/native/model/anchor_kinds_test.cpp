// The kinds of anchors with features: what is read is what was written, at any budget and time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "base/random.h"
#include "io/scratch_folder.h"
#include "model/model_kinds.h"
#include "model/relay_splats.h"
#include "model/scaffold_splats.h"

namespace stipple {
namespace {

class AnchorKinds : public ScratchFolder {};

ScaffoldParameters someAnchors(size_t count, uint64_t seed) {
  ScaffoldParameters scaffold = makeScaffold({.gaussians = 3, .sh_degree = 1, .seed = seed});
  const auto drawn = [seed](uint64_t number) {
    return unitFloat(keyedBits(seed, RandomUse::kFieldStart, number));
  };
  for (size_t a = 0; a < count; ++a) {
    const float place[] = {drawn(3 * a), drawn(3 * a + 1), 5 * drawn(3 * a + 2)};
    addAnchor(scaffold, place, nullptr, 0.2f);
  }
  for (size_t i = 0; i < scaffold.features.size(); ++i) scaffold.features[i] = drawn(1000 + i);
  return scaffold;
}

std::shared_ptr<const KeyFrame> someFrame(size_t count, uint64_t seed, double coarsening = 0) {
  KeyFrame frame;
  frame.scaffold = someAnchors(count, seed);
  frame.scaffold.coarsening = coarsening;
  HexPlaneShape shape;
  shape.texels = 4;
  shape.moments = 3;
  shape.channels = 2;
  frame.deformation = makeDeformation(shape, 3);
  for (float& weight : frame.deformation.heads.layers().back().weights) weight = 0.02f;
  for (size_t a = 0; a < count; ++a) {
    frame.blend.insert(frame.blend.end(), {0.1f, 0.5f, -0.1f, 0.7f});
  }
  return std::make_shared<const KeyFrame>(std::move(frame));
}

KeyFrameSource sourceOf(std::vector<std::shared_ptr<const KeyFrame>> frames) {
  return [frames = std::move(frames)](uint32_t key) {
    return key < frames.size() ? frames[key] : nullptr;
  };
}

void expectSameSplats(const SplatCloud& one, const SplatCloud& other) {
  EXPECT_GT(one.size(), 0u);
  EXPECT_EQ(one.positions, other.positions);
  EXPECT_EQ(one.scales, other.scales);
  EXPECT_EQ(one.opacities, other.opacities);
  EXPECT_EQ(one.sh, other.sh);
}

TEST_F(AnchorKinds, AScaffoldComesBackAtAnyBudget) {
  const auto model = makeScaffoldSplats(
      std::make_shared<const ScaffoldParameters>(someAnchors(50, 1)), {"{\"seed\": 3}", {}});
  model->save(path("a.stipple.safetensors"));
  const auto seen = loadModel(path("a.stipple.safetensors"), {});
  EXPECT_STREQ(seen->kind(), "scaffold");
  const ModelSettings settings = seen->settings();
  EXPECT_EQ(settings.maximum_budget, 50u);
  EXPECT_EQ(settings.default_gaussians_per_anchor, 3u);
  EXPECT_FALSE(settings.time.has_value());
  EXPECT_EQ(seen->info().leaf_count, 50u);
  for (const uint64_t budget : {1, 17, 50}) {
    ModelRequest request;
    request.budget = budget;
    expectSameSplats(model->decode(request), seen->decode(request));
  }
  ModelRequest request;
  request.budget = 51;
  expectError(ErrorCode::kInvalidArgument, {"1 to 50"}, [&] { seen->decode(request); });
}

TEST_F(AnchorKinds, ALongClipComesBackAtAnyTime) {
  KeyFrameClip clip;
  clip.begin = 1;
  clip.frames_per_second = 10;
  clip.frame_count = 26;
  clip.spacing = 8;
  clip.first_key = 1;
  // Four key frames; more than are kept at hand of a file.
  const KeyFrameSource frames =
      sourceOf({someFrame(20, 1), someFrame(30, 2), someFrame(25, 3, 0.5), someFrame(10, 4)});
  const auto model = makeRelaySplats(clip, frames);
  model->save(path("a.stipple.safetensors"));
  const auto seen = loadModel(path("a.stipple.safetensors"), {});
  EXPECT_STREQ(seen->kind(), "relay");
  EXPECT_EQ(seen->info().leaf_count, 85u);
  const ModelSettings settings = seen->settings();
  EXPECT_EQ(settings.maximum_budget, 60u);
  ASSERT_TRUE(settings.time.has_value());
  EXPECT_DOUBLE_EQ(settings.time->begin, 1);
  EXPECT_DOUBLE_EQ(settings.time->end, 3.5);
  EXPECT_FLOAT_EQ(seen->info().bounds_min[2], model->info().bounds_min[2]);
  for (const double time : {0.0, 1.0, 1.05, 1.37, 3.2, 1.2, 99.0}) {
    for (const uint64_t budget : {3, 60}) {
      ModelRequest request;
      request.budget = budget;
      request.time = time;
      expectSameSplats(model->decode(request), seen->decode(request));
    }
  }
  // Written once more from the file.
  seen->save(path("b.stipple.safetensors"));
  ModelRequest request;
  request.budget = 60;
  request.time = 2.2;
  expectSameSplats(loadModel(path("b.stipple.safetensors"), {})->decode(request),
                   model->decode(request));
}

TEST_F(AnchorKinds, ALongClipKeepsFewKeyFramesInMemory) {
  KeyFrameClip clip;
  clip.frame_count = 97;
  clip.spacing = 8;
  // Twelve key frames, of which it is known how many anybody has at once.
  std::vector<std::weak_ptr<const KeyFrame>> made;
  size_t most = 0;
  const KeyFrameSource frames = [&](uint32_t key) {
    const auto frame = someFrame(20, key);
    made.push_back(frame);
    size_t held = 0;
    for (const auto& one : made) held += one.expired() ? 0 : 1;
    most = std::max(most, held);
    return frame;
  };
  const auto model = makeRelaySplats(clip, frames);
  model->save(path("a.stipple.safetensors"));
  for (double time = 0; time <= 96; time += 3) {
    ModelRequest request;
    request.budget = 40;
    request.time = time;
    model->decode(request);
  }
  EXPECT_GT(made.size(), 24u) << "key frames are made anew";
  // The three that are kept and the one that takes a place among them.
  EXPECT_LE(most, 4u);
  EXPECT_EQ(loadModel(path("a.stipple.safetensors"), {})->info().leaf_count, 240u);
}

TEST_F(AnchorKinds, SplatsOfFewerAnchorsOfAKeyFrameAreLarger) {
  KeyFrameClip clip;
  clip.frame_count = 8;
  clip.spacing = 8;
  ModelRequest request;
  request.budget = 5;
  const SplatCloud as_they_are =
      makeRelaySplats(clip, sourceOf({someFrame(20, 1)}))->decode(request);
  const SplatCloud larger =
      makeRelaySplats(clip, sourceOf({someFrame(20, 1, 0.5)}))->decode(request);
  ASSERT_EQ(larger.size(), as_they_are.size());
  for (size_t i = 0; i < larger.scales.size(); ++i) {
    EXPECT_FLOAT_EQ(larger.scales[i], 2 * as_they_are.scales[i]);  // (20 / 5)^0.5
  }
}

TEST_F(AnchorKinds, RefuseWhatDoesNotFitTogether) {
  KeyFrameClip clip;
  clip.frame_count = 26;
  clip.spacing = 8;
  expectError(ErrorCode::kInvalidArgument, {"1 key frames", "needs 4"},
              [&] { makeRelaySplats(clip, sourceOf({someFrame(20, 1)})); });
  clip.first_key = 2;
  expectError(ErrorCode::kInvalidArgument, {"from frame 2 on"},
              [&] { makeRelaySplats(clip, sourceOf({someFrame(20, 1)})); });
  clip.first_key = 0;
  clip.spacing = 100;
  expectError(ErrorCode::kInvalidArgument, {"0 anchors"},
              [&] { makeRelaySplats(clip, sourceOf({someFrame(0, 1)})); });
  expectError(ErrorCode::kInvalidArgument, {"0 anchors"}, [&] {
    makeScaffoldSplats(std::make_shared<const ScaffoldParameters>(someAnchors(0, 1)));
  });
}

}  // namespace
}  // namespace stipple
