#include "splat/cpu/rays/ray_tiles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <tuple>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/random_scene.h"
#include "splat/render/accurate_render.h"

// Rays in single precision, judged against the same rays in double, on every instruction set; and
// the affine picture with its depth behind each pixel, judged against the reference.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::instanceOf;
using testing::oneSplat;
using testing::randomCloud;

double largestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0;
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  }
  return largest;
}

/// Alpha is off by at most 2e-4 of itself where a needle uses up float32, and by 3e-6 in pictures
/// of many; what is measured here is below that.
constexpr double kTolerance = 2e-5;

void expectAsInDouble(const SplatInstance& instance, const Camera& camera,
                      const RenderOptions& options, const RayOptions& rays,
                      const std::string& what) {
  const RenderResult expected = renderRays({&instance, 1}, camera, options, rays);
  for (const NamedRayTileKernel& named : rayTileKernels()) {
    const RenderResult made =
        renderRayTilesWith(named.kernel, {&instance, 1}, camera, options, rays);
    EXPECT_LT(largestDifference(made.colour, expected.colour), kTolerance) << what << named.target;
    EXPECT_LT(largestDifference(made.transmittance, expected.transmittance), kTolerance)
        << what << named.target;
    // Metres, at a distance of 2 to 4.
    EXPECT_LT(largestDifference(made.depth, expected.depth), 1e-4) << what << named.target;
    EXPECT_EQ(made.visible_count, expected.visible_count);
  }
}

class RayTilesOf
    : public ::testing::TestWithParam<std::tuple<RayProjection, RayOrder, CameraModel>> {};

TEST_P(RayTilesOf, DrawWhatDoubleDraws) {
  const auto [projection, order, model] = GetParam();
  Camera camera = frontCamera(120, 90, 60, 1.5);  // the cloud reaches behind the camera
  camera.model = model;
  if (model == CameraModel::kOrthographic) camera.fx = camera.fy = 40;
  for (const double thinnest : {0.005, 1e-6}) {  // needles up to 300,000 to 1
    CloudRecipe recipe;
    recipe.count = 300;
    recipe.degree = 1;
    recipe.size_min = thinnest;
    const SplatCloud cloud = randomCloud(recipe, 7);
    SplatInstance instance = instanceOf(cloud);
    instance.object_to_world << 1.1, 0.2, 0, 0.1, 0, 0.9, 0.3, 0, 0.1, 0, 1.2, 0, 0, 0, 0, 1;
    for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
      for (const double least_alpha : {1 / 255.0, 1e-6, 0.2}) {
        RenderOptions options;
        options.low_pass = low_pass;
        options.with_transmittance = true;
        RayOptions rays;
        rays.projection = projection;
        rays.order = order;
        rays.limits.least_alpha = least_alpha;
        expectAsInDouble(instance, camera, options, rays,
                         "low-pass " + std::to_string(static_cast<int>(low_pass)) + ", cut-off " +
                             std::to_string(least_alpha) + ", ");
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    EveryKind, RayTilesOf,
    ::testing::Combine(::testing::Values(RayProjection::kRay, RayProjection::kAffine),
                       ::testing::Values(RayOrder::kResponse, RayOrder::kCentre),
                       ::testing::Values(CameraModel::kPerspective, CameraModel::kOrthographic)));

TEST(RayTiles, NoLimitsDrawUnlimitedRays) {
  CloudRecipe recipe;
  recipe.count = 200;
  const SplatCloud cloud = randomCloud(recipe, 11);
  const SplatInstance instance = instanceOf(cloud);
  RenderOptions options;
  options.with_transmittance = true;
  expectAsInDouble(instance, frontCamera(70, 50, 40, 2), options, unlimitedRays(), "unlimited, ");
}

TEST(RayTiles, ANeedleSeenEndOnIsExact) {
  // Along the view to 1e-7 radians: the whitened ray is shortest just there.
  SplatCloud cloud = oneSplat(1e-6f, 0.9f);
  cloud.scales = {1e-6f, 1.0f, 1e-6f};
  const SplatInstance instance = instanceOf(cloud);
  RenderOptions options;
  options.low_pass = LowPass::kNone;
  options.with_transmittance = true;
  Camera camera = frontCamera(32, 32, 2e6, 2);  // a pixel is the needle's width
  expectAsInDouble(instance, camera, options, RayOptions{}, "end-on, ");
}

TEST(RayTiles, CoplanarDiscsKeepTheOrderOfDouble) {
  // All places are equal but for rounding: float32 alone would mix the colours pixel by pixel.
  SplatCloud cloud;
  cloud.resize(3);
  for (size_t i = 0; i < 3; ++i) {
    cloud.positions[i * 3] = 0.1f * static_cast<float>(i);
    cloud.positions[i * 3 + 1] = 0.05f * static_cast<float>(i);  // depth, along the tilted plane
    cloud.positions[i * 3 + 2] = 0;
    const float half_angle = 0.5f * std::atan2(0.05f, 0.1f);
    const float rotation[4] = {std::cos(half_angle), 0, 0, std::sin(half_angle)};
    std::copy(rotation, rotation + 4, &cloud.rotations[i * 4]);
    const float scales[3] = {0.3f, 1e-5f, 0.3f};
    std::copy(scales, scales + 3, &cloud.scales[i * 3]);
    cloud.opacities[i] = 0.9f;
    for (size_t c = 0; c < 3; ++c) cloud.sh[i * 3 + c] = c == i ? 1.7f : -1.7f;
  }
  const SplatInstance instance = instanceOf(cloud);
  RenderOptions options;
  options.with_transmittance = true;
  expectAsInDouble(instance, frontCamera(64, 48, 60, 3), options, RayOptions{}, "coplanar, ");
}

TEST(RayTiles, SurfacesAndHoldoutsAreThoseOfDouble) {
  CloudRecipe recipe;
  recipe.count = 150;
  const SplatCloud cloud = randomCloud(recipe, 5), other = randomCloud(recipe, 6);
  SplatInstance instances[2] = {instanceOf(cloud), instanceOf(other)};
  instances[1].holdout = true;
  const Camera camera = frontCamera(50, 40, 40, 2.5);
  std::vector<float> depth(50 * 40, 2.4f), colour(50 * 40 * 4, 0.5f);
  RenderOptions options;
  options.surface = {50, 40, depth.data(), colour.data(), nullptr};
  options.with_median_depth = options.with_counts = true;
  for (const RayOrder order : {RayOrder::kResponse, RayOrder::kCentre}) {
    RayOptions rays;
    rays.order = order;
    const RenderResult made = renderRayTiles(instances, camera, options, rays);
    const RenderResult expected = renderRays(instances, camera, options, rays);
    EXPECT_LT(largestDifference(made.colour, expected.colour), kTolerance);
    EXPECT_LT(largestDifference(made.depth, expected.depth), 1e-4);
    EXPECT_LT(largestDifference(made.median_depth, expected.median_depth), 1e-4);
    EXPECT_EQ(made.counts, expected.counts);
  }
}

TEST(RayTiles, SameBitsForAnyNumberOfThreads) {
  const SplatCloud cloud = randomCloud({}, 3);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(150, 100, 90, 2);
  RenderResult one, four;
  withThreads(1, [&] { one = renderRayTiles({&instance, 1}, camera, {}, {}); });
  withThreads(4, [&] { four = renderRayTiles({&instance, 1}, camera, {}, {}); });
  EXPECT_EQ(one.colour, four.colour);
  EXPECT_EQ(one.depth, four.depth);
}

TEST(RayTiles, NothingIsDrawnOfNothing) {
  const SplatCloud empty;
  const SplatInstance instance = instanceOf(empty);
  const RenderResult made = renderRayTiles({&instance, 1}, frontCamera(20, 10, 10, 2), {}, {});
  EXPECT_EQ(*std::max_element(made.colour.begin(), made.colour.end()), 0.0f);
  RayOptions rays;
  const PixelArea area = {0, 0, 64, 64};
  rays.areas = {&area, 1};
  EXPECT_THROW(renderRayTiles({&instance, 1}, frontCamera(20, 10, 10, 2), {}, rays), Error);
}

TEST(AffineDepth, IsThatOfThePlaneWhereADiscIsFlat) {
  // A disc tilted by 45 degrees, far away and small: behind a pixel it is where its plane is.
  SplatCloud cloud = oneSplat(1.0f, 0.95f);
  const float eighth = static_cast<float>(std::numbers::pi / 8);
  cloud.rotations = {std::cos(eighth), 0, 0, std::sin(eighth)};  // about the picture's vertical
  cloud.scales = {1.0f, 1e-4f, 1.0f};
  const SplatInstance instance = instanceOf(cloud);
  const double distance = 1000;
  const Camera camera = frontCamera(41, 41, 8000, distance);
  RenderOptions options;
  options.low_pass = LowPass::kNone;
  RayOptions rays;
  rays.projection = RayProjection::kAffine;
  const RenderResult made = renderRays({&instance, 1}, camera, options, rays);
  for (uint32_t x = 14; x < 27; ++x) {
    // World x of the pixel; the plane's depth grows with it.
    const double across = (x + 0.5 - camera.cx) * distance / 8000;
    // The picture's rays are parallel to 1e-3 of a metre here; float32 of 1000 is 6e-5.
    EXPECT_NEAR(static_cast<double>(made.depth[20 * 41 + x]), distance + across, 3e-3) << x;
  }
}

TEST(AccurateRender, DoubleAffineIsTheReference) {
  const SplatCloud cloud = randomCloud({}, 9);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(60, 45, 50, 2);
  RenderAccuracy accuracy;
  accuracy.precision = Precision::kDouble;
  RenderWorkspace workspace;
  RenderResult made;
  renderAccurate({&instance, 1}, camera, {}, accuracy, workspace, made);
  const ReferenceResult expected = renderReference({&instance, 1}, camera, {});
  double largest = 0;
  for (size_t i = 0; i < made.colour.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(made.colour[i]) - expected.colour[i]));
  }
  EXPECT_LT(largest, 1.2e-7);  // both are double; float32 of the result
}

TEST(AccurateRender, AveragesASurfaceWithItsSamples) {
  const SplatCloud cloud = randomCloud({}, 9);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(20, 16, 15, 2);
  std::vector<float> depth(20 * 16, 2.0f), colour(20 * 16 * 4, 0.25f);
  RenderOptions options;
  options.surface = {20, 16, depth.data(), colour.data(), nullptr};
  options.with_median_depth = options.with_counts = options.with_transmittance = true;
  RenderAccuracy accuracy;
  accuracy.samples_per_side = 2;
  RenderWorkspace workspace;
  RenderResult made;
  renderAccurate({&instance, 1}, camera, options, accuracy, workspace, made);
  // The same by hand: a camera of twice the size, and the surface's pixels doubled.
  const Camera large = frontCamera(40, 32, 30, 2);
  std::vector<float> large_depth(40 * 32, 2.0f), large_colour(40 * 32 * 4, 0.25f);
  RenderOptions large_options = options;
  large_options.surface = {40, 32, large_depth.data(), large_colour.data(), nullptr};
  const RenderResult all = renderTiled({&instance, 1}, large, large_options);
  for (size_t y = 0; y < 16; ++y) {
    for (size_t x = 0; x < 20; ++x) {
      double sum = 0;
      uint32_t count = 0;
      for (const size_t i : {2 * y * 40 + 2 * x, 2 * y * 40 + 2 * x + 1, (2 * y + 1) * 40 + 2 * x,
                             (2 * y + 1) * 40 + 2 * x + 1}) {
        sum += static_cast<double>(all.colour[i * 4 + 1]);
        count = std::max(count, all.counts[i]);
      }
      const size_t i = y * 20 + x;
      EXPECT_NEAR(static_cast<double>(made.colour[i * 4 + 1]), sum / 4, 1e-7);
      EXPECT_EQ(made.counts[i], count);
    }
  }
  accuracy.samples_per_side = 17;
  EXPECT_THROW(renderAccurate({&instance, 1}, camera, options, accuracy, workspace, made), Error);
}

}  // namespace
}  // namespace stipple
