#include "splat/cpu/back_projector.h"

#include <gtest/gtest.h>

#include <cmath>

#include "splat/backward_cases.h"
#include "splat/projection_backward_matrices.h"
#include "splat/render/blend_backward.h"

// Derivatives of single splats: every instruction set must give the bits of the scalar code, and
// that the numbers of the same derivation in another notation and long double.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::randomCloud;
using testing::randomWeights;

struct Taken {
  SplatGradients gradients;
  std::vector<double> means;
  std::array<double, 6> camera{};
};

/// Sums of some size and sign for every row.
std::vector<float> someSums(size_t rows, size_t fields) {
  return randomWeights(rows * fields, 31);
}

std::vector<uint32_t> visibleRows(const PlacedScene& scene, const PlacedCloud& placed) {
  std::vector<uint32_t> rows;
  for (size_t row = 0; row < placed.cloud->size(); ++row) {
    Projected<double> projected;
    if (projectSplat(scene, placed, row, projected)) rows.push_back(static_cast<uint32_t>(row));
  }
  return rows;
}

Taken takeBack(BackProjector project, const PlacedScene& scene, const std::vector<uint32_t>& rows,
               const std::vector<float>& sums, bool with_depth) {
  const SplatCloud& cloud = *scene.clouds[0].cloud;
  Taken taken;
  taken.gradients.positions.resize(cloud.positions.size());
  taken.gradients.rotations.resize(cloud.rotations.size());
  taken.gradients.scales.resize(cloud.scales.size());
  taken.gradients.opacities.resize(cloud.size());
  taken.gradients.sh.resize(cloud.sh.size(), -1.0f);
  taken.means.resize(rows.size() * 2);
  SummedRows all{rows.data(), rows.data(), rows.size(), sums.data(), sums.size() / cloud.size(),
                 {}};
  if (with_depth) all.depth_field = all.stride - 1;
  project(scene, scene.clouds[0], all, taken.gradients, taken.means.data(), taken.camera.data());
  return taken;
}

struct Case {
  CameraModel model;
  LowPass low_pass;
  int degree;
  int degree_limit;
  BlendSpace space;
  ColourGrade grade = {};
};

/// With entries of either sign, and another opacity.
const ColourGrade kGrade = {
    {0.9, 0.2, -0.1, 0.05, 1.3, -0.2, -0.15, 0.3, 0.7}, {0.05, -0.02, 0.1}, 0.75};

const Case kCases[] = {
    {CameraModel::kPerspective, LowPass::kClassic, 0, 4, BlendSpace::kAsTrained},
    {CameraModel::kPerspective, LowPass::kMip, 1, 4, BlendSpace::kSceneLinear},
    {CameraModel::kPerspective, LowPass::kNone, 2, 4, BlendSpace::kAsTrained},
    {CameraModel::kPerspective, LowPass::kClassic, 4, 2, BlendSpace::kAsTrained},
    {CameraModel::kOrthographic, LowPass::kMip, 3, 4, BlendSpace::kAsTrained},
    {CameraModel::kOrthographic, LowPass::kNone, 4, 4, BlendSpace::kSceneLinear},
    {CameraModel::kPerspective, LowPass::kMip, 0, 4, BlendSpace::kAsTrained, kGrade},
    {CameraModel::kPerspective, LowPass::kClassic, 3, 4, BlendSpace::kSceneLinear, kGrade}};

SplatCloud cloudFor(const Case& c) {
  CloudRecipe recipe;
  recipe.count = 203;  // not a whole number of any vector
  recipe.degree = c.degree;
  return randomCloud(recipe, 40);
}

PlacedScene sceneFor(const Case& c, const SplatCloud& cloud) {
  SplatInstance instance{&cloud};
  instance.grade = c.grade;
  instance.object_to_world.topLeftCorner<3, 3>() << 0.7, 0.2, -0.3, 0.1, -0.9, 0.2, 0.3, 0.1, 0.6;
  Camera camera = frontCamera(40, 30, 30, 3);
  camera.model = c.model;
  if (c.model == CameraModel::kOrthographic) camera.fx = camera.fy = 12;
  RenderOptions options;
  options.low_pass = c.low_pass;
  options.sh_degree_limit = c.degree_limit;
  options.blend_space = c.space;
  return placeScene({&instance, 1}, camera, options);
}

TEST(BackProjector, GivesTheSameBitsOnEveryTarget) {
  for (const Case& c : kCases) {
    const SplatCloud cloud = cloudFor(c);
    const PlacedScene scene = sceneFor(c, cloud);
    const std::vector<uint32_t> rows = visibleRows(scene, scene.clouds[0]);
    ASSERT_GT(rows.size(), 100u);
    const std::vector<float> sums = someSums(cloud.size(), kGradientFieldCount + 1);
    const Taken expected = takeBack(takeBackScalar, scene, rows, sums, true);
    ASSERT_GE(backProjectors().size(), 2u);
    for (const NamedBackProjector& named : backProjectors()) {
      SCOPED_TRACE(::testing::Message() << named.target << " degree " << c.degree);
      const Taken seen = takeBack(named.take_back, scene, rows, sums, true);
      EXPECT_EQ(seen.gradients.positions, expected.gradients.positions);
      EXPECT_EQ(seen.gradients.rotations, expected.gradients.rotations);
      EXPECT_EQ(seen.gradients.scales, expected.gradients.scales);
      EXPECT_EQ(seen.gradients.opacities, expected.gradients.opacities);
      EXPECT_EQ(seen.gradients.sh, expected.gradients.sh);
      EXPECT_EQ(seen.means, expected.means);
      EXPECT_EQ(seen.camera, expected.camera);
    }
  }
}

TEST(BackProjector, GivesTheNumbersOfMatricesInLongDouble) {
  for (const Case& c : kCases) {
    SCOPED_TRACE(c.degree);
    const SplatCloud cloud = cloudFor(c);
    const PlacedScene scene = sceneFor(c, cloud);
    const PlacedCloud& placed = scene.clouds[0];
    const std::vector<uint32_t> rows = visibleRows(scene, placed);
    const size_t fields = kGradientFieldCount + 1;
    const std::vector<float> sums = someSums(cloud.size(), fields);
    const Taken seen = takeBack(takeBackScalar, scene, rows, sums, true);
    const double scale = std::sqrt(kSquaredGScale);
    const std::vector<double> wide(sums.begin(), sums.end());
    for (size_t n = 0; n < rows.size(); ++n) {
      const size_t i = rows[n];
      const double* sum = &wide[i * fields];
      testing::FootprintMatrices by;
      by.s = sum[kFieldS];
      by.first = scale * Vec2d(sum[kFieldG0], sum[kFieldG1]);
      by.second << sum[kFieldG00], sum[kFieldG01], sum[kFieldG01], sum[kFieldG11];
      by.second *= kSquaredGScale;
      by.depth = sum[fields - 1];
      const testing::ProjectionVectors expected = testing::projectBackward(
          scene.view, placed.linear, placed.translation, &cloud.positions[i * 3],
          &cloud.rotations[i * 4], &cloud.scales[i * 3], static_cast<float>(placed.opacity(i)),
          placed.low_pass, by);
      std::vector<float> by_sh(cloud.shStride(), 0.0f);
      const Vec3d by_direction =
          testing::splatColourBackward(scene, placed, i, sum + kFieldRed, by_sh.data());
      const bool perspective = scene.view.perspective;
      // Stored in float32, one unit of which is up to 1.2e-7; double loses less than 1e-9 to any of
      // these shapes.
      const auto near = [](float a, double b, double size) {
        EXPECT_NEAR(static_cast<double>(a), b, 2e-7 * std::abs(b) + 1e-9 * size);
      };
      const Vec3d position = expected.position + (perspective ? by_direction : Vec3d::Zero());
      for (size_t k = 0; k < 3; ++k) {
        const int axis = static_cast<int>(k);
        near(seen.gradients.positions[i * 3 + k], position[axis], position.norm());
        near(seen.gradients.scales[i * 3 + k], expected.scales[axis], expected.scales.norm());
      }
      for (size_t k = 0; k < 4; ++k) {
        near(seen.gradients.rotations[i * 4 + k], expected.rotation[static_cast<int>(k)],
             expected.rotation.norm());
      }
      near(seen.gradients.opacities[i], expected.opacity * placed.grade.opacity, 1.0);
      EXPECT_NEAR(seen.means[n * 2], expected.mean[0], 1e-9 * expected.mean.norm());
      EXPECT_NEAR(seen.means[n * 2 + 1], expected.mean[1], 1e-9 * expected.mean.norm());
      for (size_t k = 0; k < by_sh.size(); ++k) {
        // A product of two float32 numbers: three roundings, and one of the other.
        EXPECT_NEAR(seen.gradients.sh[i * by_sh.size() + k], by_sh[k],
                    3e-7f * std::abs(by_sh[k]) + 1e-9f);
      }
    }
  }
}

TEST(BackProjector, KeepsTheDigitsOfNeedles) {
  // A needle of 1 : 1e6 turns a picture's pixels by its length: what turning changes is a millionth
  // of the terms that make it up.
  CloudRecipe recipe;
  recipe.count = 200;
  SplatCloud cloud = randomCloud(recipe, 41);
  for (size_t i = 0; i < cloud.size(); ++i) {
    cloud.scales[i * 3] = 1e6f;
    cloud.scales[i * 3 + 1] = cloud.scales[i * 3 + 2] = 1.0f;
  }
  const SplatInstance instance{&cloud};
  const PlacedScene scene = placeScene({&instance, 1}, frontCamera(43, 31, 30, 3), {});
  const PlacedCloud& placed = scene.clouds[0];
  const std::vector<uint32_t> rows = visibleRows(scene, placed);
  ASSERT_GT(rows.size(), 100u);
  std::vector<float> sums(cloud.size() * kGradientFieldCount, 0.0f);
  // What a needle's pixels give: offsets along it are a millionth of those across.
  for (size_t i = 0; i < cloud.size(); ++i) {
    float* sum = &sums[i * kGradientFieldCount];
    sum[kFieldS] = sum[kFieldG1] = sum[kFieldG11] = 1.0f;
    sum[kFieldG0] = sum[kFieldG01] = 0x1p-20f;
    sum[kFieldG00] = 0x1p-40f;
  }
  const Taken seen = takeBack(takeBackScalar, scene, rows, sums, false);
  for (const uint32_t i : rows) {
    testing::FootprintMatrices by{1.0, std::sqrt(kSquaredGScale) * Vec2d(0x1p-20, 1.0),
                                  Eigen::Matrix2d::Zero(), 0.0};
    by.second << 0x1p-40, 0x1p-20, 0x1p-20, 1.0;
    by.second *= kSquaredGScale;
    const Vec4d expected =
        testing::projectBackward(scene.view, placed.linear, placed.translation,
                                 &cloud.positions[i * 3], &cloud.rotations[i * 4],
                                 &cloud.scales[i * 3], cloud.opacities[i], placed.low_pass, by)
            .rotation;
    for (size_t k = 0; k < 4; ++k) {
      // Long double loses 5e-20 times the ratio squared, 5e-8, of the length; double, with rows
      // made orthogonal twice, 1e-16 times the ratio times the length over the width: 1e-4 at
      // worst.
      EXPECT_NEAR(static_cast<double>(seen.gradients.rotations[i * 4 + k]),
                  expected[static_cast<int>(k)], 1e-4 * expected.norm());
    }
  }
}

}  // namespace
}  // namespace stipple
