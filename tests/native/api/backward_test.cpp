#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>

#include "api/fixtures.h"

// Differentiable rendering and the loss through the C header. The derivatives themselves are judged
// in tests/native/splat and tests/native/train; here: that they arrive where they belong.

namespace stipple::test {
namespace {

using ::testing::HasSubstr;

constexpr uint64_t kCount = 12;
constexpr size_t kCoefficients = 4;  // degree 1

/// Splats in view of frontCamera, in the order of StippleCloudArrays.
struct Splats {
  std::vector<float> positions, rotations, scales, opacities, sh;

  explicit Splats(uint32_t seed) {
    std::mt19937 random(seed);
    const auto fill = [&](std::vector<float>& values, size_t count, float low, float high) {
      values.resize(count);
      for (float& value : values) {
        value = low + (high - low) * static_cast<float>(random() >> 8) * 0x1.0p-24f;
      }
    };
    fill(positions, kCount * 3, -0.8f, 0.8f);
    fill(rotations, kCount * 4, -1, 1);
    fill(scales, kCount * 3, 0.05f, 0.4f);
    fill(opacities, kCount, 0.2f, 0.9f);
    fill(sh, kCount * kCoefficients * 3, -0.2f, 0.8f);
  }

  StippleCloud* make(StippleContext* context) const {
    auto arrays = sized<StippleCloudArrays>();
    arrays.sh_degree = 1;
    arrays.count = kCount;
    arrays.positions = positions.data();
    arrays.rotations = rotations.data();
    arrays.scales = scales.data();
    arrays.opacities = opacities.data();
    arrays.sh = sh.data();
    StippleCloud* cloud = nullptr;
    STIPPLE_EXPECT_OK(stipple_cloud_create(context, &arrays, &cloud));
    return cloud;
  }
};

/// Every buffer of StippleSplatGradients, filled with a number that no derivative has.
struct Gradients {
  static constexpr float kUntouched = -12345.0f;
  std::vector<float> positions, rotations, scales, opacities, sh, contributions, blending_weights,
      edge_weights, screen_gradients, absolute_screen_gradients, screen_gradient_norms, errors,
      largest_errors;

  explicit Gradients(size_t count = kCount) {
    const auto sizes = {3, 4, 3, 1, 12, 1, 1, 1, 2, 2, 1, 1, 1};
    auto size = sizes.begin();
    for (std::vector<float>* values : all()) {
      values->assign(count * static_cast<size_t>(*size++), kUntouched);
    }
  }
  std::vector<std::vector<float>*> all() {
    return {&positions,
            &rotations,
            &scales,
            &opacities,
            &sh,
            &contributions,
            &blending_weights,
            &edge_weights,
            &screen_gradients,
            &absolute_screen_gradients,
            &screen_gradient_norms,
            &errors,
            &largest_errors};
  }
  StippleSplatGradients plain(size_t count = kCount) {
    auto made = sized<StippleSplatGradients>();
    made.capacity = count;
    made.positions = positions.data();
    made.rotations = rotations.data();
    made.scales = scales.data();
    made.opacities = opacities.data();
    made.sh = sh.data();
    return made;
  }
  StippleSplatGradients full(size_t count = kCount) {
    StippleSplatGradients made = plain(count);
    made.contributions = contributions.data();
    made.blending_weights = blending_weights.data();
    made.edge_weights = edge_weights.data();
    made.screen_gradients = screen_gradients.data();
    made.absolute_screen_gradients = absolute_screen_gradients.data();
    made.screen_gradient_norms = screen_gradient_norms.data();
    made.errors = errors.data();
    made.largest_errors = largest_errors.data();
    return made;
  }
};

class Backward : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    STIPPLE_ASSERT_OK(stipple_renderer_create(context_, &renderer_));
    stipple_render_options_init(&options_);
    options_.output_colour = STIPPLE_OUTPUT_COMPOSITED;
    cloud_ = splats_.make(context_);
    const size_t pixel_count = size_t{camera_.width} * camera_.height;
    std::mt19937 random(9);
    pictures_.resize(pixel_count * 4);
    for (float& value : pictures_) value = static_cast<float>(random() >> 8) * 0x1.0p-24f;
    input_ = sized<StippleBackwardInput>();
    input_.colour_gradient = pictures_.data();
  }
  void TearDown() override {
    stipple_cloud_free(cloud_);
    stipple_renderer_free(renderer_);
    ApiTest::TearDown();
  }

  void giveEveryPicture() {
    input_.residual = input_.residual_weights = pictures_.data();
    input_.edge_weights = input_.errors = input_.depth_gradient = pictures_.data();
  }

  /// Starts and waits; the status of whichever failed.
  StippleStatus run(StippleRenderer* renderer, const StippleCloud* cloud,
                    const StippleSplatGradients& gradients, StippleBackwardResult* result) {
    const StippleInstance instance = placed(cloud);
    StippleJob* job = nullptr;
    StippleStatus status = stipple_renderer_backward_start(
        renderer, &instance, 1, &camera_, &options_, &input_, &gradients, result, &job);
    EXPECT_EQ(job == nullptr, status != STIPPLE_OK);
    if (job) status = stipple_job_wait(job);
    stipple_job_free(job);
    return status;
  }
  StippleStatus run(const StippleSplatGradients& gradients,
                    StippleBackwardResult* result = nullptr) {
    return run(renderer_, cloud_, gradients, result);
  }

  void expectRefused(const StippleSplatGradients& gradients, const char* part,
                     StippleStatus status = STIPPLE_ERROR_INVALID_ARGUMENT) {
    EXPECT_EQ(run(gradients), status);
    EXPECT_THAT(stipple_last_error_message(), HasSubstr(part));
  }

  /// Sum of the colour gradient times the picture of the double reference.
  double loss(const Splats& splats) {
    StippleCloud* cloud = splats.make(context_);
    StippleRenderOptions options = options_;
    options.method = STIPPLE_RENDER_REFERENCE;
    const std::vector<float> picture = render(context_, cloud, options, camera_);
    stipple_cloud_free(cloud);
    double sum = 0;
    for (size_t i = 0; i < picture.size(); ++i) {
      sum += static_cast<double>(picture[i]) * static_cast<double>(pictures_[i]);
    }
    return sum;
  }

  StippleRenderer* renderer_ = nullptr;
  StippleCloud* cloud_ = nullptr;
  const Splats splats_{5};
  const StippleCamera camera_ = frontCamera();
  StippleRenderOptions options_ = {};
  std::vector<float> pictures_;  ///< [H,W,4] of 0..1, which serves as every picture
  StippleBackwardInput input_ = {};
};

TEST_F(Backward, GivesTheDifferencesOfThePicture) {
  options_.with_background = 1;
  options_.background[0] = 0.75;
  Gradients seen;
  auto result = sized<StippleBackwardResult>();
  STIPPLE_ASSERT_OK(run(seen.plain(), &result));
  EXPECT_EQ(result.visible_count, kCount);
  struct Case {
    const char* name;
    std::vector<float> Splats::*stored;
    std::vector<float> Gradients::*gradient;
    float step;
  };
  // The picture is float32: its rounding, 6e-8 of 12,288 numbers added like a random walk, is 3e-6,
  // which a step of 0.002 makes 1e-3. Splats end at alpha = 1/255: what their moved edge takes in
  // is no part of the derivative, and is a few hundredths of it where all weights are positive.
  for (const Case& c : {Case{"positions", &Splats::positions, &Gradients::positions, 1e-3f},
                        Case{"scales", &Splats::scales, &Gradients::scales, 1e-3f},
                        Case{"opacities", &Splats::opacities, &Gradients::opacities, 1e-2f},
                        Case{"sh", &Splats::sh, &Gradients::sh, 1e-2f}}) {
    const std::vector<float>& gradient = seen.*c.gradient;
    float largest = 0;
    for (const float value : gradient) largest = std::max(largest, std::abs(value));
    EXPECT_GT(largest, 1.0f) << c.name;
    for (size_t i = 0; i < gradient.size(); i += 5) {
      Splats up = splats_, down = splats_;
      (up.*c.stored)[i] += c.step;
      (down.*c.stored)[i] -= c.step;
      const double expected = (loss(up) - loss(down)) / (2 * static_cast<double>(c.step));
      EXPECT_NEAR(static_cast<double>(gradient[i]), expected, 0.05 * static_cast<double>(largest))
          << c.name << " " << i;
    }
  }
  const double base = loss(splats_);
  options_.background[1] += 0.5;
  EXPECT_NEAR(result.background[1], (loss(splats_) - base) / 0.5,
              1e-3 * std::abs(result.background[1]));
  // Quaternions are stored with unit length: their derivative is at right angles to them.
  for (size_t i = 0; i < kCount; ++i) {
    float along = 0, length = 0;
    for (size_t k = 0; k < 4; ++k) {
      along += seen.rotations[i * 4 + k] * splats_.rotations[i * 4 + k];
      length += std::abs(seen.rotations[i * 4 + k]);
    }
    EXPECT_NEAR(along, 0, 1e-5f * length + 1e-5f);
  }
}

TEST_F(Backward, GivesStatisticsWhereTheirBuffersAreGiven) {
  giveEveryPicture();
  Gradients all;
  STIPPLE_ASSERT_OK(run(all.full()));
  for (const std::vector<float>* values : all.all()) {
    EXPECT_EQ(std::count(values->begin(), values->end(), Gradients::kUntouched), 0);
  }
  const std::vector<float> picture = render(context_, cloud_, options_, camera_);
  double coverage = 0, weights = 0;
  for (size_t i = 3; i < picture.size(); i += 4) coverage += static_cast<double>(picture[i]);
  for (const float value : all.blending_weights) weights += static_cast<double>(value);
  EXPECT_NEAR(weights, coverage, 1e-5 * coverage);

  // One of them alone: the others' buffers stay as they are, and gradients keep their bits.
  Gradients one;
  StippleSplatGradients wanted = one.plain();
  wanted.contributions = one.contributions.data();
  wanted.sh = nullptr;
  STIPPLE_ASSERT_OK(run(wanted));
  EXPECT_EQ(one.contributions, all.contributions);
  EXPECT_EQ(one.positions, all.positions);
  EXPECT_EQ(one.sh, Gradients().sh);
  EXPECT_EQ(one.errors, Gradients().errors);
}

TEST_F(Backward, NeedsThePictureOfAStatistic) {
  Gradients seen;
  StippleSplatGradients wanted = seen.plain();
  wanted.contributions = seen.contributions.data();
  expectRefused(wanted, "input->residual is NULL; it must be given where contributions are wanted");
  wanted = seen.plain();
  wanted.edge_weights = seen.edge_weights.data();
  expectRefused(wanted, "input->edge_weights is NULL");
  wanted = seen.plain();
  wanted.largest_errors = seen.largest_errors.data();
  expectRefused(wanted, "input->errors is NULL");
  input_.colour_gradient = nullptr;
  expectRefused(seen.plain(), "input->colour_gradient is NULL");
}

TEST_F(Backward, RefusesWhatHasNoDerivative) {
  Gradients seen;
  options_.method = STIPPLE_RENDER_REFERENCE;
  expectRefused(seen.plain(), "options->method is 1; derivatives have 0 (tiled) only");
  options_.method = STIPPLE_RENDER_TILED;
  options_.samples = 4;
  expectRefused(seen.plain(), "derivatives are those of one sharp image");
  options_.samples = 0;
  options_.output_colour = STIPPLE_OUTPUT_SCENE_LINEAR;
  expectRefused(seen.plain(), "derivatives are those of 1 (composited)");
  options_.blend_space = STIPPLE_BLEND_SCENE_LINEAR;  // nothing is converted after compositing
  STIPPLE_EXPECT_OK(run(seen.plain()));
}

TEST_F(Backward, WritesNothingWhereAValueIsRefused) {
  giveEveryPicture();
  const float bad_values[] = {std::numeric_limits<float>::quiet_NaN(),
                              std::numeric_limits<float>::infinity(), -1e6f};
  struct Case {
    const char* name;
    const float* StippleBackwardInput::*picture;
  };
  for (const auto& [name, picture] :
       {Case{"colour_gradient", &StippleBackwardInput::colour_gradient},
        Case{"residual", &StippleBackwardInput::residual},
        Case{"residual_weights", &StippleBackwardInput::residual_weights},
        Case{"edge_weights", &StippleBackwardInput::edge_weights},
        Case{"errors", &StippleBackwardInput::errors},
        Case{"depth_gradient", &StippleBackwardInput::depth_gradient}}) {
    for (const float bad : bad_values) {
      std::vector<float> values = pictures_;
      values[17] = bad;
      const StippleBackwardInput good = input_;
      input_.*picture = values.data();
      Gradients seen;
      auto result = sized<StippleBackwardResult>();
      EXPECT_EQ(run(renderer_, cloud_, seen.full(), &result), STIPPLE_ERROR_INVALID_ARGUMENT);
      EXPECT_THAT(stipple_last_error_message(), HasSubstr(std::string(name) + " holds "));
      for (const std::vector<float>* values_seen : seen.all()) {
        EXPECT_EQ(values_seen->front(), Gradients::kUntouched);
      }
      EXPECT_EQ(result.visible_count, 0u);
      input_ = good;
    }
  }
}

TEST_F(Backward, OfNothingIsTheBackground) {
  options_.with_background = 1;
  auto arrays = sized<StippleCloudArrays>();
  StippleCloud* empty = nullptr;
  STIPPLE_ASSERT_OK(stipple_cloud_create(context_, &arrays, &empty));
  const auto none = sized<StippleSplatGradients>();
  auto result = sized<StippleBackwardResult>();
  STIPPLE_EXPECT_OK(run(renderer_, empty, none, &result));
  stipple_cloud_free(empty);
  double sum = 0;
  for (size_t i = 0; i < pictures_.size(); i += 4) {
    sum += static_cast<double>(pictures_[i]);
  }
  EXPECT_NEAR(result.background[0], sum, 1e-5 * sum);
  for (const double value : result.camera) EXPECT_EQ(value, 0.0);

  auto without = sized<StippleBackwardResult>();
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_renderer_backward_start(renderer_, nullptr, 0, &camera_, &options_,
                                                    &input_, nullptr, &without, &job));
  STIPPLE_EXPECT_OK(stipple_job_wait(job));
  stipple_job_free(job);
  EXPECT_EQ(without.background[0], result.background[0]);
}

TEST_F(Backward, GivesTheSameBitsForAnyThreadsAndForTwoJobsAtOnce) {
  giveEveryPicture();
  Gradients first;
  STIPPLE_ASSERT_OK(run(first.full()));
  StippleContext* one = withThreadCount(1);
  StippleRenderer* renderer = nullptr;
  STIPPLE_ASSERT_OK(stipple_renderer_create(one, &renderer));
  const StippleInstance instance = placed(cloud_);
  Gradients others[4];
  StippleJob* jobs[4] = {};
  for (size_t i = 0; i < 4; ++i) {
    const StippleSplatGradients buffers = others[i].full();
    STIPPLE_ASSERT_OK(stipple_renderer_backward_start(renderer, &instance, 1, &camera_, &options_,
                                                      &input_, &buffers, nullptr, &jobs[i]));
  }
  stipple_renderer_free(renderer);
  stipple_context_free(one);
  for (size_t i = 0; i < 4; ++i) {
    STIPPLE_EXPECT_OK(stipple_job_wait(jobs[i]));
    stipple_job_free(jobs[i]);
    const auto expected = first.all();
    const auto seen = others[i].all();
    for (size_t k = 0; k < seen.size(); ++k) EXPECT_EQ(*seen[k], *expected[k]) << k;
  }
}

TEST_F(Backward, RefusesSmallBuffersAndTooMuchMemoryBeforeItStarts) {
  Gradients seen;
  expectRefused(seen.plain(kCount - 1), "gradients[0].capacity is 11 splats; 12 are needed",
                STIPPLE_ERROR_BUFFER_TOO_SMALL);
  const StippleInstance instance = placed(cloud_);
  uint64_t plain = 0, full = 0;
  StippleSplatGradients wanted = seen.plain();
  STIPPLE_ASSERT_OK(stipple_renderer_backward_memory_bound(renderer_, &instance, 1, &camera_,
                                                           &input_, &wanted, &plain));
  giveEveryPicture();
  wanted = seen.full();
  STIPPLE_ASSERT_OK(stipple_renderer_backward_memory_bound(renderer_, &instance, 1, &camera_,
                                                           &input_, &wanted, &full));
  EXPECT_GT(full, plain);

  StippleContextOptions limited;
  stipple_context_options_init(&limited);
  limited.memory_limit_bytes = full - 1;
  StippleContext* context = nullptr;
  STIPPLE_ASSERT_OK(stipple_context_create(&limited, &context));
  StippleRenderer* renderer = nullptr;
  STIPPLE_ASSERT_OK(stipple_renderer_create(context, &renderer));
  EXPECT_EQ(run(renderer, cloud_, wanted, nullptr), STIPPLE_ERROR_MEMORY_LIMIT);
  const std::string whole = std::to_string(full >> 20) + ".";  // mebibytes, before the hundredths
  EXPECT_THAT(
      stipple_last_error_message(),
      HasSubstr("the backward pass of an image of 64 x 48 pixels would need up to " + whole));
  EXPECT_THAT(stipple_last_error_message(),
              HasSubstr("pairs of splat and tile; the memory limit is " + whole));
  STIPPLE_EXPECT_OK(run(renderer, cloud_, seen.plain(), nullptr));
  stipple_renderer_free(renderer);
  stipple_context_free(context);
}

class Loss : public ApiTest {
 protected:
  StippleStatus evaluate(uint32_t width, uint32_t height, const std::vector<float>& rendered,
                         const std::vector<float>& target, const StippleImageLossOptions& options,
                         float* gradient = nullptr) {
    value_ = sized<StippleImageLoss>();
    return stipple_image_loss(context_, width, height, rendered.data(), target.data(), nullptr,
                              &options, &value_, gradient);
  }
  static StippleImageLossOptions options() {
    StippleImageLossOptions made;
    stipple_image_loss_options_init(&made);
    return made;
  }
  StippleImageLoss value_ = {};
};

TEST_F(Loss, IsThatOfTheFormulaAndItsGradientThatOfItsDifferences) {
  constexpr uint32_t kWidth = 21, kHeight = 17;
  std::mt19937 random(3);
  std::vector<float> rendered(kWidth * kHeight * 4), target(kWidth * kHeight * 3);
  for (float& v : rendered) v = static_cast<float>(random() >> 8) * 0x1.0p-24f;
  for (float& v : target) v = static_cast<float>(random() >> 8) * 0x1.0p-24f;
  std::vector<float> gradient(rendered.size(), -1.0f);
  STIPPLE_ASSERT_OK(evaluate(kWidth, kHeight, rendered, target, options(), gradient.data()));
  double l1 = 0;
  for (size_t i = 0; i < target.size(); ++i) {
    l1 +=
        std::abs(static_cast<double>(rendered[i / 3 * 4 + i % 3]) - static_cast<double>(target[i]));
  }
  EXPECT_NEAR(value_.l1, l1 / static_cast<double>(target.size()), 1e-6);
  EXPECT_NEAR(value_.loss, 0.8 * value_.l1 + 0.2 * (1 - value_.ssim), 1e-12);
  for (size_t i = 0; i < rendered.size(); i += 101) {
    if (i % 4 == 3) continue;
    // Sums are double; a colour is rounded to 6e-8 and a blur to 1e-7, over 1,071 terms of the
    // mean.
    const float step = 0.01f;
    std::vector<float> moved = rendered;
    moved[i] += step;
    STIPPLE_ASSERT_OK(evaluate(kWidth, kHeight, moved, target, options()));
    const double up = value_.loss;
    moved[i] = rendered[i] - step;
    STIPPLE_ASSERT_OK(evaluate(kWidth, kHeight, moved, target, options()));
    EXPECT_NEAR(static_cast<double>(gradient[i]), (up - value_.loss) / 0.02, 3e-5) << i;
  }
  for (size_t i = 3; i < gradient.size(); i += 4) EXPECT_EQ(gradient[i], 0.0f);
}

TEST_F(Loss, OfEqualPicturesIsNothingInEveryLayout) {
  const std::vector<float> grey(9 * 7 * 4, 0.4f);
  for (const uint32_t channels : {3u, 4u}) {
    for (const uint32_t target_channels : {3u, 4u}) {
      StippleImageLossOptions given = options();
      given.rendered_channels = channels;
      given.target_channels = target_channels;
      std::vector<float> gradient(grey.size(), 1.0f);
      STIPPLE_ASSERT_OK(evaluate(9, 7, grey, grey, given, gradient.data()));
      EXPECT_EQ(value_.loss, 0.0);
      EXPECT_EQ(value_.ssim, 1.0);
      EXPECT_EQ(std::count(gradient.begin(), gradient.end(), 0.0f), 63 * channels);
    }
  }
}

TEST_F(Loss, RefusesBadInputByName) {
  const std::vector<float> grey(16, 0.4f);
  const auto refused = [&](StippleStatus status, const char* part) {
    EXPECT_EQ(status, STIPPLE_ERROR_INVALID_ARGUMENT);
    EXPECT_THAT(stipple_last_error_message(), HasSubstr(part));
  };
  refused(evaluate(0, 0, grey, grey, options()), "the image is 0 x 0 pixels; each side must be 1");
  StippleImageLossOptions given = options();
  given.rendered_channels = 2;
  refused(evaluate(2, 2, grey, grey, given), "options->rendered_channels is 2; 3 or 4 is allowed");
  given = options();
  given.target_channels = 1;
  refused(evaluate(2, 2, grey, grey, given), "options->target_channels is 1; 3 or 4 is allowed");
  given = options();
  given.ssim_share = 1.5;
  refused(evaluate(2, 2, grey, grey, given), "ssim_share is 1.5");
  std::vector<float> broken = grey;
  broken[5] = std::numeric_limits<float>::quiet_NaN();
  refused(evaluate(2, 2, broken, grey, options()),
          "rendered image: channel 1 of the pixel in row 0");
  refused(
      stipple_image_loss(context_, 2, 2, grey.data(), nullptr, nullptr, nullptr, &value_, nullptr),
      "target is NULL");
  refused(stipple_image_loss(context_, 2, 2, grey.data(), grey.data(), nullptr, nullptr, nullptr,
                             nullptr),
          "value is NULL");
}

}  // namespace
}  // namespace stipple::test
