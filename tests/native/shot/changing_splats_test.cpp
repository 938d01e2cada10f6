#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "base/parallel.h"
#include "math/low_discrepancy.h"
#include "shot/cloud_cuts.h"
#include "shot/sampled_render.h"
#include "splat/random_scene.h"

// Motion blur of splats that change while the shutter is open: against an average by hand of
// pictures at the exact moments, and against the same motion by matrices.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::instanceOf;
using testing::oneSplat;
using testing::randomCloud;

using Share = std::shared_ptr<const SplatCloud>;

constexpr uint32_t kSamples = 16;

Camera view() {
  return frontCamera(48, 40, 50, 4);
}

RenderOptions everyPass() {
  RenderOptions options = testing::everyBuffer(LowPass::kClassic);
  options.with_normal = options.with_objects = true;
  return options;
}

SplatCloud randomSplats(uint32_t seed, size_t count = 200) {
  CloudRecipe recipe;
  recipe.count = count;
  recipe.degree = 1;
  return randomCloud(recipe, seed);
}

/// The cloud with other places, shapes, opacities and colours, in the same rows.
Share changed(const SplatCloud& cloud, float by, uint32_t seed) {
  const SplatCloud other = randomSplats(seed, cloud.size());
  SplatCloud made = cloud;
  const auto mix = [by](std::vector<float>& values, const std::vector<float>& others) {
    for (size_t i = 0; i < values.size(); ++i) values[i] += by * (others[i] - values[i]);
  };
  mix(made.positions, other.positions);
  mix(made.rotations, other.rotations);
  mix(made.scales, other.scales);
  mix(made.opacities, other.opacities);
  mix(made.sh, other.sh);
  return std::make_shared<const SplatCloud>(std::move(made));
}

/// What lies between two clouds, by formulas of its own, in double until the end.
SplatCloud between(const SplatCloud& a, const SplatCloud& b, double share) {
  SplatCloud made = a;
  const auto mix = [share](std::vector<float>& values, const std::vector<float>& others) {
    for (size_t i = 0; i < values.size(); ++i) {
      const double from = static_cast<double>(values[i]), to = static_cast<double>(others[i]);
      values[i] = static_cast<float>(from + share * (to - from));
    }
  };
  mix(made.positions, b.positions);
  mix(made.scales, b.scales);
  mix(made.opacities, b.opacities);
  mix(made.sh, b.sh);
  for (size_t i = 0; i < a.size(); ++i) {
    Eigen::Map<const Eigen::Vector4f> first(&a.rotations[4 * i]), second(&b.rotations[4 * i]);
    const Vec4d from = first.cast<double>().normalized();
    Vec4d to = second.cast<double>().normalized();
    if (from.dot(to) < 0) to = -to;
    Eigen::Map<Eigen::Vector4f>(&made.rotations[4 * i]) =
        Vec4d((1 - share) * from + share * to).normalized().cast<float>();
  }
  return made;
}

SplatCloud atTime(const std::vector<Share>& steps, double time) {
  const double place = time * static_cast<double>(steps.size() - 1);
  const size_t step = std::min(static_cast<size_t>(place), steps.size() - 2);
  return between(*steps[step], *steps[step + 1], place - static_cast<double>(step));
}

Sampling opened(uint32_t step_count, uint32_t samples = kSamples) {
  Sampling sampling;
  sampling.shutter.step_count = step_count;
  sampling.samples = samples;
  return sampling;
}

void drawTiled(std::span<const SplatInstance> instances, const Camera& camera,
               const RenderOptions& options, RenderResult& result, Progress* progress) {
  result = renderTiled(instances, camera, options, progress);
}

RenderResult sampled(std::span<const SplatInstance> instances, const Sampling& sampling,
                     const RenderOptions& options = everyPass(),
                     const DrawMoment& draw = drawTiled) {
  RenderResult result;
  renderSampled(instances, view(), options, sampling, draw, result);
  return result;
}

void expectSamePicture(const RenderResult& a, const RenderResult& b) {
  EXPECT_EQ(a.colour, b.colour);
  EXPECT_EQ(a.transmittance, b.transmittance);
  EXPECT_EQ(a.depth, b.depth);
  EXPECT_EQ(a.median_depth, b.median_depth);
  EXPECT_EQ(a.counts, b.counts);
  EXPECT_EQ(a.normal, b.normal);
  EXPECT_EQ(a.objects, b.objects);
}

double worst(const std::vector<float>& a, const std::vector<double>& b) {
  double largest = 0;
  for (size_t i = 0; i < b.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(a[i]) - b[i]));
  }
  return largest;
}

TEST(ChangingSplats, ArePicturesOfTheExactMomentsAveragedByHand) {
  // One cloud changes in three steps; beside it one moves by its matrices, and one stands still.
  const SplatCloud first = randomSplats(1), mover = randomSplats(2), still = randomSplats(3);
  const std::vector<Share> steps = {changed(first, 0.2f, 7), changed(first, 0.5f, 8),
                                    changed(first, 0.3f, 9)};
  std::vector<SplatInstance> instances = {instanceOf(first), instanceOf(mover), instanceOf(still)};
  instances[0].object_to_world(2, 3) = 0.25;
  Sampling sampling = opened(3);
  for (size_t s = 0; s < 3; ++s) {
    Mat4d shifted = Mat4d::Identity();
    shifted(0, 3) = 0.2 * static_cast<double>(s);
    for (const Mat4d& matrix : {instances[0].object_to_world, shifted, Mat4d(Mat4d::Identity())}) {
      sampling.shutter.instances.push_back(matrix);
    }
    for (const Share& cloud : {steps[s], Share(), Share()})
      sampling.shutter.clouds.push_back(cloud);
  }
  size_t pictures = 0;
  const RenderResult picture =
      sampled(instances, sampling, everyPass(),
              [&](std::span<const SplatInstance> drawn, const Camera& camera,
                  const RenderOptions& options, RenderResult& result, Progress* progress) {
                EXPECT_NE(drawn[0].cloud, &first);
                EXPECT_EQ(drawn[1].cloud, &mover);
                EXPECT_EQ(drawn[2].cloud, &still);
                ++pictures;
                drawTiled(drawn, camera, options, result, progress);
              });
  EXPECT_EQ(pictures, kSamples + 1u);

  const auto sceneAt = [&](double time, const SplatCloud& cloud) {
    std::vector<SplatInstance> scene = instances;
    scene[0].cloud = &cloud;
    scene[1].object_to_world(0, 3) = 0.4 * time;
    return scene;
  };
  std::vector<double> colour(picture.colour.size()), transmittance(picture.transmittance.size());
  for (uint32_t i = 0; i < kSamples; ++i) {
    const double time = scrambledSobol(i, 0);
    Camera camera = view();
    camera.cx -= scrambledSobol(i, 1) - 0.5;
    camera.cy -= scrambledSobol(i, 2) - 0.5;
    const SplatCloud cloud = atTime(steps, time);
    const RenderResult one = renderTiled(sceneAt(time, cloud), camera, everyPass());
    for (size_t k = 0; k < colour.size(); ++k) {
      colour[k] += static_cast<double>(one.colour[k]) / kSamples;
    }
    for (size_t k = 0; k < transmittance.size(); ++k) {
      transmittance[k] += static_cast<double>(one.transmittance[k]) / kSamples;
    }
  }
  // Float32 roundings of the clouds differ; a splat at the rim of 1/255 may be in one picture and
  // not in the other, 1/255 / 16.
  EXPECT_LT(worst(picture.colour, colour), 3e-4);
  EXPECT_LT(worst(picture.transmittance, transmittance), 3e-4);
  double mean = 0;
  for (size_t k = 0; k < colour.size(); ++k) {
    mean += std::abs(static_cast<double>(picture.colour[k]) - colour[k]);
  }
  EXPECT_LT(mean / static_cast<double>(colour.size()), 1e-6);
  // The middle is the second step, whose cloud is drawn as it is.
  const RenderResult middle = renderTiled(sceneAt(0.5, *steps[1]), view(), everyPass());
  EXPECT_EQ(picture.depth, middle.depth);
  EXPECT_EQ(picture.median_depth, middle.median_depth);
  EXPECT_EQ(picture.counts, middle.counts);
  EXPECT_EQ(picture.normal, middle.normal);
  EXPECT_EQ(picture.objects, middle.objects);
  // And one sample is the middle of all.
  sampling.samples = 1;
  expectSamePicture(sampled(instances, sampling), middle);
}

TEST(ChangingSplats, AStillDeformationHasTheBitsOfNone) {
  const SplatCloud cloud = randomSplats(4);
  const SplatInstance instance = instanceOf(cloud);
  const Share same = std::make_shared<const SplatCloud>(cloud);
  const Share equal = std::make_shared<const SplatCloud>(cloud);
  Sampling sampling = opened(3);
  const RenderResult none = sampled({&instance, 1}, sampling);
  for (const std::vector<Share>& clouds : {std::vector<Share>{nullptr, nullptr, nullptr},
                                           {same, same, same},
                                           {same, equal, nullptr}}) {
    sampling.shutter.clouds = clouds;
    expectSamePicture(sampled({&instance, 1}, sampling), none);
  }
}

TEST(ChangingSplats, ThatAllMoveAlikeAreAnObjectThatMoves) {
  const SplatCloud cloud = randomSplats(5);
  const SplatInstance instance = instanceOf(cloud);
  SplatCloud after = cloud;
  for (size_t i = 0; i < after.size(); ++i) after.positions[3 * i] += 0.5f;
  Sampling by_clouds = opened(2, 64), by_matrices = opened(2, 64);
  by_clouds.shutter.clouds = {nullptr, std::make_shared<const SplatCloud>(after)};
  Mat4d last = Mat4d::Identity();
  last(0, 3) = 0.5;
  by_matrices.shutter.instances = {Mat4d::Identity(), last};
  const RenderResult a = sampled({&instance, 1}, by_clouds);
  const RenderResult b = sampled({&instance, 1}, by_matrices);
  double sum = 0;
  for (size_t i = 0; i < a.colour.size(); ++i) {
    sum += static_cast<double>(std::abs(a.colour[i] - b.colour[i]));
    // A splat at the rim of 1/255 in one of 64 pictures, and float32 places.
    ASSERT_NEAR(a.colour[i], b.colour[i], 2e-4f);
  }
  EXPECT_LT(sum / static_cast<double>(a.colour.size()), 2e-6);
  // As many pictures are needed: 0.5 m at some 4 m are 6 px, so make it fifty.
  by_clouds.samples = by_matrices.samples = 0;
  SplatCloud far = cloud;
  for (size_t i = 0; i < far.size(); ++i) far.positions[3 * i] += 3.0f;
  by_clouds.shutter.clouds[1] = std::make_shared<const SplatCloud>(far);
  by_matrices.shutter.instances[1](0, 3) = 3;
  EXPECT_EQ(automaticSamples({&instance, 1}, view(), by_clouds), 64u);
  EXPECT_EQ(automaticSamples({&instance, 1}, view(), by_matrices), 64u);
  // There and back is as long as twice the way.
  by_clouds.shutter.step_count = 3;
  by_clouds.shutter.clouds.push_back(nullptr);
  EXPECT_EQ(automaticSamples({&instance, 1}, view(), by_clouds), 128u);
  // And to and fro in every one of 18 steps, however little in each.
  by_clouds.shutter.step_count = 18;
  by_clouds.shutter.clouds.clear();
  const Share near = std::make_shared<const SplatCloud>(after);
  for (size_t s = 0; s < 18; ++s) by_clouds.shutter.clouds.push_back(s % 2 == 0 ? nullptr : near);
  EXPECT_EQ(automaticSamples({&instance, 1}, view(), by_clouds), 256u);
}

TEST(ChangingSplats, AddUpWithTheMotionOfTheirObject) {
  // The object goes one way and its splats the other: nothing moves, up to float32.
  const SplatCloud cloud = randomSplats(6);
  const SplatInstance instance = instanceOf(cloud);
  SplatCloud back = cloud;
  for (size_t i = 0; i < back.size(); ++i) back.positions[3 * i] -= 1.5f;
  Sampling sampling = opened(2, 0);
  Mat4d last = Mat4d::Identity();
  last(0, 3) = 1.5;
  sampling.shutter.instances = {Mat4d::Identity(), last};
  EXPECT_EQ(automaticSamples({&instance, 1}, view(), sampling), 32u);
  sampling.shutter.clouds = {nullptr, std::make_shared<const SplatCloud>(back)};
  EXPECT_EQ(automaticSamples({&instance, 1}, view(), sampling), 16u);
  Sampling still;
  still.samples = sampling.samples = 16;
  still.shutter = opened(2).shutter;
  const RenderResult a = sampled({&instance, 1}, sampling), b = sampled({&instance, 1}, still);
  for (size_t i = 0; i < a.colour.size(); ++i) ASSERT_NEAR(a.colour[i], b.colour[i], 5e-4f);
}

TEST(ChangingSplats, OfWhichEachInstanceHasItsOwnAreDrawnInOneWorkspace) {
  // A renderer that is used again, whose instances share clouds, against one that is new each time.
  const SplatCloud cloud = randomSplats(7);
  const Share other = changed(cloud, 0.5f, 10), third = changed(cloud, 0.5f, 11);
  std::vector<SplatInstance> instances(3, instanceOf(cloud));
  instances[1].object_to_world(0, 3) = 0.7;
  instances[2].object_to_world(0, 3) = -0.7;
  Sampling sampling = opened(2);
  sampling.shutter.clouds = {nullptr, nullptr, other, other, other, third};
  RenderWorkspace workspace;
  const auto reusing = [&](std::span<const SplatInstance> drawn, const Camera& camera,
                           const RenderOptions& options, RenderResult& result, Progress* progress) {
    EXPECT_EQ(drawn[0].cloud, drawn[1].cloud);
    EXPECT_NE(drawn[0].cloud, drawn[2].cloud);
    EXPECT_TRUE(drawn[2].values_are_checked);
    renderTiled(drawn, camera, options, workspace, result, progress);
  };
  for (const ObjectOrder order : {ObjectOrder::kTogether, ObjectOrder::kApart}) {
    RenderOptions options = everyPass();
    options.object_order = order;
    expectSamePicture(sampled(instances, sampling, options, reusing),
                      sampled(instances, sampling, options));
  }
}

TEST(ChangingSplats, GiveTheSameForAnyNumberOfThreads) {
  const SplatCloud cloud = randomSplats(8, 9000);
  const SplatInstance instance = instanceOf(cloud);
  Sampling sampling = opened(2, 4);
  sampling.shutter.clouds = {changed(cloud, 0.4f, 12), changed(cloud, 0.6f, 13)};
  RenderResult one, two;
  withThreads(1, [&] { one = sampled({&instance, 1}, sampling); });
  withThreads(2, [&] { two = sampled({&instance, 1}, sampling); });
  expectSamePicture(one, two);
}

std::string refusalOf(std::span<const SplatInstance> instances, const Sampling& sampling) {
  try {
    sampled(instances, sampling);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "";
}

TEST(ChangingSplats, OfOtherCountsDegreesAndValuesAreRefusedByName) {
  const SplatCloud cloud = randomSplats(9), beside = randomSplats(10, 77);
  const std::vector<SplatInstance> instances = {instanceOf(cloud), instanceOf(beside)};
  Sampling sampling = opened(2);
  const auto withSecond = [&](SplatCloud second) {
    sampling.shutter.clouds.assign(4, nullptr);
    sampling.shutter.clouds[3] = std::make_shared<const SplatCloud>(std::move(second));
  };
  sampling.shutter.clouds.assign(3, nullptr);
  EXPECT_EQ(refusalOf(instances, sampling),
            "the shutter has 3 clouds; one for each of 2 instances in each of its 2 steps is "
            "allowed");
  withSecond(cloud);
  EXPECT_EQ(refusalOf(instances, sampling),
            "instance 1: the cloud of step 1 has 200 splats of harmonic degree 1; those of the "
            "instance itself are 77 of degree 1, and all of its steps must have the same splats");
  SplatCloud wrong = beside;
  wrong.sh_degree = 0;
  wrong.sh.resize(77 * 3);
  withSecond(wrong);
  EXPECT_EQ(refusalOf(instances, sampling),
            "instance 1: the cloud of step 1 has 77 splats of harmonic degree 0; those of the "
            "instance itself are 77 of degree 1, and all of its steps must have the same splats");
  wrong = beside;
  wrong.antialias = Antialias::kMip;
  withSecond(wrong);
  EXPECT_EQ(refusalOf(instances, sampling),
            "instance 1: the cloud of step 1 has another colour space or low-pass than the "
            "instance's own splats; all of its steps must have the same");
  wrong = beside;
  wrong.opacities[5] = 1.5f;
  withSecond(wrong);
  EXPECT_NE(
      refusalOf(instances, sampling).find("instance 1: the cloud of step 1: opacity of splat"),
      std::string::npos);
  wrong.opacities[5] = std::nanf("");
  withSecond(wrong);
  EXPECT_NE(refusalOf(instances, sampling).find("instance 1: the cloud of step 1"),
            std::string::npos);
  sampling.samples = 0;
  EXPECT_NE(refusalOf(instances, sampling).find("instance 1: the cloud of step 1"),
            std::string::npos);
  wrong = beside;
  wrong.positions.resize(5);
  withSecond(wrong);
  EXPECT_EQ(refusalOf(instances, sampling),
            "instance 1: the cloud of step 1: positions holds 5 values; 231 are needed");
  withSecond(beside);
  EXPECT_EQ(refusalOf(instances, sampling), "");
}

TEST(ChangingSplats, AreCountedInTheMemory) {
  const SplatCloud cloud = randomSplats(11, 1000);
  const std::vector<SplatInstance> instances(3, instanceOf(cloud));
  Sampling sampling = opened(2);
  const uint64_t before = renderSampledBytes(instances, view(), {}, sampling);
  const Share other = changed(cloud, 0.5f, 14), third = changed(cloud, 0.5f, 15);
  sampling.shutter.clouds = {nullptr, nullptr, nullptr, other, nullptr, nullptr};
  const uint64_t one = renderSampledBytes(instances, view(), {}, sampling) - before;
  const uint64_t splats = 1000 * (11 + 12) * sizeof(float);
  EXPECT_GE(one, splats);
  EXPECT_LT(one, splats + 1000);
  // Instances with the same clouds share what lies between them.
  sampling.shutter.clouds = {nullptr, nullptr, nullptr, other, other, third};
  const uint64_t two = renderSampledBytes(instances, view(), {}, sampling) - before;
  EXPECT_GE(two, 2 * splats);
  EXPECT_LT(two, 2 * splats + 1000);
}

Instances owned(const SplatCloud& cloud) {
  Instances made;
  made.shares.push_back(std::make_shared<const SplatCloud>(cloud));
  made.list.push_back(instanceOf(*made.shares[0]));
  return made;
}

TEST(ChangingSplats, AreCutAlikeAtEveryStep) {
  const SplatCloud cloud = randomSplats(12, 600);
  SplatCloud after = cloud;
  for (size_t i = 0; i < after.size(); ++i) after.positions[3 * i] += 0.5f;
  Instances instances = owned(cloud);
  Sampling sampling = opened(3, 64);
  sampling.shutter.clouds = {nullptr, instances.shares[0], std::make_shared<SplatCloud>(after)};
  const uint64_t bound = CloudCuts::memoryBound(instances, sampling.shutter, 0.25);
  EXPECT_GT(bound, CloudCuts::memoryBound(instances, 0.25) + 150 * 23 * sizeof(float));
  CloudCuts cuts;
  cuts.cut(instances, sampling.shutter, 0.25, nullptr);
  EXPECT_EQ(instances.list[0].cloud->size(), 150u);
  EXPECT_EQ(sampling.shutter.clouds[0], nullptr);
  EXPECT_EQ(sampling.shutter.clouds[1], instances.shares[0]);
  EXPECT_EQ(sampling.shutter.clouds[2]->size(), 150u);
  EXPECT_NO_THROW(validate(sampling, instances.list));
  // Merged splats go along with theirs: the picture is that of the merged cloud that moves.
  sampling.shutter.step_count = 2;
  sampling.shutter.clouds.erase(sampling.shutter.clouds.begin());
  Sampling by_matrices = opened(2, 64);
  Mat4d last = Mat4d::Identity();
  last(0, 3) = 0.5;
  by_matrices.shutter.instances = {Mat4d::Identity(), last};
  const RenderResult a = sampled(instances.list, sampling);
  const RenderResult b = sampled(instances.list, by_matrices);
  for (size_t i = 0; i < a.colour.size(); ++i) ASSERT_NEAR(a.colour[i], b.colour[i], 5e-4f);
  // Whole clouds stay what they are.
  Instances whole = owned(cloud);
  sampling.shutter.clouds = {nullptr, std::make_shared<SplatCloud>(after)};
  const Share kept = sampling.shutter.clouds[1];
  cuts.cut(whole, sampling.shutter, 1, nullptr);
  EXPECT_EQ(sampling.shutter.clouds[1], kept);
  // A value that is none of a splat is named before it is merged.
  after.scales[7] = -1;
  sampling.shutter.clouds[1] = std::make_shared<SplatCloud>(after);
  try {
    cuts.cut(whole, sampling.shutter, 0.5, nullptr);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("instance 0: the cloud of step 1: scale of splat"),
              std::string::npos);
  }
}

}  // namespace
}  // namespace stipple
