#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "splat/backward_cases.h"
#include "splat/cpu/tiles/tile_kernel_backward.h"
#include "splat/reference_backward.h"

// Every hard case goes backwards with traps on and every statistic asked for, and is judged by the
// same in double.

namespace stipple {
namespace {

using testing::backwardReference;
using testing::CloudRecipe;
using testing::frontCamera;
using testing::oneSplat;
using testing::pixelCount;
using testing::randomCloud;
using testing::randomWeights;
using testing::withScales;

/// A splat's derivative is a sum of terms of either sign; float32 leaves 1e-5 of their sizes (alpha
/// near 0.99 costs most), which the largest derivative of the array stands for.
/// `least` stands for it where derivatives are zero but for rounding.
void expectNear(const std::vector<float>& seen, const std::vector<float>& expected,
                const char* name, double least = 0) {
  ASSERT_EQ(seen.size(), expected.size()) << name;
  double largest = least;
  for (const float value : expected) {
    largest = std::max(largest, std::abs(static_cast<double>(value)));
  }
  size_t wrong = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    const double a = static_cast<double>(seen[i]);
    const double b = static_cast<double>(expected[i]);
    const bool good = std::isfinite(a) && std::abs(a - b) <= 3e-4 * std::abs(b) + 3e-5 * largest;
    if (!good && ++wrong <= 3) ADD_FAILURE() << name << " " << i << ": " << a << ", not " << b;
  }
  EXPECT_EQ(wrong, 0u) << name << " of " << seen.size();
}

void expectSound(const SplatCloud& cloud, const Camera& camera, LowPass low_pass,
                 bool with_depth = false) {
  RenderOptions options;
  options.low_pass = low_pass;
  const std::vector<float> gradient = randomWeights(pixelCount(camera) * 4, 1);
  const std::vector<float> residual = randomWeights(pixelCount(camera) * 3, 2, -0.1f, 0.1f);
  BackwardInput input;
  input.colour_gradient = gradient;
  input.residual = residual;
  input.with_blending_weights = true;
  input.with_screen_gradients = input.with_absolute_screen_gradients = true;
  const std::vector<float> depth_gradient =
      with_depth ? randomWeights(pixelCount(camera), 3) : std::vector<float>();
  input.depth_gradient = depth_gradient;
  const SplatInstance instance{&cloud};
  const BackwardResult result = renderBackward({&instance, 1}, camera, options, input);
  const SplatGradients& seen = result.instances[0];
  const SplatGradients expected =
      backwardReference(cloud, camera, options, gradient, residual, depth_gradient);
  expectNear(seen.positions, expected.positions, "positions");
  // Turning a round splat changes nothing: what is left are differences of what its axes change.
  double turning = 0;
  for (size_t i = 0; i < cloud.scales.size(); ++i) {
    turning = std::max(turning, std::abs(static_cast<double>(cloud.scales[i]) *
                                         static_cast<double>(expected.scales[i])));
  }
  expectNear(seen.rotations, expected.rotations, "rotations", turning);
  expectNear(seen.scales, expected.scales, "scales");
  expectNear(seen.opacities, expected.opacities, "opacities");
  expectNear(seen.sh, expected.sh, "sh");
  expectNear(seen.contributions, expected.contributions, "contributions");
  expectNear(seen.blending_weights, expected.blending_weights, "blending_weights");
  expectNear(seen.screen_gradient_norms, expected.screen_gradient_norms, "screen_gradient_norms");
  for (const double value : result.camera) EXPECT_TRUE(std::isfinite(value));
}

void expectSoundForEveryLowPass(const SplatCloud& cloud, const Camera& camera) {
  for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
    SCOPED_TRACE(::testing::Message() << "low-pass " << static_cast<int>(low_pass));
    expectSound(cloud, camera, low_pass);
  }
}

TEST(BackwardStability, Needles) {
  const Camera camera = frontCamera(43, 31, 30, 3);
  for (const auto& [length, width] :
       {std::pair(1.0f, 1e-6f), std::pair(1000.0f, 1e-3f), std::pair(1e6f, 1.0f)}) {
    SCOPED_TRACE(length);
    expectSoundForEveryLowPass(withScales(100, length, width, width, 1), camera);
    expectSoundForEveryLowPass(withScales(100, length, width, 0, 2), camera);
  }
}

TEST(BackwardStability, NearZeroAndHugeScales) {
  const Camera camera = frontCamera(30, 30, 30, 3);
  for (const float scale : {0.0f, 1e-38f, 1e-20f, 1e-9f, 1e-5f, 1e3f, 1e9f, 1e30f, 3e38f}) {
    SCOPED_TRACE(scale);
    expectSoundForEveryLowPass(withScales(100, scale, scale, scale, 3), camera);
  }
}

TEST(BackwardStability, SubPixelAndScreenFillingTogether) {
  CloudRecipe recipe;
  recipe.count = 800;
  recipe.size_min = 1e-5;
  recipe.size_max = 50;
  recipe.opacity_max = 0.2;
  recipe.degree = 2;
  expectSoundForEveryLowPass(randomCloud(recipe, 6), frontCamera(50, 40, 40, 3));
}

TEST(BackwardStability, AtTheNearPlane) {
  CloudRecipe recipe;
  recipe.count = 200;
  recipe.degree = 3;
  recipe.size_max = 2;
  SplatCloud cloud = randomCloud(recipe, 7);
  Camera camera = frontCamera(40, 40, 30, 0);
  camera.near_plane = 0.25;
  const float depths[] = {0.25f, 0.0f, std::nextafter(0.25f, 1.0f), -0.25f, 1e-30f};
  for (size_t i = 0; i < 60; ++i) cloud.positions[i * 3 + 1] = depths[i % 5];
  for (size_t i = 0; i < 5; ++i) cloud.positions[i * 3] = cloud.positions[i * 3 + 2] = 0;
  expectSoundForEveryLowPass(cloud, camera);
}

TEST(BackwardStability, AMillionUnitsFromTheOrigin) {
  CloudRecipe recipe;
  recipe.count = 200;
  recipe.degree = 2;
  SplatCloud cloud = randomCloud(recipe, 8);
  Camera camera = frontCamera(40, 40, 33, 3);
  const Vec3d away(1e6, -1e6, 1e6);
  const Mat3d turn = camera.world_to_camera.topLeftCorner<3, 3>();
  camera.world_to_camera.topRightCorner<3, 1>() -= turn * away;
  for (size_t i = 0; i < cloud.positions.size(); ++i) {
    cloud.positions[i] += static_cast<float>(away[static_cast<int>(i % 3)]);
  }
  expectSoundForEveryLowPass(cloud, camera);
}

TEST(BackwardStability, AlphaTowardsOneAndTransmittanceTowardsZero) {
  for (const float opacity : {0.98f, 0.99f, std::nextafter(0.99f, 1.0f), 1.0f}) {
    SCOPED_TRACE(opacity);
    CloudRecipe recipe;
    recipe.count = 1000;
    recipe.size_min = 0.05;
    SplatCloud cloud = randomCloud(recipe, 10);
    for (float& o : cloud.opacities) o = opacity;
    expectSoundForEveryLowPass(cloud, frontCamera(38, 38, 30, 3));
  }
}

TEST(BackwardStability, TenThousandLayers) {
  for (const float opacity : {1.0f / 255.0f, 0.004f, 0.02f}) {
    SCOPED_TRACE(opacity);
    SplatCloud cloud = withScales(10000, 2, 2, 2, 11);
    for (float& o : cloud.opacities) o = opacity;
    expectSound(cloud, frontCamera(12, 12, 10, 3), LowPass::kClassic);
  }
}

TEST(BackwardStability, DepthOfPixelsThatAreHardlyCovered) {
  // Coverage down to 1/255 and depths from the near plane to a million units behind each other.
  CloudRecipe recipe;
  recipe.count = 300;
  recipe.degree = 1;
  for (const float opacity : {1.01f / 255.0f, 0.005f, 0.1f, 1.0f}) {
    SCOPED_TRACE(opacity);
    SplatCloud cloud = randomCloud(recipe, 13);
    for (float& o : cloud.opacities) o = opacity;
    for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
      expectSound(cloud, frontCamera(40, 40, 30, 3), low_pass, true);
    }
  }
}

TEST(BackwardStability, DepthOfNeedlesAndManyLayers) {
  expectSound(withScales(100, 1000.0f, 1e-3f, 1e-3f, 1), frontCamera(43, 31, 30, 3),
              LowPass::kClassic, true);
  SplatCloud cloud = withScales(10000, 2, 2, 2, 11);
  for (float& o : cloud.opacities) o = 0.004f;
  expectSound(cloud, frontCamera(12, 12, 10, 3), LowPass::kClassic, true);
}

TEST(BackwardStability, EqualDepthsAndTinyPictures) {
  CloudRecipe recipe;
  recipe.count = 300;
  SplatCloud cloud = randomCloud(recipe, 12);
  for (size_t i = 0; i < cloud.size(); ++i) cloud.positions[i * 3 + 1] = 0;
  expectSoundForEveryLowPass(cloud, frontCamera(30, 30, 25, 3));
  expectSoundForEveryLowPass(cloud, frontCamera(1, 1, 1, 3));
  expectSoundForEveryLowPass(cloud, frontCamera(1, 1, 1e6, 3));
  expectSoundForEveryLowPass(cloud, frontCamera(1, 200, 1e-3, 3));
}

TEST(BackwardStability, ExtremeQuaternionsAndColours) {
  CloudRecipe recipe;
  recipe.count = 200;
  recipe.degree = 1;
  SplatCloud cloud = randomCloud(recipe, 15);
  for (size_t i = 0; i < cloud.size(); ++i) {
    for (size_t c = 0; c < 4; ++c) cloud.rotations[i * 4 + c] *= 1e38f;
  }
  expectSoundForEveryLowPass(cloud, frontCamera(30, 30, 25, 3));
  // A derivative by a tiny quaternion may be beyond float32: it is held to its largest.
  for (float& value : cloud.rotations) value = std::copysign(1e-38f, value);
  const Camera camera = frontCamera(30, 30, 25, 3);
  const std::vector<float> gradient(pixelCount(camera) * 4, 1e4f);
  for (float& value : cloud.sh) value *= 1e30f;
  BackwardInput input;
  input.colour_gradient = gradient;
  input.with_screen_gradients = input.with_absolute_screen_gradients = true;
  const SplatInstance instance{&cloud};
  RenderOptions options;
  options.blend_space = BlendSpace::kSceneLinear;
  const BackwardResult result = renderBackward({&instance, 1}, camera, options, input);
  for (const std::vector<float>* values :
       {&result.instances[0].positions, &result.instances[0].rotations, &result.instances[0].scales,
        &result.instances[0].opacities, &result.instances[0].sh,
        &result.instances[0].screen_gradient_norms}) {
    for (const float value : *values) EXPECT_TRUE(std::isfinite(value));
  }
}

TEST(BackwardStability, EveryKernelKeepsDeadLanesQuiet) {
  // One pixel of the tile is hit; the exponents of the others reach -1e13.
  TileSplat splat{};
  splat.l00 = splat.l11 = splat.l10 = 1e5f;
  splat.g0 = -3e5f;
  splat.g1 = -6e5f;
  splat.doubt_low = splat.doubt_high = 1e-3f;
  splat.colour[0] = 1;
  splat.depth = 1e38f;
  splat.row_end = kTileSide;
  for (const BackwardKernel& kernel : backwardKernels()) {
    SCOPED_TRACE(kernel.target);
    BackwardPixels pixels{};
    for (uint32_t i = 0; i < kTilePixelCount; ++i) {
      pixels.transmittance[i] = 0.01f;
      pixels.end[i] = kNeverEnded;
      pixels.gradient[0][i] = 1;
      pixels.depth[i] = kEmptyDepth;
    }
    std::fill(pixels.row_end, pixels.row_end + kTileSide, kNeverEnded);
    constexpr size_t kHit = 3 * kTileSide + 3;
    float sums[kMostFields];
    kernel.take_off(&splat, 1, {{BackwardMode::kStatistics, true}, 0, nullptr, nullptr}, pixels,
                    sums);
    EXPECT_NEAR(sums[kFieldRed], 0.99f, 1e-6);
    EXPECT_EQ(sums[kFieldS], 0.0f);  // alpha is held
    EXPECT_NEAR(pixels.transmittance[kHit], 1.0f, 1e-6);
    EXPECT_EQ(pixels.transmittance[0], 0.01f);
    EXPECT_EQ(pixels.behind[0], 0.0f);
  }
}

TEST(BackwardStability, RefusesWhatIsNotFinite) {
  const Camera camera = frontCamera(8, 8, 8, 3);
  const SplatCloud good = oneSplat(0.1f, 0.5f);
  const size_t n = pixelCount(camera);
  const std::vector<float> ones(n * 4, 1.0f);
  const auto inputOf = [&](const std::vector<float>& values) {
    const std::span<const float> all = values;
    return BackwardInput{
        all,  0.5,  all.first(n * 3), all.first(n), all.first(n), all.first(n), true, true,
        true, true, all.first(n)};
  };
  const auto refused = [&](const SplatCloud& cloud, const BackwardInput& input) {
    const SplatInstance instance{&cloud};
    EXPECT_THROW(renderBackward({&instance, 1}, camera, {}, input), Error);
  };
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
        -std::numeric_limits<float>::infinity()}) {
    for (std::vector<float> SplatCloud::*array :
         {&SplatCloud::positions, &SplatCloud::rotations, &SplatCloud::scales,
          &SplatCloud::opacities, &SplatCloud::sh}) {
      SplatCloud cloud = good;
      (cloud.*array).back() = bad;
      refused(cloud, inputOf(ones));
    }
    std::vector<float> broken = ones;
    broken[n / 2] = bad;  // inside every picture
    const BackwardInput bad_input = inputOf(broken);
    for (std::span<const float> BackwardInput::*picture :
         {&BackwardInput::colour_gradient, &BackwardInput::residual,
          &BackwardInput::residual_weights, &BackwardInput::edge_weights, &BackwardInput::errors,
          &BackwardInput::depth_gradient}) {
      BackwardInput input = inputOf(ones);
      input.*picture = bad_input.*picture;
      refused(good, input);
    }
    RenderOptions options;
    options.background[2] = static_cast<double>(bad);
    const SplatInstance instance{&good};
    EXPECT_THROW(renderBackward({&instance, 1}, camera, options, inputOf(ones)), Error);
  }
}

}  // namespace
}  // namespace stipple
