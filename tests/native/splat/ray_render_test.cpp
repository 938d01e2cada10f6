#include "splat/render/ray_render.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "math/covariance.h"
#include "splat/random_scene.h"
#include "splat/render/ray_splats.h"

// Splats along rays: closed forms of one and two splats, brute force over all of them, agreement
// with the affine projection where that is right.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::everyBuffer;
using testing::frontCamera;
using testing::instanceOf;
using testing::oneSplat;
using testing::randomCloud;

double value(const std::vector<float>& numbers, size_t i) {
  return static_cast<double>(numbers[i]);
}

/// Every splat at every pixel, without tiles.
std::vector<double> bruteForce(const SplatInstance& instance, const Camera& camera,
                               const RenderOptions& options, const RayOptions& rays) {
  const PlacedScene scene = placeScene({&instance, 1}, camera, options);
  const std::vector<RaySplat> splats = raySplats(scene, rays.limits.least_alpha);
  ReferenceResult result;
  sizeResult(camera, options, result);
  for (uint32_t y = 0; y < camera.height; ++y) {
    for (uint32_t x = 0; x < camera.width; ++x) {
      const double slope_x = (x + 0.5 - camera.cx) / camera.fx;
      const double slope_y = (y + 0.5 - camera.cy) / camera.fy;
      const bool turns = camera.model == CameraModel::kPerspective;
      const Vec3d origin = turns ? Vec3d(0, 0, 0) : Vec3d(slope_x, slope_y, 0);
      const Vec3d direction = turns ? Vec3d(slope_x, slope_y, 1) : Vec3d(0, 0, 1);
      std::vector<std::pair<double, const RaySplat*>> order;
      for (const RaySplat& splat : splats) {
        order.push_back({respond(splat, origin, direction).place, &splat});
      }
      std::stable_sort(order.begin(), order.end(),
                       [](const auto& a, const auto& b) { return a.first < b.first; });
      DoublePixel pixel(options, 0, rays.limits.ends_early);
      for (const auto& [place, splat] : order) {
        if (!(place >= camera.near_plane)) continue;
        const double distance = respond(*splat, origin, direction).squared_distance;
        const double alpha = splat->opacity * std::exp(-0.5 * distance);
        if (alpha < rays.limits.least_alpha) continue;
        if (!pixel.add(std::min(alpha, rays.limits.most_alpha), splat->colour, place, false)) break;
      }
      pixel.write(options, static_cast<size_t>(y) * camera.width + x, result);
    }
  }
  return result.colour;
}

TEST(RayRender, ARoundSplatFallsWithTheDistanceOfTheRay) {
  // 130 degrees wide, the splat far from the axis: the affine picture of it is wrong by far.
  Camera camera = frontCamera(65, 65, 65 / (2 * std::tan(65 * std::numbers::pi / 180)), 0);
  const double sigma = 0.5;
  SplatCloud cloud = oneSplat(static_cast<float>(sigma), 0.8f);
  cloud.positions = {3, 2, 0.5f};  // camera: x 3, y -0.5, z 2
  const SplatInstance instance = instanceOf(cloud);
  const Vec3d centre(3, -0.5, 2);
  const RenderResult picture = renderRays({&instance, 1}, camera, everyBuffer(), unlimitedRays());
  double affine_error = 0;
  const ReferenceResult affine = renderReference({&instance, 1}, camera, everyBuffer());
  for (uint32_t y = 0; y < 65; ++y) {
    for (uint32_t x = 0; x < 65; ++x) {
      const Vec3d ray((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy, 1);
      const double distance = crossProduct(centre, ray).norm() / ray.norm();
      const bool is_ahead = centre.dot(ray) > 0;
      const double alpha =
          is_ahead ? double{0.8f} * std::exp(-0.5 * distance * distance / (sigma * sigma)) : 0.0;
      const size_t i = (size_t{y} * 65 + x) * 4 + 3;
      // float32 of the result.
      ASSERT_NEAR(value(picture.colour, i), alpha < 1e-9 ? 0 : alpha, 6e-8) << x << ", " << y;
      affine_error = std::max(affine_error, std::abs(affine.colour[i] - alpha));
    }
  }
  EXPECT_GT(affine_error, 0.1);
}

TEST(RayRender, TilesLeaveNothingOut) {
  CloudRecipe recipe;
  recipe.size_min = 1e-4;  // needles and discs, up to 3000 to 1
  const SplatCloud cloud = randomCloud(recipe, 5);
  SplatInstance instance = instanceOf(cloud);
  instance.object_to_world << 1.1, 0.2, 0, 0.1, 0, 0.9, 0.3, 0, 0.1, 0, 1.2, 0, 0, 0, 0, 1;
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    Camera camera = frontCamera(97, 83, 60, 1.2);
    camera.model = model;
    for (const RayOptions& rays : {RayOptions{}, unlimitedRays()}) {
      const RenderResult picture =
          renderRays({&instance, 1}, camera, everyBuffer(LowPass::kClassic), rays);
      const std::vector<double> all =
          bruteForce(instance, camera, everyBuffer(LowPass::kClassic), rays);
      for (size_t i = 0; i < all.size(); ++i) {
        ASSERT_NEAR(value(picture.colour, i), all[i], 2e-7) << "value " << i;
      }
    }
  }
}

TEST(RayRender, AgreesWithTheAffinePictureOfSmallSplatsFarAway) {
  for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip}) {
    CloudRecipe recipe;
    recipe.size_min = 0.002;
    recipe.size_max = 0.01;
    const SplatCloud cloud = randomCloud(recipe, 3);
    const SplatInstance instance = instanceOf(cloud);
    const Camera camera = frontCamera(64, 64, 1500, 50);
    RayOptions rays;
    rays.order = RayOrder::kCentre;
    const RenderResult picture = renderRays({&instance, 1}, camera, everyBuffer(low_pass), rays);
    const ReferenceResult affine = renderReference({&instance, 1}, camera, everyBuffer(low_pass));
    for (size_t i = 0; i < affine.colour.size(); ++i) {
      // The affine map is off by the square of an angle of 0.03, and alphas near 1/255 may fall on
      // the other side: 4e-3 of one splat.
      ASSERT_NEAR(value(picture.colour, i), affine.colour[i], 6e-3);
    }
  }
}

TEST(RayRender, SplatsThatCrossShowBothSides) {
  // Two discs like an X seen from above: each is in front on one side.
  SplatCloud cloud;
  cloud.resize(2);
  const float turn = std::sin(0.25f * std::numbers::pi_v<float> / 2);
  const float stay = std::cos(0.25f * std::numbers::pi_v<float> / 2);
  cloud.positions = {0, 0, 0, 0, 0.01f, 0};
  cloud.rotations = {stay, 0, 0, turn, stay, 0, 0, -turn};  // about the world's z
  cloud.scales = {4, 0.01f, 4, 4, 0.01f, 4};
  cloud.opacities = {0.99f, 0.99f};
  cloud.sh = {1.7f, -1.7f, -1.7f, -1.7f, -1.7f, 1.7f};  // red and blue
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(41, 41, 40, 4);
  const RenderResult picture = renderRays({&instance, 1}, camera, everyBuffer(), RayOptions{});
  const auto redness = [&](uint32_t x) {
    const size_t i = (size_t{20} * 41 + x) * 4;
    return picture.colour[i] - picture.colour[i + 2];
  };
  EXPECT_GT(std::abs(redness(12)), 0.5f);
  EXPECT_GT(std::abs(redness(28)), 0.5f);
  EXPECT_LT(redness(12) * redness(28), 0);
  RayOptions by_centre;
  by_centre.order = RayOrder::kCentre;
  const RenderResult popping = renderRays({&instance, 1}, camera, everyBuffer(), by_centre);
  const auto flat = [&](uint32_t x) {
    const size_t i = (size_t{20} * 41 + x) * 4;
    return popping.colour[i] - popping.colour[i + 2];
  };
  EXPECT_GT(flat(12) * flat(28), 0);
}

TEST(RayRender, WhitensWhatAnyMatrixMakesOfASplat) {
  CloudRecipe recipe;
  recipe.count = 50;
  const SplatCloud cloud = randomCloud(recipe, 8);
  SplatInstance instance = instanceOf(cloud);
  instance.object_to_world << 2, 0.5, 0, 0, 0, 1, 0.7, 0, 0.2, 0, -0.5, 0, 0, 0, 0, 1;
  const Camera camera = frontCamera(32, 32, 20, 8);
  const PlacedScene scene = placeScene({&instance, 1}, camera, everyBuffer());
  const std::vector<RaySplat> splats = raySplats(scene, 1e-9);
  ASSERT_EQ(splats.size(), 50u);
  for (const RaySplat& splat : splats) {
    double best = 1e300;
    for (size_t i = 0; i < 50; ++i) {
      const Mat3d axes = scene.clouds[0].linear *
                         scaledAxes<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]);
      const Mat3d whitened = splat.whiten * axes * axes.transpose() * splat.whiten.transpose();
      best = std::min(best, (whitened - Mat3d::Identity()).cwiseAbs().maxCoeff());
    }
    // The covariance is of up to 3600 to 1 in lengths, its square is formed here.
    EXPECT_LT(best, 1e-7);
  }
}

TEST(RayRender, UnlimitedRaysHaveNoLimits) {
  SplatCloud cloud = oneSplat(0.5f, 1.0f);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(9, 9, 20, 3);
  const size_t centre = 4 * 9 + 4;
  const RenderResult one = renderRays({&instance, 1}, camera, everyBuffer(), unlimitedRays());
  EXPECT_EQ(one.transmittance[centre], 0);
  EXPECT_NEAR(value(renderRays({&instance, 1}, camera, everyBuffer(), {}).transmittance, centre),
              0.01, 1e-8);
  // A thousand layers of alpha 0.5 hide all but 2^-1000; ended early, 1e-4 at most is left.
  cloud.resize(1000);
  for (size_t i = 0; i < 1000; ++i) {
    cloud.positions[i * 3 + 1] = 0.001f * static_cast<float>(i);
    cloud.rotations[i * 4] = 1;
    std::fill_n(&cloud.scales[i * 3], 3, 10.0f);
    cloud.opacities[i] = 0.5f;
    std::fill_n(&cloud.sh[i * 3], 3, 1.0f);
  }
  const RenderResult unlimited = renderRays({&instance, 1}, camera, everyBuffer(), unlimitedRays());
  EXPECT_EQ(unlimited.counts[centre], 1000u);
  EXPECT_LT(renderRays({&instance, 1}, camera, everyBuffer(), {}).counts[centre], 20u);
}

TEST(RayRender, GivesTheSameForAnyNumberOfThreads) {
  const SplatCloud cloud = randomCloud({}, 4);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(150, 130, 120, 2);
  RenderResult one, two;
  withThreads(1, [&] { one = renderRays({&instance, 1}, camera, everyBuffer(), {}); });
  withThreads(2, [&] { two = renderRays({&instance, 1}, camera, everyBuffer(), {}); });
  EXPECT_EQ(one.colour, two.colour);
  EXPECT_EQ(one.depth, two.depth);
}

TEST(RayRender, HoldoutsAndSurfacesHideWhatIsBehindThem) {
  const SplatCloud near_cloud = oneSplat(0.3f, 0.9f), far_cloud = oneSplat(2.0f, 0.9f);
  SplatInstance instances[2] = {instanceOf(near_cloud), instanceOf(far_cloud)};
  instances[0].holdout = true;
  instances[1].object_to_world(1, 3) = 2;
  const Camera camera = frontCamera(9, 9, 20, 3);
  const size_t centre = 4 * 9 + 4;
  const RenderResult held = renderRays(instances, camera, everyBuffer(), {});
  // 0.9 of what is behind is hidden.
  EXPECT_NEAR(value(held.colour, centre * 4 + 3), 0.1 * 0.9, 1e-6);
  RenderOptions options = everyBuffer();
  const std::vector<float> depth(81, 4.0f);
  options.surface.width = options.surface.height = 9;
  options.surface.depth = depth.data();
  EXPECT_EQ(renderRays(instances, camera, options, {}).colour[centre * 4 + 3], 0);
}

}  // namespace
}  // namespace stipple
