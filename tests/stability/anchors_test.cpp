#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "decode/anchors/key_frame.h"
#include "decode/anchors/scaffold_decoder.h"
#include "train/anchors/relay_model.h"
#include "train/anchors/scaffold_model.h"
#include "train/fit_scene.h"
#include "train/loop/moving_splats.h"

// Anchors with features, and key frames of them, of numbers at their ends and views that say little
// or nothing, with traps on: every number stays finite.

namespace stipple {
namespace {

using namespace stipple::testing;

void expectFinite(const TensorTable& table) {
  for (const auto& [name, tensor] : table) {
    const auto* values = std::get_if<std::vector<float>>(&tensor.values);
    if (!values) continue;
    for (const float value : *values) ASSERT_TRUE(std::isfinite(value)) << name;
  }
}

void expectFinite(const std::vector<float>& values) {
  for (const float value : values) ASSERT_TRUE(std::isfinite(value));
}

TEST(AnchorStability, NumbersAtTheirEnds) {
  ScaffoldParameters scaffold = makeScaffold({.gaussians = 4, .sh_degree = 1});
  const float place[] = {0, 0, 0};
  for (int a = 0; a < 6; ++a) addAnchor(scaffold, place, nullptr, 1.0f);
  const float ends[] = {-1e30f, -90, 0, 90, 1e30f, 29};
  for (size_t i = 0; i < scaffold.log_scales.size(); ++i) {
    scaffold.log_scales[i] = ends[i / kScaffoldScales];
  }
  for (size_t i = 0; i < scaffold.offsets.size(); ++i) scaffold.offsets[i] = i % 2 ? 1e6f : -1e-30f;
  for (size_t i = 0; i < scaffold.features.size(); ++i) scaffold.features[i] = i % 3 ? 1e6f : -1e6f;
  const ScaffoldDecoder decoder(std::make_shared<const ScaffoldParameters>(scaffold));
  ScaffoldTape tape;
  SplatCloud cloud;
  decoder.forward(scaffold, 6, tape, cloud);
  ASSERT_GT(cloud.size(), 0u);
  validate(cloud, "splats of numbers at their ends");
  SplatCloud by_cloud = cloud;
  for (auto values : {&SplatCloud::positions, &SplatCloud::rotations, &SplatCloud::scales,
                      &SplatCloud::opacities, &SplatCloud::sh}) {
    for (float& value : by_cloud.*values) value = 1e-3f;
  }
  ScaffoldGradients gradients;
  decoder.backward(scaffold, tape, cloud, by_cloud, gradients);
  expectFinite(gradients.anchors.log_scales);
  expectFinite(gradients.anchors.offsets);
  expectFinite(gradients.anchors.features);
}

TEST(AnchorStability, QuaternionsOfZeros) {
  ScaffoldParameters scaffold = makeScaffold({.gaussians = 2});
  const float place[] = {1, 2, 3};
  addAnchor(scaffold, place, nullptr, 1.0f);
  for (LinearLayer& layer : scaffold.covariance.layers()) {
    layer.weights.assign(layer.weights.size(), 0.0f);
    layer.biases.assign(layer.biases.size(), 0.0f);
  }
  const ScaffoldDecoder decoder(std::make_shared<const ScaffoldParameters>(scaffold));
  ScaffoldTape tape;
  SplatCloud cloud;
  decoder.forward(scaffold, 1, tape, cloud);
  validate(cloud, "splats of quaternions of zeros");
  SplatCloud by_cloud = cloud;
  ScaffoldGradients gradients;
  decoder.backward(scaffold, tape, cloud, by_cloud, gradients);
  expectFinite(gradients.covariance.back().biases);
}

TEST(AnchorStability, QuaternionsWhoseSquaresAreInfinite) {
  ScaffoldParameters scaffold = makeScaffold({.gaussians = 2});
  const float place[] = {1, 2, 3};
  addAnchor(scaffold, place, nullptr, 1.0f);
  std::vector<LinearLayer>& layers = scaffold.covariance.layers();
  for (LinearLayer& layer : layers) layer.weights.assign(layer.weights.size(), 0.0f);
  const float largest = std::numeric_limits<float>::max();
  for (size_t i = 0; i < layers.back().biases.size(); ++i) {
    layers.back().biases[i] = i % 7 < 3 ? 0.0f : (i % 2 ? largest : -largest);
  }
  const ScaffoldDecoder decoder(std::make_shared<const ScaffoldParameters>(scaffold));
  ScaffoldTape tape;
  SplatCloud cloud;
  decoder.forward(scaffold, 1, tape, cloud);
  ASSERT_GT(cloud.size(), 0u);
  validate(cloud, "splats of long quaternions");
  for (const float value : cloud.rotations) EXPECT_FLOAT_EQ(std::abs(value), 0.5f);
  SplatCloud by_cloud = cloud;
  ScaffoldGradients gradients;
  decoder.backward(scaffold, tape, cloud, by_cloud, gradients);
  expectFinite(gradients.covariance.back().biases);
}

TEST(AnchorStability, BlendingAtItsEnds) {
  KeyFrame frame;
  frame.scaffold = makeScaffold({.gaussians = 1});
  const float place[] = {0, 0, 0};
  for (const float raw : {-1e30f, -800.0f, 0.0f, 800.0f, 1e30f}) {
    addAnchor(frame.scaffold, place, nullptr, 1.0f);
    frame.blend.insert(frame.blend.end(), {raw, raw, -raw, raw});
  }
  for (const double tau : {-1.0, -1e-300, 0.0, 0.5, 1.0}) {
    const std::vector<float> own = fadingOf(frame, 5, tau), other = fadingOf(frame, 5, tau - 1);
    expectFinite(sharesOf(own, other));
    std::vector<float> by_own(5, 0.0f), by_other(5, 0.0f), by_blend(frame.blend.size(), 0.0f);
    sharesBackward(own, other, std::vector<float>(5, 1.0f), by_own, by_other);
    fadingBackward(frame, tau, by_own, by_blend);
    expectFinite(by_blend);
  }
}

std::shared_ptr<MemoryViewSource> flatViews(float colour, float alpha, size_t count, double apart) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  const std::vector<Camera> cameras = camerasAround(count, 24);
  for (size_t v = 0; v < count; ++v) {
    ViewPicture picture;
    picture.width = picture.height = 24;
    picture.colour.assign(24 * 24 * 3, colour * alpha * (v % 2 == 0 ? 1.0f : 0.3f));
    picture.alpha.assign(24 * 24, alpha);
    views->add(cameras[v], std::move(picture), {}, static_cast<double>(v % 2) * apart);
  }
  views->setPoints(pointsOf(ballOfSplats(50, 3), 0, 1));
  return views;
}

ScaffoldModelOptions small() {
  ScaffoldModelOptions options;
  options.most_anchors = 80;
  options.gaussians_per_anchor = 3;
  options.sh_degree = 1;
  return options;
}

TEST(AnchorStability, FitsOfViewsThatSayNothing) {
  for (const float colour : {0.0f, 0.5f, 1e3f}) {
    for (const float alpha : {0.0f, 1.0f}) {
      for (const double extent : {0.0, 3.85}) {
        const auto views = flatViews(colour, alpha, 4, 0);
        const auto model = makeScaffoldModel(*cpuBackends(), *views, allViews(*views), small());
        Fit fit(*views, *model, 600);
        fit.moment().extent = extent;
        EXPECT_TRUE(std::isfinite(fit.run(300).loss));
        expectFinite(model->state());
        validate(model->splats(0), "fitted");
      }
    }
  }
}

TEST(AnchorStability, EveryPointAtOnePlaceAndFarFromTheOrigin) {
  for (const float where : {0.0f, 1e6f}) {
    const auto views = flatViews(0.5f, 1, 4, 0);
    SplatCloud points = ballOfSplats(30, 3);
    for (float& value : points.positions) value = where;
    views->setPoints(pointsOf(points, 0, 1));
    const auto model = makeScaffoldModel(*cpuBackends(), *views, allViews(*views), small());
    EXPECT_GE(scaffoldResult(*model)->size(), 1u);
    Fit fit(*views, *model, 600);
    fit.run(300);
    expectFinite(model->state());
  }
}

TEST(AnchorStability, RelaysOfHardClips) {
  for (const double apart : {1e-9, 1.0, 1e12}) {
    for (const float alpha : {0.0f, 1.0f}) {
      SCOPED_TRACE(apart);
      const auto views = flatViews(0.7f, alpha, 4, apart);
      const MotionClip times = clipOfViews(*views);
      RelayModelOptions options;
      options.anchors = small();
      options.clip.begin = times.begin;
      options.clip.frames_per_second = times.frames_per_second;
      options.clip.frame_count = times.frame_count;
      options.iterations = 120;
      const auto model = makeRelayModel(*cpuBackends(), *views, allViews(*views), options,
                                        std::make_shared<MemoryKeyFrames>());
      Fit fit(*views, *model, 120);
      EXPECT_TRUE(std::isfinite(fit.run(120).loss));
      expectFinite(model->state());
      for (const double time : {-1e300, 0.0, apart / 3, apart, 1e300}) {
        validate(model->splatsAt(0, time), "at a time");
      }
    }
  }
}

}  // namespace
}  // namespace stipple
