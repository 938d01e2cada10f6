#include <gtest/gtest.h>

#include "base/error.h"
#include "splat/cpu/projector.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/edit/cloud_merge.h"
#include "splat/random_scene.h"
#include "splat/voxels/voxelize.h"

// A graded instance must look like the cloud with the grade in its harmonics.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::randomCloud;

ColourGrade someGrade(ColourSpace space) {
  GradeSettings settings;
  settings.exposure = 0.6;
  settings.tint = {1.0, 0.7, 0.45};
  settings.saturation = 1.3;
  settings.opacity = 0.6;
  return gradeOf(settings, space);
}

SplatCloud cloudOf(int degree, ColourSpace space) {
  CloudRecipe recipe;
  recipe.degree = degree;
  recipe.colour_space = space;
  return randomCloud(recipe, 70 + static_cast<uint32_t>(degree));
}

TEST(GradedRender, EqualsTheCloudWithTheGradeInItsHarmonics) {
  const Camera camera = frontCamera(61, 47, 50, 3);
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    for (const BlendSpace blend : {BlendSpace::kAsTrained, BlendSpace::kSceneLinear}) {
      const ColourSpace space = degree == 2 ? ColourSpace::kLinear : ColourSpace::kDisplay;
      const SplatCloud cloud = cloudOf(degree, space);
      SplatCloud baked = cloud;
      bakeGrade(baked, someGrade(space));
      const SplatInstance graded{&cloud, Mat4d::Identity(), false, someGrade(space)};
      const SplatInstance plain{&baked};
      RenderOptions options;
      options.blend_space = blend;
      const ReferenceResult a = renderReference({&graded, 1}, camera, options);
      const ReferenceResult b = renderReference({&plain, 1}, camera, options);
      for (size_t i = 0; i < a.colour.size(); ++i) {
        // Baking rounds each coefficient and opacity once, 6e-8 of about 2; up to 25 are added, and
        // a few splats blended. A pixel at which rounding moves a splat over 1/255 does not occur.
        ASSERT_NEAR(a.colour[i], b.colour[i], 2e-6) << degree;
      }
      const RenderResult tiled = renderTiled({&graded, 1}, camera, options);
      // As for ungraded clouds (tiled_render_test.cpp).
      EXPECT_LT(testing::compare(tiled, a).colour, 1e-4);
    }
  }
}

TEST(GradedRender, ChangesNothingWhereTheGradeIsNeutral) {
  const SplatCloud cloud = cloudOf(3, ColourSpace::kDisplay);
  const SplatInstance plain{&cloud};
  const SplatInstance graded{&cloud, Mat4d::Identity(), false, gradeOf({}, ColourSpace::kDisplay)};
  const Camera camera = frontCamera(61, 47, 50, 3);
  EXPECT_EQ(renderTiled({&plain, 1}, camera, {}).colour,
            renderTiled({&graded, 1}, camera, {}).colour);
}

TEST(GradedRender, GivesTheSameBitsOnEveryTarget) {
  const SplatCloud cloud = cloudOf(3, ColourSpace::kDisplay);
  const SplatInstance graded{&cloud, Mat4d::Identity(), false, someGrade(ColourSpace::kDisplay)};
  const Camera camera = frontCamera(61, 47, 50, 3);
  const PlacedScene scene = placeScene({&graded, 1}, camera, {});
  struct Slots {
    std::vector<VisibleSplat> splats;
    std::vector<VisibleExtra> extras;
    std::vector<DepthItem> items;
    std::vector<TileSpan> spans;
  };
  const auto project = [&](Projector projector) {
    Slots slots{std::vector<VisibleSplat>(cloud.size()), std::vector<VisibleExtra>(cloud.size()),
                std::vector<DepthItem>(cloud.size()), std::vector<TileSpan>(cloud.size())};
    const size_t count = projector(
        scene, scene.clouds[0], 0, cloud.size(),
        {slots.splats.data(), slots.extras.data(), slots.items.data(), slots.spans.data()}, 0);
    slots.splats.resize(count);
    slots.extras.resize(count);
    return slots;
  };
  const Slots expected = project(projectScalar);
  ASSERT_GT(expected.splats.size(), 100u);
  for (const NamedProjector& named : projectors()) {
    const Slots seen = project(named.project);
    ASSERT_EQ(seen.splats.size(), expected.splats.size()) << named.target;
    for (size_t i = 0; i < seen.splats.size(); ++i) {
      EXPECT_EQ(seen.extras[i].opacity, expected.extras[i].opacity);
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_EQ(seen.splats[i].colour[c], expected.splats[i].colour[c]) << named.target;
      }
    }
  }
}

TEST(GradedRender, ShowsNothingAtOpacityZero) {
  const SplatCloud cloud = cloudOf(1, ColourSpace::kDisplay);
  SplatInstance faded{&cloud};
  faded.grade.opacity = 0;
  EXPECT_EQ(renderTiled({&faded, 1}, frontCamera(20, 20, 20, 3), {}).visible_count, 0u);
}

TEST(GradedRender, GradesOneObjectOfTwo) {
  const SplatCloud cloud = cloudOf(1, ColourSpace::kDisplay);
  std::vector<SplatInstance> instances(2);
  instances[0].cloud = instances[1].cloud = &cloud;
  instances[1].object_to_world(0, 3) = 2.5;
  instances[1].grade = someGrade(ColourSpace::kDisplay);
  const Camera camera = frontCamera(61, 47, 30, 5);
  const RenderResult both = renderTiled(instances, camera, {});
  SplatCloud baked = cloud;
  bakeGrade(baked, instances[1].grade);
  instances[1].cloud = &baked;
  instances[1].grade = {};
  const RenderResult expected = renderTiled(instances, camera, {});
  for (size_t i = 0; i < both.colour.size(); ++i) {
    EXPECT_NEAR(both.colour[i], expected.colour[i], 1e-5f);
  }
}

TEST(GradedRender, IsBakedByMerging) {
  const SplatCloud cloud = cloudOf(2, ColourSpace::kDisplay);
  const SplatInstance graded{&cloud, Mat4d::Identity(), false, someGrade(ColourSpace::kDisplay)};
  SplatCloud baked = cloud;
  bakeGrade(baked, graded.grade);
  const SplatCloud joined = merged({&graded, 1}, Frame::kUnknown);
  EXPECT_EQ(joined.sh, baked.sh);
  EXPECT_EQ(joined.opacities, baked.opacities);
}

TEST(GradedRender, GoesIntoVolumes) {
  const SplatCloud cloud = cloudOf(1, ColourSpace::kDisplay);
  const SplatInstance graded{&cloud, Mat4d::Identity(), false, someGrade(ColourSpace::kDisplay)};
  SplatCloud baked = cloud;
  bakeGrade(baked, graded.grade);
  const SplatInstance plain{&baked};
  VoxelizeOptions options;
  options.resolution = 24;
  const SparseVolume a = voxelize({&graded, 1}, options);
  const SparseVolume b = voxelize({&plain, 1}, options);
  ASSERT_EQ(a.bricks, b.bricks);
  for (size_t i = 0; i < a.density.size(); ++i) {
    // One rounding of the opacity, 6e-8, through Li_1/2, whose relative slope is at most 1/(1 -
    // o)^.5 = 10 at 0.99; a density at the threshold of what is stored may be there in one only.
    if (a.density[i] > 0 && b.density[i] > 0) {
      EXPECT_NEAR(a.density[i], b.density[i], 1e-5f * b.density[i]);
    } else {
      EXPECT_LT(a.density[i] + b.density[i], 0.0011f);
    }
  }
  for (size_t i = 0; i < a.colour.size(); ++i) EXPECT_NEAR(a.colour[i], b.colour[i], 1e-5f);
}

TEST(GradedRender, RefusesGradesOutsideTheirRange) {
  const SplatCloud cloud = cloudOf(0, ColourSpace::kDisplay);
  SplatInstance graded{&cloud};
  graded.grade.opacity = 2;
  const Camera camera = frontCamera(20, 20, 20, 3);
  EXPECT_THROW(renderTiled({&graded, 1}, camera, {}), Error);
  EXPECT_THROW(renderReference({&graded, 1}, camera, {}), Error);
  EXPECT_THROW(voxelize({&graded, 1}, {}), Error);
}

}  // namespace
}  // namespace stipple
