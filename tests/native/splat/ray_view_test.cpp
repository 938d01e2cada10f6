#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "math/cross_product.h"
#include "splat/cpu/rays/affine_splats.h"
#include "splat/random_scene.h"
#include "splat/render/ray_splats.h"

// What lies beyond the borders of a picture is left out before anything is made of it, and counted
// before there is memory for it: nothing that shows may be among it.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::instanceOf;
using testing::randomCloud;

constexpr double kLeast = 1.0 / 255;

Camera offCentre(CameraModel model) {
  Camera camera = frontCamera(97, 61, model == CameraModel::kOrthographic ? 40 : 70, 1.2);
  camera.model = model;
  camera.cx = 20;
  camera.cy = 55;
  return camera;
}

/// Distance of a sphere's centre to the nearest ray through the borders' inside, in metres.
double nearestRay(const View<double>& view, const Vec3d& centre) {
  double nearest = 1e300;
  for (int y = 0; y <= 61; ++y) {
    for (int x = 0; x <= 97; ++x) {
      const Vec3d at((x - view.cx) / view.fx, (y - view.cy) / view.fy, 1);
      const Vec3d direction = view.perspective ? at.normalized() : Vec3d(0, 0, 1);
      const Vec3d origin = view.perspective ? Vec3d(0, 0, 0) : Vec3d(at[0], at[1], 0);
      nearest = std::min(nearest, crossProduct(centre - origin, direction).norm());
    }
  }
  return nearest;
}

TEST(ViewSides, LeaveOutOnlyWhatNoRayMeets) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    const View<double> view = makeView<double>(offCentre(model));
    const ViewSides sides(view);
    size_t left_out = 0;
    for (int i = 0; i < 300; ++i) {
      const Vec3d centre(3 * uniform(random), 3 * uniform(random), 1.5 + uniform(random));
      const double radius = 0.5 * std::abs(uniform(random));
      if (sides.touch(centre, radius)) continue;
      ++left_out;
      EXPECT_GT(nearestRay(view, centre), radius) << i;
    }
    EXPECT_GT(left_out, 100u);
    EXPECT_LT(left_out, 290u);
  }
}

TEST(MostRaySplats, IsNeverBelowWhatIsFoundAndLeavesOutMuchOfTheRest) {
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    for (const Antialias antialias : {Antialias::kClassic, Antialias::kMip}) {
      for (const bool is_sheared : {false, true}) {
        CloudRecipe recipe;
        recipe.count = 5000;
        recipe.size_max = 0.1;
        recipe.antialias = antialias;
        const SplatCloud cloud = randomCloud(recipe, 5);
        SplatInstance instance{&cloud};
        instance.object_to_world.topLeftCorner<3, 3>() *= 1.5;
        if (is_sheared) instance.object_to_world(0, 2) = 0.7;
        // From the middle of the cloud: half of it is behind, and much beyond the borders.
        Camera camera = offCentre(model);
        camera.world_to_camera(2, 3) = 0;
        const PlacedScene scene = placeScene({&instance, 1}, camera, {});
        const uint64_t rays = mostRaySplats(scene, kLeast, false);
        const uint64_t affine = mostRaySplats(scene, kLeast, true);
        EXPECT_GE(rays, raySplats(scene, kLeast).size());
        EXPECT_GE(affine, affineSplats(scene, kLeast).size());
        EXPECT_LT(rays, cloud.size() * 6 / 10);
        EXPECT_LT(affine, cloud.size() * 6 / 10);
        EXPECT_GT(raySplats(scene, kLeast).size(), 100u);
        // What no image can show is not counted.
        EXPECT_EQ(mostRaySplats(scene, 2.0, false), 0u);
      }
    }
  }
}

}  // namespace
}  // namespace stipple
