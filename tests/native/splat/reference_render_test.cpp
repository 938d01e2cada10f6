#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "data/clouds/cloud_transform.h"
#include "math/colour.h"
#include "splat/random_scene.h"
#include "splat/render/projection.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::oneSplat;
using testing::randomCloud;

// Closed forms and double arithmetic of a few operations.
constexpr double kExact = 1e-12;
// Values that the test itself holds in float32 (colours, opacities).
constexpr double kFloat = 1e-6;

RenderOptions everything() {
  RenderOptions options;
  options.with_median_depth = true;
  options.with_counts = true;
  return options;
}

SplatCloud stack(const std::vector<float>& opacities, const std::vector<float>& depths) {
  SplatCloud cloud;
  cloud.resize(opacities.size());
  cloud.opacities = opacities;
  for (size_t i = 0; i < opacities.size(); ++i) {
    cloud.positions[i * 3 + 1] = depths[i];
    cloud.rotations[i * 4] = 1;
    for (size_t c = 0; c < 3; ++c) {
      cloud.scales[i * 3 + c] = 0.1f;
      cloud.sh[i * 3 + c] = (static_cast<float>(i + 1) * 0.1f - 0.5f) / kShC0;
    }
  }
  return cloud;
}

TEST(ReferenceRender, GivesTheGaussianOfOneRoundSplat) {
  const double o = 0.8, focal = 40, distance = 2;
  const SplatCloud cloud = oneSplat(0.1f, 0.8f);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(21, 21, focal, distance);
  const double sigma = static_cast<double>(0.1f) * focal / distance;
  struct Case {
    LowPass low_pass;
    double added, factor;
  };
  const double s2 = sigma * sigma;
  for (const Case& c :
       {Case{LowPass::kClassic, 0.3, 1.0}, Case{LowPass::kMip, 0.1, s2 / (s2 + 0.1)},
        Case{LowPass::kNone, 0.0, 1.0}}) {
    RenderOptions options;
    options.low_pass = c.low_pass;
    const ReferenceResult picture = renderReference({&instance, 1}, camera, options);
    for (int y = 0; y < 21; ++y) {
      for (int x = 0; x < 21; ++x) {
        const double d2 = (x - 10) * (x - 10) + (y - 10) * (y - 10);
        double alpha = o * c.factor * std::exp(-0.5 * d2 / (s2 + c.added));
        if (alpha < 1.0 / 255.0) alpha = 0;
        const double* pixel = &picture.colour[static_cast<size_t>(y * 21 + x) * 4];
        EXPECT_NEAR(pixel[3], alpha, 1e-7) << x << " " << y;  // opacity 0.8 is rounded to float32
        EXPECT_NEAR(pixel[0], alpha * (static_cast<double>(kShC0) + 0.5), kFloat);
      }
    }
  }
}

TEST(ReferenceRender, BlendsFrontToBackByHand) {
  // Given back to front; at the middle pixel every splat has its full opacity.
  const SplatCloud cloud = stack({0.5f, 0.75f}, {1.0f, -1.0f});
  const SplatInstance instance{&cloud};
  const ReferenceResult picture =
      renderReference({&instance, 1}, frontCamera(3, 3, 30, 4), everything());
  const double* pixel = &picture.colour[4 * 4];
  EXPECT_NEAR(pixel[0], 0.75 * 0.2 + 0.25 * 0.5 * 0.1, kFloat);
  EXPECT_NEAR(pixel[3], 1 - 0.25 * 0.5, kExact);
  EXPECT_NEAR(picture.depth[4], (0.75 * 3 + 0.125 * 5) / 0.875, kExact);
  EXPECT_EQ(picture.median_depth[4], 3.0);
  EXPECT_EQ(picture.counts[4], 2u);
}

TEST(ReferenceRender, HoldsAlphaAt099AndEndsAPixelBefore1e4) {
  const SplatCloud opaque = stack({1.0f}, {0.0f});
  SplatInstance instance{&opaque};
  const Camera camera = frontCamera(3, 3, 30, 4);
  EXPECT_NEAR(renderReference({&instance, 1}, camera, {}).colour[4 * 4 + 3], 0.99, kExact);
  // T: 0.05, 0.0025, 0.000125; the fourth would bring it below 1e-4.
  const SplatCloud four = stack({0.95f, 0.95f, 0.95f, 0.95f}, {0, 0.1f, 0.2f, 0.3f});
  instance.cloud = &four;
  const ReferenceResult picture = renderReference({&instance, 1}, camera, everything());
  EXPECT_EQ(picture.counts[4], 3u);
  EXPECT_NEAR(picture.colour[4 * 4 + 3], 1 - 0.000125, 1e-9);
}

TEST(ReferenceRender, BlendsEqualDepthsByIndex) {
  SplatCloud cloud = stack({0.5f, 0.5f}, {0, 0});
  SplatInstance instances[] = {{&cloud}, {&cloud}};
  const ReferenceResult picture = renderReference(instances, frontCamera(3, 3, 30, 4), {});
  // Order: 0.1, 0.2 of the first instance, then of the second.
  EXPECT_NEAR(picture.colour[4 * 4], 0.5 * 0.1 + 0.25 * 0.2 + 0.125 * 0.1 + 0.0625 * 0.2, kFloat);
}

TEST(ReferenceRender, LeavesOutCentresBeyondNearAndFar) {
  const SplatCloud cloud = stack({0.5f, 0.5f, 0.5f, 0.5f}, {-4.5f, -3.5f, 0.0f, 6.0f});
  const SplatInstance instance{&cloud};
  Camera camera = frontCamera(3, 3, 30, 4);
  camera.near_plane = 1;
  camera.far_plane = 9;
  EXPECT_EQ(renderReference({&instance, 1}, camera, everything()).counts[4], 1u);
  EXPECT_EQ(renderTiled({&instance, 1}, camera, everything()).counts[4], 1u);
}

TEST(ReferenceRender, ShowsTheSamePixelsInACroppedCamera) {
  // A crop moves the principal point only; the Jacobian's limits follow the picture but no centre
  // in this scene reaches them, so pixels agree to rounding.
  CloudRecipe recipe;
  recipe.count = 100;
  recipe.degree = 2;
  const SplatCloud cloud = randomCloud(recipe, 9);
  const SplatInstance instance{&cloud};
  const Camera whole = frontCamera(120, 120, 60, 4);
  Camera crop = whole;
  crop.width = 90;
  crop.height = 80;
  crop.cx -= 20;
  crop.cy -= 30;
  const ReferenceResult a = renderReference({&instance, 1}, whole, {});
  const ReferenceResult b = renderReference({&instance, 1}, crop, {});
  for (size_t y = 0; y < 80; ++y) {
    for (size_t x = 0; x < 90 * 4; ++x) {
      ASSERT_NEAR(b.colour[y * 90 * 4 + x], a.colour[(y + 30) * 120 * 4 + 20 * 4 + x], 1e-9);
    }
  }
}

TEST(ReferenceRender, HoldsTheSlopeAtOneAndAThirdTimesTheOffCentreFrustum) {
  // The picture sees x/z from 0.5 to 1.5 (middle 1, half 0.5), so slopes are held to 0.35..1.65.
  Camera camera = frontCamera(100, 100, 100, 0);
  camera.cx = -50;
  const View<double> view = makeView<double>(camera);
  EXPECT_NEAR(view.slope_min[0], 0.35, kExact);
  EXPECT_NEAR(view.slope_max[0], 1.65, kExact);
  EXPECT_NEAR(view.slope_min[1], -0.65, kExact);
  EXPECT_NEAR(view.slope_max[1], 0.65, kExact);
}

TEST(ReferenceRender, ProjectsTheCovarianceOfTheTextbook) {
  CloudRecipe recipe;
  recipe.count = 200;
  const SplatCloud cloud = randomCloud(recipe, 21);
  const Camera camera = frontCamera(100, 80, 90, 4);
  const View<double> view = makeView<double>(camera);
  const Mat3d turn = camera.world_to_camera.topLeftCorner<3, 3>();
  const Vec3d move = camera.world_to_camera.topRightCorner<3, 1>();
  size_t compared = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    Projected<double> p;
    if (!project<double>(view, turn, move, &cloud.positions[i * 3], &cloud.rotations[i * 4],
                         &cloud.scales[i * 3], cloud.opacities[i], LowPass::kClassic, p)) {
      continue;
    }
    const Vec3d centre =
        turn * Eigen::Map<const Vec3f>(&cloud.positions[i * 3]).cast<double>() + move;
    Eigen::Matrix<double, 2, 3> j;
    j << view.fx / centre.z(), 0, -view.fx * centre.x() / (centre.z() * centre.z()), 0,
        view.fy / centre.z(), -view.fy * centre.y() / (centre.z() * centre.z());
    if (std::abs(centre.x() / centre.z()) > 0.7 || std::abs(centre.y() / centre.z()) > 0.55)
      continue;
    const Eigen::Matrix2d sigma =
        j * turn * covariance<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]) *
            turn.transpose() * j.transpose() +
        0.3 * Eigen::Matrix2d::Identity();
    Eigen::Matrix2d l;
    l << p.footprint.l00, 0, p.footprint.l10, p.footprint.l11;
    // L^T L sigma = I; the condition number of these splats is below 1e4.
    EXPECT_LT((l.transpose() * l * sigma - Eigen::Matrix2d::Identity()).norm(), 1e-9);
    ++compared;
  }
  EXPECT_GT(compared, 100u);
}

TEST(ReferenceRender, KeepsDigitsOnNeedles) {
  // A needle of 1e6 : 1 at 45 degrees with no low-pass: its width across must survive.
  const float rotation[4] = {std::cos(0.39269908f), 0, 0, std::sin(0.39269908f)};
  const float scales[3] = {1000.0f, 0.001f, 0.001f};
  const float position[3] = {0, 0, 5};
  Camera camera = frontCamera(100, 100, 1000, 0);
  const View<double> view = makeView<double>(camera);
  Projected<double> p;
  ASSERT_TRUE(project<double>(view, Mat3d::Identity(), Vec3d::Zero(), position, rotation, scales,
                              1.0f, LowPass::kNone, p));
  // det of the footprint = (fx/z)^2 s0 s1 = 200 * 1000 * 200 * 0.001.
  EXPECT_NEAR(1.0 / (p.footprint.l00 * p.footprint.l11), 200.0 * 1000 * 200 * 0.001, 1e-2);
}

TEST(ReferenceRender, OrthographicDoesNotShrinkWithDistance) {
  const SplatCloud cloud = oneSplat(0.1f, 0.8f);
  SplatInstance instance{&cloud};
  Camera camera = frontCamera(21, 21, 40, 2);
  camera.model = CameraModel::kOrthographic;
  const ReferenceResult near = renderReference({&instance, 1}, camera, {});
  instance.object_to_world(1, 3) = 50;
  const ReferenceResult far = renderReference({&instance, 1}, camera, {});
  EXPECT_EQ(near.colour, far.colour);
  EXPECT_NEAR(far.depth[10 * 21 + 10], 52, kExact);
  const double sigma2 = std::pow(static_cast<double>(0.1f) * 40, 2) + 0.3;
  EXPECT_NEAR(near.colour[(10 * 21 + 12) * 4 + 3], 0.8 * std::exp(-2 / sigma2), kFloat);
}

TEST(ReferenceRender, LinearisesEachSplatForSceneLinear) {
  const SplatCloud cloud = stack({0.5f, 0.75f}, {1.0f, -1.0f});
  const SplatInstance instance{&cloud};
  RenderOptions options;
  options.blend_space = BlendSpace::kSceneLinear;
  const ReferenceResult picture =
      renderReference({&instance, 1}, frontCamera(3, 3, 30, 4), options);
  EXPECT_NEAR(picture.colour[4 * 4], 0.75 * srgbToLinear(0.2) + 0.25 * 0.5 * srgbToLinear(0.1),
              kFloat);
}

TEST(ReferenceRender, LimitsTheHarmonicDegree) {
  CloudRecipe recipe;
  recipe.degree = 3;
  SplatCloud full = randomCloud(recipe, 4);
  SplatCloud flat = full;
  flat.sh_degree = 0;
  flat.sh.clear();
  for (size_t i = 0; i < full.size(); ++i) {
    flat.sh.insert(flat.sh.end(), &full.sh[i * 48], &full.sh[i * 48] + 3);
  }
  RenderOptions options;
  options.sh_degree_limit = 0;
  const SplatInstance a{&full}, b{&flat};
  const Camera camera = frontCamera(40, 40, 40, 3);
  EXPECT_EQ(renderReference({&a, 1}, camera, options).colour,
            renderReference({&b, 1}, camera, {}).colour);
}

TEST(ReferenceRender, SeesAnAppliedMatrixAsThePlacedObject) {
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() =
      1.7 * Eigen::AngleAxisd(1.1, Vec3d(1, 2, -0.5).normalized()).toRotationMatrix();
  matrix.topRightCorner<3, 1>() = Vec3d(0.2, 1, -0.3);
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    CloudRecipe recipe;
    recipe.count = 60;
    recipe.degree = degree;
    const SplatCloud cloud = randomCloud(recipe, 31);
    const SplatCloud moved = transformed(cloud, matrix);
    SplatInstance placed{&cloud, matrix};
    SplatInstance applied{&moved};
    const Camera camera = frontCamera(60, 50, 50, 5);
    const ReferenceResult a = renderReference({&placed, 1}, camera, {});
    const ReferenceResult b = renderReference({&applied, 1}, camera, {});
    size_t differ = 0;
    for (size_t i = 0; i < a.colour.size(); ++i)
      differ += std::abs(a.colour[i] - b.colour[i]) > 2e-5;
    // float32 rounding of the moved splats shifts colours by about 1e-6; an alpha at the very
    // threshold 1/255 may fall to the other side in a few pixels.
    EXPECT_LE(differ, 4u) << "degree " << degree;
  }
}

}  // namespace
}  // namespace stipple
