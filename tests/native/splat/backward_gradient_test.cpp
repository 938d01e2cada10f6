#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/backward_cases.h"
#include "splat/cpu/tiles/tiled_backward.h"

// Every derivative is judged by central differences of the double reference. Their step is 1e-5 of
// the value's size: the second-order error is then about 1e-10, and rounding of the loss (1e-15 of
// about 100) over the step about 1e-8. The step actually stored in float32 is what is divided by. A
// step after which some pixel blends another number of splats has crossed a threshold, where the
// loss jumps; it is shortened, and the value left out if that does not help.

namespace stipple {
namespace {

using testing::frontCamera;
using testing::linearLoss;
using testing::pixelCount;
using testing::randomWeights;
using testing::smallCamera;
using testing::smallCloud;

struct Scene {
  std::vector<SplatCloud> clouds;
  std::vector<Mat4d> matrices;
  Camera camera;
  RenderOptions options;
  std::vector<float> depth_weights = {};  ///< [H,W] by the expected depth, or empty
  ColourGrade grade = {};                 ///< of every cloud

  std::vector<SplatInstance> instances() const {
    std::vector<SplatInstance> all;
    for (size_t i = 0; i < clouds.size(); ++i)
      all.push_back({&clouds[i], matrices[i], false, grade});
    return all;
  }
  ReferenceResult reference() const {
    RenderOptions with_counts = options;
    with_counts.with_counts = true;
    return renderReference(instances(), camera, with_counts);
  }
};

Scene oneCloud(const SplatCloud& cloud) {
  return {{cloud}, {Mat4d::Identity()}, smallCamera(), {}};
}

/// (f(+h) - f(-h)) / 2h, or NaN where both steps cross a threshold.
double centralDifference(const Scene& scene, const std::vector<float>& weights, double step,
                         const std::function<double(Scene&, double)>& move) {
  const ReferenceResult here = scene.reference();
  for (int attempt = 0; attempt < 2; ++attempt, step *= 0.1) {
    Scene moved = scene;
    const double up = move(moved, step);
    const ReferenceResult above = moved.reference();
    moved = scene;
    const double down = move(moved, -step);
    const ReferenceResult below = moved.reference();
    if (above.counts != here.counts || below.counts != here.counts) continue;
    return (linearLoss(above, weights, scene.depth_weights) -
            linearLoss(below, weights, scene.depth_weights)) /
           (up - down);
  }
  return std::nan("");
}

struct Judgement {
  size_t judged = 0;
  size_t left_out = 0;
};

/// float32 sums over a picture are off by about 1e-6 of the sum of their terms' sizes, alpha by
/// 3e-7 of itself, which 1/(1 - alpha) <= 100 grows: 1e-4 of the derivative or of the largest one
/// of the same array times 1e-2 covers both with a margin of two.
void expectDerivative(double seen, double expected, double largest, Judgement& judgement,
                      const std::string& what) {
  if (std::isnan(expected)) {
    ++judgement.left_out;
    return;
  }
  ++judgement.judged;
  EXPECT_NEAR(seen, expected, 1e-4 * std::abs(expected) + 3e-6 * largest) << what;
}

double largestOf(const std::vector<float>& values) {
  double largest = 0;
  for (const float value : values)
    largest = std::max(largest, std::abs(static_cast<double>(value)));
  return largest;
}

struct NamedArray {
  const char* name;
  std::vector<float> SplatCloud::*stored;
  std::vector<float> SplatGradients::*gradient;
  double size;  ///< of a typical value
};

constexpr NamedArray kArrays[] = {
    {"positions", &SplatCloud::positions, &SplatGradients::positions, 1.0},
    {"rotations", &SplatCloud::rotations, &SplatGradients::rotations, 1.0},
    {"scales", &SplatCloud::scales, &SplatGradients::scales, 0.2},
    {"opacities", &SplatCloud::opacities, &SplatGradients::opacities, 0.5},
    {"sh", &SplatCloud::sh, &SplatGradients::sh, 1.0}};

BackwardResult backward(const Scene& scene, const std::vector<float>& weights) {
  BackwardInput input;
  input.colour_gradient = weights;
  input.depth_gradient = scene.depth_weights;
  return renderBackward(scene.instances(), scene.camera, scene.options, input);
}

/// Judges every `stride`-th value of some arrays of every cloud.
void judgeClouds(const Scene& scene, const std::vector<float>& weights, size_t stride,
                 std::span<const NamedArray> arrays = kArrays) {
  const BackwardResult result = backward(scene, weights);
  Judgement judgement;
  for (size_t cloud = 0; cloud < scene.clouds.size(); ++cloud) {
    for (const NamedArray& array : arrays) {
      const std::vector<float>& gradient = result.instances[cloud].*array.gradient;
      ASSERT_EQ(gradient.size(), (scene.clouds[cloud].*array.stored).size());
      const double largest = largestOf(gradient);
      EXPECT_GT(largest, 0) << array.name;
      for (size_t i = 0; i < gradient.size(); i += stride) {
        const double expected =
            centralDifference(scene, weights, 1e-5 * array.size, [&](Scene& moved, double step) {
              float& value = (moved.clouds[cloud].*array.stored)[i];
              value = static_cast<float>(static_cast<double>(value) + step);
              return static_cast<double>(value);
            });
        expectDerivative(static_cast<double>(gradient[i]), expected, largest, judgement,
                         std::string(array.name) + " " + std::to_string(i));
      }
    }
  }
  // Most steps cross nothing: a judge that leaves out much would not judge.
  EXPECT_GT(judgement.judged, 20 * judgement.left_out);
}

/// exp(omega, upsilon) of a rigid motion, for small angles to second order and made exact.
Mat4d motion(const double* twist) {
  const Vec3d omega(twist[0], twist[1], twist[2]);
  Mat3d cross;
  cross << 0, -omega[2], omega[1], omega[2], 0, -omega[0], -omega[1], omega[0], 0;
  const double angle = omega.norm();
  const double sine = angle > 0 ? std::sin(angle) / angle : 1.0;
  const double cosine = angle > 0 ? (1.0 - std::cos(angle)) / (angle * angle) : 0.5;
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() = Mat3d::Identity() + sine * cross + cosine * cross * cross;
  matrix.topRightCorner<3, 1>() = Vec3d(twist[3], twist[4], twist[5]);
  return matrix;
}

void judgeCameraAndBackground(const Scene& scene, const std::vector<float>& weights) {
  const BackwardResult result = backward(scene, weights);
  Judgement judgement;
  double largest = 0;
  for (const double value : result.camera) largest = std::max(largest, std::abs(value));
  EXPECT_GT(largest, 0);
  for (size_t k = 0; k < 6; ++k) {
    const double expected = centralDifference(scene, weights, 1e-7, [&](Scene& moved, double step) {
      double twist[6] = {};
      twist[k] = step;
      moved.camera.world_to_camera = motion(twist) * moved.camera.world_to_camera;
      return step;
    });
    // The step is smaller because every splat moves: rounding gives 1e-15 * 100 / 1e-7 = 1e-6.
    expectDerivative(result.camera[k], expected, largest, judgement, "camera " + std::to_string(k));
  }
  EXPECT_GE(judgement.judged, 4u);
  for (size_t c = 0; c < 3; ++c) {
    const double expected = centralDifference(scene, weights, 1e-3, [&](Scene& moved, double step) {
      moved.options.background[c] += step;
      return moved.options.background[c];
    });
    EXPECT_NEAR(result.background[c], expected, 1e-5 * std::abs(expected) + 1e-5);
    if (!scene.options.with_background) {
      EXPECT_EQ(result.background[c], 0);
    }
  }
}

/// A loss that no colour enters.
void judgeGeometry(const Scene& scene, const std::vector<float>& weights) {
  judgeClouds(scene, weights, 1, std::span(kArrays).first(4));
}

void judge(const Scene& scene, size_t stride, uint32_t seed) {
  const std::vector<float> weights = randomWeights(pixelCount(scene.camera) * 4, seed);
  judgeClouds(scene, weights, stride);
  judgeCameraAndBackground(scene, weights);
}

TEST(Backward, MatchesDifferencesForEveryHarmonicDegree) {
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    SCOPED_TRACE(degree);
    judge(oneCloud(smallCloud(8, degree, 20 + static_cast<uint32_t>(degree))), 1, 1);
  }
}

TEST(Backward, MatchesDifferencesForEveryLowPass) {
  for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
    SCOPED_TRACE(static_cast<int>(low_pass));
    Scene scene = oneCloud(smallCloud(25, 1, 30));
    scene.options.low_pass = low_pass;
    judge(scene, 2, 2);
  }
}

TEST(Backward, MatchesDifferencesOverABackground) {
  Scene scene = oneCloud(smallCloud(20, 0, 40));
  scene.options.with_background = true;
  std::fill(scene.options.background, scene.options.background + 3, 1.0);
  judge(scene, 2, 3);
}

TEST(Backward, MatchesDifferencesUnderAnOrthographicCamera) {
  Scene scene = oneCloud(smallCloud(12, 2, 50));
  scene.camera.model = CameraModel::kOrthographic;
  scene.camera.fx = 8;
  scene.camera.fy = 9;
  judge(scene, 2, 4);
}

TEST(Backward, MatchesDifferencesOfTheHighestHarmonicsUnderAnOrthographicCamera) {
  for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
    SCOPED_TRACE(static_cast<int>(low_pass));
    Scene scene = oneCloud(smallCloud(8, 4, 55));
    scene.camera.model = CameraModel::kOrthographic;
    scene.camera.fx = 9;
    scene.camera.fy = 8;
    scene.options.low_pass = low_pass;
    scene.options.with_background = true;
    std::fill(scene.options.background, scene.options.background + 3, 0.75);
    judge(scene, 3, 11);
  }
}

TEST(Backward, MatchesDifferencesThroughTheExpectedDepth) {
  for (const bool with_background : {false, true}) {
    for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
      SCOPED_TRACE(::testing::Message() << with_background << static_cast<int>(model));
      Scene scene = oneCloud(smallCloud(14, 1, 57));
      scene.camera.model = model;
      if (model == CameraModel::kOrthographic) scene.camera.fx = scene.camera.fy = 8;
      scene.options.with_background = with_background;
      scene.options.background[0] = 0.5;
      scene.depth_weights = randomWeights(pixelCount(scene.camera), 12);
      judge(scene, 1, 13);
      // Depth alone, so that nothing else hides it.
      const std::vector<float> none(pixelCount(scene.camera) * 4, 0.0f);
      judgeGeometry(scene, none);
    }
  }
}

TEST(Backward, MatchesDifferencesThroughTheExpectedDepthWherePixelsEnd) {
  SplatCloud cloud = smallCloud(30, 0, 58);
  for (float& opacity : cloud.opacities) opacity = 0.9999f;
  Scene scene = oneCloud(cloud);
  scene.depth_weights = randomWeights(pixelCount(scene.camera), 14);
  judge(scene, 3, 15);
}

TEST(Backward, MatchesDifferencesThroughTheLinearisationOfColours) {
  Scene scene = oneCloud(smallCloud(12, 1, 60));
  scene.options.blend_space = BlendSpace::kSceneLinear;
  judge(scene, 2, 5);
}

TEST(Backward, MatchesDifferencesThroughAGrade) {
  for (const BlendSpace blend : {BlendSpace::kAsTrained, BlendSpace::kSceneLinear}) {
    Scene scene = oneCloud(smallCloud(12, 2, 62));
    scene.options.blend_space = blend;
    GradeSettings settings;
    settings.exposure = -0.4;
    settings.tint = {1.2, 0.9, 0.5};
    settings.saturation = 1.6;
    settings.opacity = 0.7;
    scene.grade = gradeOf(settings, ColourSpace::kDisplay);
    judge(scene, 2, 16);
  }
}

TEST(Backward, MatchesDifferencesWhereTheSlopeIsHeld) {
  // Splats far to the side, whose Jacobian is held at 1.3 times the frustum.
  SplatCloud cloud = smallCloud(16, 1, 70);
  for (size_t i = 0; i < cloud.size(); ++i) {
    cloud.positions[i * 3] = i % 2 ? 2.9f : -2.9f;
    cloud.scales[i * 3] = 1.0f;
    cloud.opacities[i] = 0.9f;
  }
  judge(oneCloud(cloud), 2, 6);
}

TEST(Backward, MatchesDifferencesWhereAlphaIsHeldAndPixelsEnd) {
  SplatCloud cloud = smallCloud(30, 0, 80);
  for (float& opacity : cloud.opacities) opacity = 0.9999f;  // a step above 1 is refused
  const Scene scene = oneCloud(cloud);
  judge(scene, 3, 7);
  // The case is what its name says.
  const ReferenceResult picture = scene.reference();
  double most = 0;
  for (size_t i = 3; i < picture.colour.size(); i += 4) most = std::max(most, picture.colour[i]);
  EXPECT_GT(most, 0.999);
}

TEST(Backward, GivesObjectSpaceDerivativesPerInstance) {
  Scene scene = oneCloud(smallCloud(8, 3, 90));
  scene.clouds.push_back(smallCloud(8, 1, 91));
  Mat4d sheared;
  sheared << 0.7, 0.2, -0.3, 0.1,  //
      0.1, -0.9, 0.2, -0.2,        //
      0.3, 0.1, 0.6, 0.3,          //
      0, 0, 0, 1;
  scene.matrices[0](0, 3) = 0.2;
  scene.matrices.push_back(sheared);
  judge(scene, 2, 8);
}

TEST(Backward, PassesNothingThroughColoursThatAreHeldAtZero) {
  SplatCloud cloud = smallCloud(10, 0, 100);
  for (size_t i = 0; i < cloud.sh.size(); i += 3) cloud.sh[i] = -3.0f;
  const Scene scene = oneCloud(cloud);
  const std::vector<float> weights = randomWeights(pixelCount(scene.camera) * 4, 9);
  const BackwardResult result = backward(scene, weights);
  for (size_t i = 0; i < cloud.sh.size(); ++i) {
    EXPECT_EQ(result.instances[0].sh[i] == 0.0f, i % 3 == 0);
  }
}

TEST(Backward, DoesNotDependOnTheLengthOfAQuaternion) {
  SplatCloud cloud = smallCloud(20, 0, 110);
  const Scene scene = oneCloud(cloud);
  Scene scaled = scene;
  for (float& value : scaled.clouds[0].rotations) value *= 4.0f;
  const std::vector<float> weights = randomWeights(pixelCount(scene.camera) * 4, 10);
  const SplatGradients one = backward(scene, weights).instances[0];
  const SplatGradients other = backward(scaled, weights).instances[0];
  for (size_t i = 0; i < cloud.size(); ++i) {
    double along = 0;
    for (size_t k = 0; k < 4; ++k) {
      // A power of two: every digit stays.
      EXPECT_EQ(one.rotations[i * 4 + k], 4.0f * other.rotations[i * 4 + k]);
      along += static_cast<double>(one.rotations[i * 4 + k]) *
               static_cast<double>(cloud.rotations[i * 4 + k]);
    }
    // Rounding of four products to float32.
    EXPECT_NEAR(along, 0, 1e-6 * largestOf(one.rotations));
  }
  EXPECT_EQ(one.positions, other.positions);
}

TEST(RenderBackward, CoverageHasADerivativeOverABackgroundToo) {
  Scene scene = oneCloud(smallCloud(20, 1, 90));
  const size_t count = pixelCount(scene.camera);
  std::vector<float> weights(count * 4, 0.0f);
  for (size_t i = 0; i < count; ++i) weights[i * 4 + 3] = 0.25f;
  const BackwardResult by_alpha = backward(scene, weights);

  BackwardInput input;
  const std::vector<float> none(count * 4, 0.0f);
  input.colour_gradient = none;
  input.coverage_gradient = 0.25;
  scene.options.with_background = true;
  scene.options.background[1] = 0.7;
  const BackwardResult by_coverage =
      renderBackward(scene.instances(), scene.camera, scene.options, input);
  for (const NamedArray& array : kArrays) {
    EXPECT_EQ(by_coverage.instances[0].*array.gradient, by_alpha.instances[0].*array.gradient)
        << array.name;
  }
  EXPECT_GT(largestOf(by_alpha.instances[0].opacities), 0.1);
  input.coverage_gradient = std::nan("");
  EXPECT_THROW(renderBackward(scene.instances(), scene.camera, scene.options, input), Error);
}

}  // namespace
}  // namespace stipple
