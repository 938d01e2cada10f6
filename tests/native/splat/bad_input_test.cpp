#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "base/error.h"
#include "splat/backward_cases.h"

// What enters drawing and its derivative: refused with one sentence that names the thing, the value
// seen and the value allowed; or, where it has a meaning, drawn.

namespace stipple {
namespace {

using testing::frontCamera;
using ::testing::HasSubstr;
using testing::oneSplat;
using testing::pixelCount;
using testing::randomWeights;
using testing::smallCamera;
using testing::smallCloud;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Everything that enters, good until a test spoils it.
struct Call {
  SplatCloud cloud = smallCloud(4, 1, 400);
  Mat4d matrix = Mat4d::Identity();
  Camera camera = frontCamera(6, 5, 6, 3);
  RenderOptions options;
  std::vector<float> colour_gradient = std::vector<float>(120, 1.0f);
  std::vector<float> residual = std::vector<float>(90, 0.5f);
  std::vector<float> residual_weights = std::vector<float>(30, 1.0f);
  std::vector<float> edge_weights = std::vector<float>(30, 1.0f);
  std::vector<float> errors = std::vector<float>(30, 1.0f);
  std::vector<float> depth_gradient = std::vector<float>(30, 1.0f);

  SplatInstance instance() const { return {&cloud, matrix}; }
  BackwardInput input() const {
    BackwardInput made;
    made.colour_gradient = colour_gradient;
    made.residual = residual;
    made.residual_weights = residual_weights;
    made.edge_weights = edge_weights;
    made.errors = errors;
    made.with_blending_weights = made.with_screen_gradients = true;
    made.with_absolute_screen_gradients = made.with_covered = true;
    made.depth_gradient = depth_gradient;
    return made;
  }
};

/// The message, after checking that it is one sentence of a caller's mistake.
std::string messageOf(const std::function<void()>& run) {
  try {
    run();
  } catch (const Error& error) {
    const std::string message = error.what();
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_EQ(message.find(". "), std::string::npos) << message;
    return message;
  }
  return "accepted";
}

std::string backwardMessage(const Call& call) {
  const SplatInstance instance = call.instance();
  return messageOf([&] {
    renderBackward({&instance, 1}, call.camera, call.options, call.input());
  });
}

/// The same message from both renderers and the derivative.
void expectRefused(const Call& call, const std::string& part) {
  const SplatInstance instance = call.instance();
  EXPECT_THAT(messageOf([&] {
                renderTiled({&instance, 1}, call.camera, call.options);
              }),
              HasSubstr(part));
  EXPECT_THAT(messageOf([&] {
                renderReference({&instance, 1}, call.camera, call.options);
              }),
              HasSubstr(part));
  EXPECT_THAT(backwardMessage(call), HasSubstr(part));
}

TEST(BadInput, IsWhatTheTestsSpoil) {
  EXPECT_EQ(backwardMessage(Call()), "accepted");
}

TEST(BadInput, ArraysOfACloudThatDisagreeAreRefusedByName) {
  struct Case {
    const char* name;
    std::vector<float> SplatCloud::*array;
  };
  for (const auto& [name, array] : {Case{"positions", &SplatCloud::positions},
                                    {"rotations", &SplatCloud::rotations},
                                    {"scales", &SplatCloud::scales},
                                    {"sh", &SplatCloud::sh}}) {
    Call call;
    (call.cloud.*array).pop_back();
    expectRefused(call, std::string("instance 0: ") + name + " holds " +
                            std::to_string((call.cloud.*array).size()) + " values; " +
                            std::to_string((call.cloud.*array).size() + 1) + " are needed");
  }
  Call opacities;  // these say how many there are
  opacities.cloud.opacities.pop_back();
  expectRefused(opacities, "positions holds 12 values; 9 are needed");
  Call degree;
  degree.cloud.sh_degree = 2;
  expectRefused(degree, "sh holds 48 values; 108 are needed");
  degree.cloud.sh_degree = 5;
  expectRefused(degree, "harmonic degree is 5; 0 to 4 is allowed");
}

TEST(BadInput, PicturesOfAnotherSizeAreRefusedByName) {
  struct Case {
    const char* name;
    std::vector<float> Call::*array;
  };
  for (const auto& [name, array] : {Case{"colour_gradient", &Call::colour_gradient},
                                    {"residual", &Call::residual},
                                    {"residual_weights", &Call::residual_weights},
                                    {"edge_weights", &Call::edge_weights},
                                    {"errors", &Call::errors},
                                    {"depth_gradient", &Call::depth_gradient}}) {
    for (const int change : {-1, 1}) {
      Call call;
      (call.*array).resize((call.*array).size() + static_cast<size_t>(change), 1.0f);
      EXPECT_THAT(backwardMessage(call),
                  HasSubstr(std::string(name) + " holds " + std::to_string((call.*array).size()) +
                            " values; the image has 30 pixels of "));
    }
  }
}

TEST(BadInput, NumbersOfACloudThatAreNotFiniteAreRefusedWhereverTheyStand) {
  struct Case {
    const char* name;
    std::vector<float> SplatCloud::*array;
  };
  for (const auto& [name, array] : {Case{"position", &SplatCloud::positions},
                                    {"rotation", &SplatCloud::rotations},
                                    {"scale", &SplatCloud::scales},
                                    {"opacity", &SplatCloud::opacities},
                                    {"colour", &SplatCloud::sh}}) {
    for (const double bad : {kNan, kInfinity, -kInfinity}) {
      const size_t stride = (Call().cloud.*array).size() / 4;
      for (const size_t splat : {size_t{0}, size_t{3}}) {
        Call call;
        (call.cloud.*array)[splat * stride + stride / 2] = static_cast<float>(bad);
        expectRefused(call, std::string("instance 0: ") + name + " of splat " +
                                std::to_string(splat) + " holds " + std::to_string(bad));
      }
    }
  }
}

TEST(BadInput, NumbersOfACloudOutsideTheirRangeAreRefused) {
  Call call;
  call.cloud.opacities[2] = 1.5f;
  expectRefused(call, "opacity of splat 2 is 1.500000; 0 to 1 is allowed");
  call = {};
  call.cloud.opacities[2] = -0.25f;
  expectRefused(call, "opacity of splat 2 is -0.250000; 0 to 1 is allowed");
  call = {};
  call.cloud.scales[4] = -0.5f;
  expectRefused(call, "scale of splat 1 is -0.500000 m; it must not be negative");
  call = {};
  std::fill_n(&call.cloud.rotations[4], 4, 0.0f);
  expectRefused(call, "rotation of splat 1 is the zero quaternion");
}

TEST(BadInput, CamerasThatMakeNoPictureAreRefused) {
  struct Case {
    std::function<void(Camera&)> spoil;
    const char* message;
  };
  const Case cases[] = {
      {[](Camera& c) { c.width = c.height = 0; }, "camera is 0 x 0 pixels; each side must be 1 to"},
      {[](Camera& c) { c.width = 0; }, "camera is 0 x 5 pixels"},
      {[](Camera& c) { c.height = 65537; }, "camera is 6 x 65537 pixels"},
      {[](Camera& c) { c.fx = 0; }, "focal length is 0"},
      {[](Camera& c) { c.fy = -4; }, "focal length is -4"},
      {[](Camera& c) { c.fx = kNan; }, "focal length is nan"},
      {[](Camera& c) { c.fy = kInfinity; }, "focal length is inf"},
      {[](Camera& c) { c.cx = -kInfinity; }, "camera.cx is -inf"},
      {[](Camera& c) { c.cy = kNan; }, "camera.cy is nan"},
      {[](Camera& c) { c.cx = 1e308; }, "camera.cx is 1e+308; finite numbers from -1e+12 to"},
      {[](Camera& c) { c.cy = -1.1e12; }, "camera.cy is -1.1e+12"},
      {[](Camera& c) { c.world_to_camera(2, 3) = 1e25; }, "camera.world_to_camera is 1e+25"},
      {[](Camera& c) { c.world_to_camera(1, 3) = kNan; }, "camera.world_to_camera is nan"},
      {[](Camera& c) { c.world_to_camera(0, 0) = kInfinity; }, "camera.world_to_camera is inf"},
      {[](Camera& c) { c.world_to_camera(0, 0) = 2; }, "it differs by 3 "},
      {[](Camera& c) { c.world_to_camera(3, 0) = 1; }, "must end with the row 0 0 0 1"},
      {[](Camera& c) { c.near_plane = kNan; }, "camera.near_plane is nan"},
      {[](Camera& c) { c.far_plane = kInfinity; }, "camera.far_plane is inf"},
      {[](Camera& c) { c.near_plane = c.far_plane = 2; }, "are 2.000000 and 2.000000 m"},
      {[](Camera& c) { c.near_plane = 3, c.far_plane = 2; }, "are 3.000000 and 2.000000 m"},
      {[](Camera& c) { c.near_plane = 0; }, "near and far planes are 0.0"},
      {[](Camera& c) { c.near_plane = -1; }, "near and far planes are -1.0"}};
  for (const Case& c : cases) {
    Call call;
    c.spoil(call.camera);
    // So that sizes of arrays are not what is wrong.
    for (std::vector<float> Call::*array :
         {&Call::residual, &Call::residual_weights, &Call::edge_weights, &Call::errors,
          &Call::depth_gradient}) {
      (call.*array).clear();
    }
    expectRefused(call, c.message);
    const SplatInstance instance = call.instance();
    EXPECT_THAT(messageOf([&] {
                  renderMemoryBound({&instance, 1}, call.camera, call.options);
                }),
                HasSubstr(c.message));
    EXPECT_THAT(messageOf([&] {
                  backwardMemoryBound({&instance, 1}, call.camera, call.options, call.input());
                }),
                HasSubstr(c.message));
  }
  Call parallel;
  parallel.camera.model = CameraModel::kOrthographic;
  parallel.camera.near_plane = -1;
  EXPECT_EQ(backwardMessage(parallel), "accepted") << "a parallel camera sees behind itself";
  parallel.camera.far_plane = -1;
  expectRefused(parallel, "are -1.000000 and -1.000000 m");
}

TEST(BadInput, OptionsAndPlacementsOutsideTheirRangeAreRefused) {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    for (size_t channel = 0; channel < 3; ++channel) {
      Call call;
      call.options.with_background = true;
      call.options.background[channel] = bad;
      expectRefused(call, "background is " + std::to_string(bad));
    }
    Call call;
    call.matrix(2, 3) = bad;
    expectRefused(call, "instance 0: matrix");
  }
  Call call;
  call.matrix(1, 1) = 0;
  expectRefused(call, "instance 0: matrix");
  call = {};
  call.options.sh_degree_limit = -1;
  expectRefused(call, "sh_degree_limit is -1; 0 to 4 is allowed");
  call = {};
  call.options.low_pass = static_cast<LowPass>(4);
  expectRefused(call, "low_pass is 4; 0 to 3 is allowed");
  call = {};
  call.options.blend_space = static_cast<BlendSpace>(2);
  expectRefused(call, "blend_space is 2; 0 or 1 is allowed");
}

TEST(BadInput, PicturesWithValuesOutsideTheirRangeAreRefusedByName) {
  struct Case {
    const char* name;
    std::vector<float> Call::*array;
    bool negative;  ///< may it be
  };
  for (const auto& [name, array, negative] : {Case{"colour_gradient", &Call::colour_gradient, true},
                                              {"residual", &Call::residual, true},
                                              {"residual_weights", &Call::residual_weights, false},
                                              {"edge_weights", &Call::edge_weights, true},
                                              {"errors", &Call::errors, false},
                                              {"depth_gradient", &Call::depth_gradient, true}}) {
    for (const double bad : {kNan, kInfinity, -kInfinity, 2e4, -2e4, -1.0}) {
      if (bad == -1.0 && negative) continue;
      Call call;
      (call.*array).back() = static_cast<float>(bad);
      EXPECT_THAT(backwardMessage(call),
                  HasSubstr(std::string(name) + " holds " + std::to_string(bad) + "; "));
    }
  }
}

/// The background wherever nothing is, and no derivative by anything but it.
void expectNothingDrawn(const SplatCloud& cloud, const Camera& camera) {
  const SplatInstance instance{&cloud};
  RenderOptions options;
  options.with_background = true;
  options.background[0] = 0.25;
  options.background[1] = 0.5;
  options.background[2] = 2;
  const RenderResult picture = renderTiled({&instance, 1}, camera, options);
  for (size_t i = 0; i < picture.colour.size(); i += 4) {
    EXPECT_EQ(picture.colour[i], 0.25f);
    EXPECT_EQ(picture.colour[i + 1], 0.5f);
    EXPECT_EQ(picture.colour[i + 2], 2.0f);
    EXPECT_EQ(picture.colour[i + 3], 1.0f);
  }
  const std::vector<float> pictures = randomWeights(pixelCount(camera) * 4, 401, 0, 1);
  const std::span<const float> all = pictures;
  const size_t n = pixelCount(camera);
  const BackwardInput input = {
      all,  0.5,  all.first(n * 3), all.first(n), all.first(n), all.first(n), true, true,
      true, true, all.first(n)};
  const BackwardResult result = renderBackward({&instance, 1}, camera, options, input);
  double by_red = 0;
  for (size_t i = 0; i < n; ++i) by_red += static_cast<double>(pictures[i * 4]);
  EXPECT_NEAR(result.background[0], by_red, 1e-5 * by_red);
  for (const double value : result.camera) EXPECT_EQ(value, 0.0);
  const SplatGradients& gradients = result.instances[0];
  for (const GradientArray& array : kGradientArrays) {
    const size_t per_splat = array.per_splat == 0 ? cloud.shStride() : array.per_splat;
    EXPECT_EQ(gradients.*array.values, std::vector<float>(cloud.size() * per_splat, 0.0f));
  }
}

TEST(BadInput, ACloudOfNothingOrOutOfSightGivesTheBackgroundAndZeros) {
  const Camera camera = smallCamera();
  expectNothingDrawn(SplatCloud(), camera);
  SplatCloud transparent = smallCloud(40, 1, 402);
  for (float& opacity : transparent.opacities) opacity = 0;
  expectNothingDrawn(transparent, camera);
  SplatCloud behind = smallCloud(40, 1, 403);
  for (size_t i = 0; i < behind.size(); ++i) behind.positions[i * 3 + 1] -= 100;
  expectNothingDrawn(behind, camera);
  Camera short_sighted = camera;
  short_sighted.near_plane = 0.01;
  short_sighted.far_plane = 0.02;
  expectNothingDrawn(smallCloud(40, 1, 404), short_sighted);
}

TEST(BadInput, SplatsWithoutExtentAreDrawnAsTheReferenceDrawsThem) {
  // A sheet, a line and a point. Without a low-pass they cover no area, so none of them shows; with
  // one they are as wide as it is.
  for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
    SplatCloud cloud = smallCloud(30, 0, 405);
    for (size_t i = 0; i < cloud.size(); ++i) {
      for (size_t axis = 0; axis <= i % 3; ++axis) cloud.scales[i * 3 + axis] = 0;
    }
    const SplatInstance instance{&cloud};
    RenderOptions options;
    options.low_pass = low_pass;
    options.with_counts = true;
    const Camera camera = smallCamera();
    const RenderResult picture = renderTiled({&instance, 1}, camera, options);
    const ReferenceResult expected = renderReference({&instance, 1}, camera, options);
    EXPECT_EQ(picture.counts, expected.counts);
    double most = 0;
    for (size_t i = 0; i < expected.colour.size(); ++i) {
      // Rounding of sums of at most 30 terms.
      EXPECT_NEAR(static_cast<double>(picture.colour[i]), expected.colour[i], 1e-5);
      most = std::max(most, expected.colour[i]);
    }
    EXPECT_GT(most, 0.1) << "the sheets show in any case";
    const std::vector<float> weights = randomWeights(pixelCount(camera) * 4, 406);
    BackwardInput input;
    input.colour_gradient = weights;
    const BackwardResult result = renderBackward({&instance, 1}, camera, options, input);
    for (std::vector<float> SplatGradients::*array :
         {&SplatGradients::positions, &SplatGradients::rotations, &SplatGradients::scales,
          &SplatGradients::opacities, &SplatGradients::sh}) {
      for (const float value : result.instances[0].*array) EXPECT_TRUE(std::isfinite(value));
    }
    for (const double value : result.camera) EXPECT_TRUE(std::isfinite(value));
  }
}

TEST(BadInput, QuaternionsOfAnyLengthDrawTheSamePicture) {
  const SplatCloud cloud = smallCloud(30, 1, 407);
  SplatCloud longer = cloud;
  for (float& value : longer.rotations) value *= 8.0f;  // a power of two: every digit stays
  const SplatInstance instances[] = {{&cloud}, {&longer}};
  const RenderResult one = renderTiled({&instances[0], 1}, smallCamera(), {});
  const RenderResult other = renderTiled({&instances[1], 1}, smallCamera(), {});
  EXPECT_EQ(one.colour, other.colour);
  EXPECT_EQ(one.depth, other.depth);
}

}  // namespace
}  // namespace stipple
