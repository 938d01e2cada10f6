#include "decode/anchors/key_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"

namespace stipple {
namespace {

using testing::ElementsAre;

float drawn(uint64_t number) {
  return unitFloat(keyedBits(33, RandomUse::kFieldStart, number));
}

KeyFrameClip clipOf(uint32_t frames, uint32_t spacing) {
  KeyFrameClip clip;
  clip.begin = 2;
  clip.frames_per_second = 10;
  clip.frame_count = frames;
  clip.spacing = spacing;
  return clip;
}

/// `count` anchors that differ by the seed.
KeyFrame someFrame(size_t count, uint64_t seed, bool deforms) {
  KeyFrame frame;
  frame.scaffold = makeScaffold({.gaussians = 3, .seed = seed});
  for (size_t a = 0; a < count; ++a) {
    const float place[] = {drawn(seed * 100 + 3 * a), drawn(seed * 100 + 3 * a + 1),
                           drawn(seed * 100 + 3 * a + 2)};
    addAnchor(frame.scaffold, place, nullptr, 0.3f);
    frame.blend.insert(frame.blend.end(), {0, kStartingDecay, 0, kStartingDecay});
  }
  for (size_t i = 0; i < frame.scaffold.features.size(); ++i) {
    frame.scaffold.features[i] = drawn(seed * 1000 + i) - 0.5f;
  }
  if (deforms) {
    HexPlaneShape shape;
    shape.texels = 4;
    shape.moments = 4;
    shape.channels = 2;
    shape.seed = seed;
    frame.deformation = makeDeformation(shape, 3);
    for (float& weight : frame.deformation.heads.layers().back().weights) weight = 0.05f;
  }
  return frame;
}

TEST(KeyFrameClip, HasAKeyFrameAtItsBeginAndEverySpacing) {
  EXPECT_EQ(clipOf(1, 5).keyCount(), 1u);
  EXPECT_EQ(clipOf(5, 5).keyCount(), 1u) << "shorter than one spacing";
  EXPECT_EQ(clipOf(6, 5).keyCount(), 1u) << "in its middle";
  EXPECT_EQ(clipOf(7, 5).keyCount(), 2u) << "a ragged last window";
  EXPECT_EQ(clipOf(480, 24).keyCount(), 20u);
  EXPECT_DOUBLE_EQ(clipOf(480, 24).timeOf(3), 2 + 7.2);
}

TEST(KeyFrameClip, HasAsManyFramesBeforeItsKeyFramesAsBehind) {
  for (const auto& [frames, spacing, first] : std::initializer_list<std::array<uint32_t, 3>>{
           {1, 5, 0}, {2, 5, 0}, {5, 5, 2}, {6, 5, 2}, {7, 5, 0}, {25, 8, 4}, {480, 24, 11}}) {
    KeyFrameClip clip = clipOf(frames, spacing);
    clip.first_key = firstKeyOf(clip);
    EXPECT_EQ(clip.first_key, first) << frames;
    EXPECT_NO_THROW(validate(clip)) << frames;
    // None goes on alone for more than half of the spacing.
    const double behind = (clip.end() - clip.timeOf(clip.keyCount() - 1)) * 10;
    EXPECT_LE(first, spacing / 2.0) << frames;
    EXPECT_LE(behind, (spacing + 1) / 2.0 + 1e-9) << frames;
    clip.first_key = frames - (clip.keyCount() - 1) * spacing;
    EXPECT_THROW(validate(clip), Error) << "the last is not in the clip of " << frames;
  }
}

TEST(KeyFrameClip, OfOneThatStandsInItIsAloneOnBothSides) {
  KeyFrameClip clip = clipOf(25, 8);
  clip.first_key = firstKeyOf(clip);  // at frames 4, 12, 20
  const auto at = [&](int frame) { return keyFramesAt(clip, 2 + 0.1 * frame); };
  EXPECT_EQ(at(0).key, 0u);
  EXPECT_FALSE(at(0).has_next);
  EXPECT_NEAR(at(0).tau, -0.5, 1e-12);
  EXPECT_TRUE(at(5).has_next);
  EXPECT_NEAR(at(5).tau, 0.125, 1e-12);
  EXPECT_EQ(at(13).key, 1u);
  EXPECT_EQ(at(24).key, 2u);
  EXPECT_FALSE(at(24).has_next);
  EXPECT_NEAR(at(24).tau, 0.5, 1e-12);
}

TEST(KeyFrameClip, SaysWhichKeyFramesShowATime) {
  const KeyFrameClip clip = clipOf(23, 10);  // at frames 0, 10, 20
  const auto at = [&](double seconds) { return keyFramesAt(clip, seconds); };
  EXPECT_EQ(at(-5).key, 0u);
  EXPECT_EQ(at(-5).tau, 0);
  EXPECT_EQ(at(2.4).key, 0u);
  EXPECT_NEAR(at(2.4).tau, 0.4, 1e-12);
  EXPECT_TRUE(at(2.4).has_next);
  EXPECT_EQ(at(3.0).key, 1u);
  EXPECT_NEAR(at(3.0).tau, 0, 1e-12);
  EXPECT_EQ(at(4.15).key, 2u);
  EXPECT_FALSE(at(4.15).has_next);
  EXPECT_NEAR(at(100).tau, 0.2, 1e-12) << "held to the last frame";
}

TEST(KeyFrameBlending, FadesAsPublished) {
  // lambda d = 1 of the published table: d is a quarter of our lambda of 4.
  KeyFrame frame = someFrame(1, 1, false);
  const float raw = std::log(std::exp(0.25f) - 1);
  frame.blend = {0, raw, 0, raw};
  const double forward[] = {1, 0.7788, 0.6065, 0.4724, 0.3679};
  const double shares[] = {0.7311, 0.6225, 0.5, 0.3775, 0.2689};
  for (int i = 0; i < 5; ++i) {
    const double tau = 0.25 * i;
    const std::vector<float> own = fadingOf(frame, 1, tau), other = fadingOf(frame, 1, tau - 1);
    EXPECT_NEAR(own[0], forward[i], 5e-5) << tau;
    EXPECT_NEAR(other[0], forward[4 - i], 5e-5) << tau;
    EXPECT_NEAR(sharesOf(own, other)[0], shares[i], 5e-5) << tau;
  }
}

void compareWithDifferences(KeyFrameBlend blending, double tau) {
  KeyFrame before = someFrame(7, 1, false), behind = someFrame(5, 2, false);
  for (KeyFrame* frame : {&before, &behind}) {
    for (size_t i = 0; i < frame->blend.size(); ++i) frame->blend[i] += drawn(i + 50) - 0.5f;
  }
  const auto loss = [&] {
    const std::vector<float> w = fadingOf(before, 7, tau, blending),
                             v = fadingOf(behind, 5, tau - 1, blending);
    double sum = 0;
    uint64_t number = 900;
    for (const auto& shares : {sharesOf(w, v), sharesOf(v, w)}) {
      for (const float share : shares) {
        sum += static_cast<double>(share) * (static_cast<double>(drawn(number++)) - 0.5);
      }
    }
    return sum;
  };
  const std::vector<float> w = fadingOf(before, 7, tau, blending),
                           v = fadingOf(behind, 5, tau - 1, blending);
  std::vector<float> by_before_shares, by_behind_shares;
  uint64_t number = 900;
  for (size_t a = 0; a < 7; ++a) by_before_shares.push_back(drawn(number++) - 0.5f);
  for (size_t a = 0; a < 5; ++a) by_behind_shares.push_back(drawn(number++) - 0.5f);
  std::vector<float> by_w(7, 0.0f), by_v(5, 0.0f);
  sharesBackward(w, v, by_before_shares, by_w, by_v);
  sharesBackward(v, w, by_behind_shares, by_v, by_w);
  std::vector<float> by_before(before.blend.size(), 0.0f), by_behind(behind.blend.size(), 0.0f);
  fadingBackward(before, tau, by_w, by_before, blending);
  fadingBackward(behind, tau - 1, by_v, by_behind, blending);
  const auto compare = [&](std::vector<float>& blend, const std::vector<float>& by) {
    for (size_t i = 0; i < blend.size(); ++i) {
      const float eps = 0x1.0p-7f;
      const float kept = blend[i];
      blend[i] = kept + eps;
      const double high = loss();
      blend[i] = kept - eps;
      const double low = loss();
      blend[i] = kept;
      // A dozen float32 shares: rounding of 1e-7 / eps, and truncation.
      EXPECT_NEAR(static_cast<double>(by[i]), (high - low) / (2 * static_cast<double>(eps)), 2e-4)
          << i;
    }
  };
  compare(before.blend, by_before);
  compare(behind.blend, by_behind);
}

TEST(KeyFrameBlending, GradientsAreThoseOfDifferences) {
  compareWithDifferences(KeyFrameBlend::kLearned, 0.35);
}

TEST(KeyFrameBlending, GradientsOfPlateausAreThoseOfDifferences) {
  // No plateau of these anchors ends within a step of the difference.
  compareWithDifferences(KeyFrameBlend::kPlateau, 0.4);
}

TEST(KeyFrameBlending, APlateauIsWholeUntilItsOffset) {
  KeyFrame frame = someFrame(1, 1, false);
  const float raw = std::log(std::exp(0.25f) - 1);  // lambda d = 1
  frame.blend = {0.4f, raw, -0.2f, raw};
  const auto at = [&](double tau) { return fadingOf(frame, 1, tau, KeyFrameBlend::kPlateau)[0]; };
  EXPECT_EQ(at(0), 1.0f);
  EXPECT_EQ(at(0.4), 1.0f);
  EXPECT_NEAR(at(0.9), std::exp(-0.5), 1e-6);
  EXPECT_EQ(at(-0.2), 1.0f);
  EXPECT_NEAR(at(-1), std::exp(-0.8), 1e-6);
  // As all begin, with an offset of 0, it is the formula, and the offset learns.
  frame.blend = {0, raw, 0, raw};
  EXPECT_EQ(at(0.7), fadingOf(frame, 1, 0.7)[0]);
  std::vector<float> by_blend(4, 0.0f);
  fadingBackward(frame, 0.7, {1.0f}, by_blend, KeyFrameBlend::kPlateau);
  EXPECT_GT(by_blend[0], 0.0f);
}

TEST(KeyFrameBlending, StaysFiniteWhereBothHaveFadedAway) {
  KeyFrame frame = someFrame(2, 1, false);
  for (float& number : frame.blend) number = 200;  // offset far away, decay of 200
  const std::vector<float> own = fadingOf(frame, 2, 0.5), other = fadingOf(frame, 2, -0.5);
  EXPECT_THAT(own, ElementsAre(0.0f, 0.0f));
  EXPECT_THAT(sharesOf(own, other), ElementsAre(0.5f, 0.5f));
  std::vector<float> by_own(2, 0.0f), by_other(2, 0.0f), by_blend(8, 0.0f);
  sharesBackward(own, other, {1, 1}, by_own, by_other);
  fadingBackward(frame, 0.5, by_own, by_blend);
  for (const float value : by_blend) EXPECT_TRUE(std::isfinite(value));
}

TEST(SplatsOfClip, AreTheUnionOfTwoKeyFramesAtTheirShares) {
  const KeyFrameClip clip = clipOf(21, 10);
  const std::vector<std::shared_ptr<const KeyFrame>> frames = {
      std::make_shared<const KeyFrame>(someFrame(6, 1, true)),
      std::make_shared<const KeyFrame>(someFrame(4, 2, true))};
  const KeyFrameSource source = [&](uint32_t key) { return frames[key]; };
  KeyFrameTape tapes[2];
  SplatCloud own[2];
  splatsOfKeyFrame(*frames[0], 6, 0.3, tapes[0], own[0]);
  splatsOfKeyFrame(*frames[1], 4, -0.7, tapes[1], own[1]);
  const SplatCloud cloud = splatsOfClip(clip, source, 2.3, 0);
  ASSERT_EQ(cloud.size(), own[0].size() + own[1].size());
  const double w = std::exp(-4 * 0.3), v = std::exp(-4 * 0.7);
  EXPECT_NEAR(cloud.opacities[0], own[0].opacities[0] * static_cast<float>(w / (w + v)), 1e-5);
  EXPECT_NEAR(cloud.opacities[own[0].size()], own[1].opacities[0] * static_cast<float>(v / (w + v)),
              1e-5);
  EXPECT_EQ(cloud.positions[0], own[0].positions[0]);
  // A budget is shared evenly, and anchors come from the front.
  const SplatCloud few = splatsOfClip(clip, source, 2.3, 4);
  EXPECT_LE(few.size(), 4u * 3);
  EXPECT_EQ(few.positions[0], own[0].positions[0]);
  EXPECT_EQ(mostAnchors(clip, std::vector<uint64_t>{6, 4}), 12u);
}

TEST(SplatsOfClip, ShowOneKeyFrameWhereNothingBlends) {
  KeyFrameClip clip = clipOf(21, 10);
  const std::vector<std::shared_ptr<const KeyFrame>> frames = {
      std::make_shared<const KeyFrame>(someFrame(6, 1, false)),
      std::make_shared<const KeyFrame>(someFrame(4, 2, false))};
  const KeyFrameSource source = [&](uint32_t key) { return frames[key]; };
  KeyFrameTape tape;
  SplatCloud first, second;
  splatsOfKeyFrame(*frames[0], 6, 0, tape, first);
  splatsOfKeyFrame(*frames[1], 4, 0, tape, second);
  EXPECT_EQ(splatsOfClip(clip, source, 3.5, 0).opacities, second.opacities)
      << "behind the last key frame there is nothing to blend with";
  clip.blend = KeyFrameBlend::kNone;
  EXPECT_EQ(splatsOfClip(clip, source, 2.4, 0).opacities, first.opacities);
  EXPECT_EQ(splatsOfClip(clip, source, 2.6, 0).opacities, second.opacities);
  clip.blend = KeyFrameBlend::kLinear;
  EXPECT_NEAR(splatsOfClip(clip, source, 2.25, 0).opacities[0], 0.75f * first.opacities[0], 1e-6);
}

TEST(KeyFrame, ItsNetworkDoesNotMoveAllAnchorsAlike) {
  // Weights of the last layer, as a step of Adam leaves them; planes as they begin on the mean.
  KeyFrame frame = someFrame(20, 5, true);
  const auto farthest = [&] {
    DeformationTape tape;
    AnchorArrays deformed;
    deform(frame.deformation, frame.scaffold, 20, 0.4, tape, deformed);
    float most = 0;
    for (size_t i = 0; i < deformed.positions.size(); ++i) {
      most = std::max(most, std::abs(deformed.positions[i] - frame.scaffold.positions[i]));
    }
    return most;
  };
  EXPECT_GT(farthest(), 1e-3f) << "by how their places differ";
  for (HexPlane& plane : frame.deformation.planes.planes()) {
    std::fill(plane.values.begin(), plane.values.end(), 1.0f);
  }
  EXPECT_LT(farthest(), 1e-5f);
}

/// Of five anchors, away from the key frame's own moment.
void expectSameSplats(const KeyFrame& frame, const KeyFrame& seen) {
  KeyFrameTape tapes[2];
  SplatCloud one, other;
  splatsOfKeyFrame(frame, 5, -0.6, tapes[0], one);
  splatsOfKeyFrame(seen, 5, -0.6, tapes[1], other);
  EXPECT_EQ(one.positions, other.positions);
  EXPECT_EQ(one.sh, other.sh);
  EXPECT_EQ(one.scales, other.scales);
}

TEST(KeyFrame, ComesBackFromTensorsBitForBit) {
  for (const bool deforms : {false, true}) {
    const KeyFrame frame = someFrame(5, 4, deforms);
    const TensorTable table = tensorsOfKeyFrame(frame, "key.7.");
    const ScaffoldShape shape = {3, 0, frame.scaffold.colour_space, frame.scaffold.antialias, 0};
    const KeyFrame seen = keyFrameOfTensors(table, "key.7.", shape);
    EXPECT_EQ(seen.blend, frame.blend);
    EXPECT_EQ(seen.deformation.isThere(), deforms);
    expectSameSplats(frame, seen);
  }
}

TEST(KeyFrame, DecodesFilesFromBeforeChangesGrewWithTheTime) {
  KeyFrame frame = someFrame(5, 4, true);
  TensorTable table = tensorsOfKeyFrame(frame, "");
  auto& box = std::get<std::vector<double>>(table.at("box").values);
  ASSERT_EQ(box.size(), 8u);
  box.pop_back();
  table.at("box").shape = {7};
  const ScaffoldShape shape = {3, 0, frame.scaffold.colour_space, frame.scaffold.antialias, 0};
  const KeyFrame seen = keyFrameOfTensors(table, "", shape);
  EXPECT_FALSE(seen.deformation.grows_from_key);
  frame.deformation.grows_from_key = false;
  expectSameSplats(frame, seen);
}

TEST(KeyFrame, RefusesTensorsThatDoNotFitTogether) {
  const KeyFrame frame = someFrame(5, 4, true);
  const ScaffoldShape shape = {3, 0, frame.scaffold.colour_space, frame.scaffold.antialias, 0};
  const auto refuses = [&](const std::string& name, const Tensor& tensor) {
    TensorTable table = tensorsOfKeyFrame(frame, "");
    table[name] = tensor;
    try {
      keyFrameOfTensors(table, "", shape);
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kFormat) << name;
    }
  };
  refuses("blend", {{3}, std::vector<float>(3)});
  refuses("planes", {{2}, std::vector<uint32_t>{4, 4}});
  refuses("planes", {{5}, std::vector<uint32_t>{4, 4, 2, 1, 4000000}});
  refuses("planes.0", {{1}, std::vector<float>(1)});
  refuses("box", {{7}, std::vector<double>{0, 0, 0, 0, 1, 1, 1}});
  refuses("box", {{6}, std::vector<double>{0, 0, 0, 1, 1, 1}});
  refuses("box", {{8}, std::vector<double>{0, 0, 0, 1, 1, 1, 0, 1}});
  refuses("box", {{9}, std::vector<double>{0, 0, 0, 1, 1, 1, 1, 1, 1}});
  refuses("heads.layer2.biases", {{1}, std::vector<float>{NAN}});
}

}  // namespace
}  // namespace stipple
