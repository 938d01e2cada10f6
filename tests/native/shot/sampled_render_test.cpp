#include "shot/sampled_render.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/random_scene.h"
#include "splat/render/ray_render.h"
#include "splat/render/ray_splats.h"

// Depth of field and motion blur: closed forms of a point out of focus and of one that moves, brute
// force over lens and time in double with rays of its own, and how the error falls with samples.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::instanceOf;
using testing::oneSplat;
using testing::randomCloud;

constexpr double kPi = std::numbers::pi;

RenderOptions plain() {
  RenderOptions options;
  options.with_transmittance = true;
  return options;
}

void drawTiled(std::span<const SplatInstance> instances, const Camera& camera,
               const RenderOptions& options, RenderResult& result, Progress* progress) {
  result = renderTiled(instances, camera, options, progress);
}

void drawRays(std::span<const SplatInstance> instances, const Camera& camera,
              const RenderOptions& options, RenderResult& result, Progress* progress) {
  RayOptions rays = unlimitedRays();
  result = renderRays(instances, camera, options, rays, progress);
}

RenderResult sampled(const SplatInstance& instance, const Camera& camera, const Sampling& sampling,
                     const DrawMoment& draw = drawTiled, const RenderOptions& options = plain()) {
  RenderResult result;
  renderSampled({&instance, 1}, camera, options, sampling, draw, result);
  return result;
}

/// Moments of the alpha of a picture about a place in it.
struct Moments {
  double sum = 0, x = 0, y = 0, xx = 0, yy = 0;
};

Moments momentsOf(const RenderResult& picture, double cx, double cy) {
  Moments m;
  for (uint32_t row = 0; row < picture.height; ++row) {
    for (uint32_t column = 0; column < picture.width; ++column) {
      const size_t i = size_t{row} * picture.width + column;
      const double alpha = static_cast<double>(picture.colour[i * 4 + 3]);
      const double x = column + 0.5 - cx, y = row + 0.5 - cy;
      m.sum += alpha;
      m.x += alpha * x;
      m.y += alpha * y;
      m.xx += alpha * x * x;
      m.yy += alpha * y * y;
    }
  }
  m.x /= m.sum;
  m.y /= m.sum;
  m.xx = m.xx / m.sum - m.x * m.x;
  m.yy = m.yy / m.sum - m.y * m.y;
  return m;
}

/// A faint point: so faint that its alphas add up, and so small that the low-pass is its size.
SplatCloud point() {
  return oneSplat(1e-5f, 0.2f);
}

/// What a point's alpha sums up to in one picture: 2 pi 0.3 px^2 of its opacity, less what falls
/// below 1/255 (2 % of it here).
double pointSum() {
  const SplatCloud cloud = point();
  const SplatInstance instance = instanceOf(cloud);
  Sampling sampling;
  sampling.samples = 256;
  return momentsOf(sampled(instance, frontCamera(16, 16, 100, 4), sampling), 8, 8).sum;
}

TEST(SampledRender, APointOutOfFocusIsADiscOfTheCircleOfConfusion) {
  const SplatCloud cloud = point();
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(80, 80, 400, 4);
  Sampling sampling;
  sampling.aperture.radius = 0.1;
  sampling.aperture.focus_distance = 2;
  sampling.samples = 4096;
  const double radius = 400 * 0.1 * std::abs(1 / 4.0 - 1 / 2.0);  // 10 px
  const RenderResult picture = sampled(instance, camera, sampling);
  const Moments m = momentsOf(picture, 40, 40);
  EXPECT_NEAR(m.sum, pointSum(), 0.01 * pointSum());
  EXPECT_NEAR(m.x, 0, 0.02);
  EXPECT_NEAR(m.y, 0, 0.02);
  // A disc has radius^2 / 4; the point 0.3 less its tail, its place in the pixel twice 1/12 less.
  EXPECT_NEAR(m.xx, radius * radius / 4 + 0.4, 0.3);
  EXPECT_NEAR(m.yy, radius * radius / 4 + 0.4, 0.3);
  for (uint32_t y = 0; y < 80; ++y) {
    for (uint32_t x = 0; x < 80; ++x) {
      const double from = std::hypot(x + 0.5 - 40, y + 0.5 - 40);
      const double alpha = static_cast<double>(picture.colour[(size_t{y} * 80 + x) * 4 + 3]);
      // 1.9 px: where alpha ends, a pixel's half.
      if (from > radius + 1.9) {
        ASSERT_EQ(alpha, 0) << x << ", " << y;
      }
      const double even = m.sum / (kPi * radius * radius);
      if (from < radius - 1.9) {
        ASSERT_NEAR(alpha, even, 0.12 * even) << x << ", " << y;
      }
    }
  }
}

TEST(SampledRender, APointInFocusStandsStill) {
  const SplatCloud cloud = point();
  SplatInstance instance = instanceOf(cloud);
  instance.object_to_world(0, 3) = 0.13;
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    Camera camera = frontCamera(32, 32, 100, 4);
    camera.model = model;
    if (model == CameraModel::kOrthographic) camera.fx = camera.fy = 25;
    Sampling sharp;
    sharp.samples = 64;
    Sampling lens = sharp;
    lens.aperture.radius = 0.2;
    lens.aperture.focus_distance = 4;
    const Moments a = momentsOf(sampled(instance, camera, sharp), 16, 16);
    const Moments b = momentsOf(sampled(instance, camera, lens), 16, 16);
    EXPECT_NEAR(a.sum, b.sum, 0.02 * a.sum);
    EXPECT_NEAR(a.x, b.x, 0.02);
    EXPECT_NEAR(a.xx, b.xx, 0.05);
  }
}

TEST(SampledRender, TheOrthographicLensSpreadsWithTheDistanceFromFocus) {
  const SplatCloud cloud = point();
  const SplatInstance instance = instanceOf(cloud);
  Camera camera = frontCamera(64, 64, 50, 6);
  camera.model = CameraModel::kOrthographic;
  Sampling sampling;
  sampling.aperture.radius = 0.3;
  sampling.aperture.focus_distance = 4;
  sampling.samples = 1024;
  const double radius = 50 * 0.3 * std::abs(1 - 6.0 / 4.0);  // 7.5 px
  const Moments m = momentsOf(sampled(instance, camera, sampling), 32, 32);
  EXPECT_NEAR(m.xx, radius * radius / 4 + 0.4, 0.3);
  EXPECT_NEAR(m.x, 0, 0.05);
}

TEST(SampledRender, APanoramaIsOutOfFocusAlikeInEveryDirection) {
  const SplatCloud cloud = oneSplat(0.002f, 0.3f);
  Camera camera;
  camera.model = CameraModel::kEquirectangular;
  camera.width = camera.height = 41;
  camera.fx = camera.fy = 300;
  camera.world_to_camera << 1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1;
  Sampling sampling;
  sampling.aperture.radius = 0.05;
  sampling.aperture.focus_distance = 1;
  sampling.samples = 512;
  const double radius = 300 * 0.05 * std::abs(1 / 2.0 - 1);  // 7.5 px
  for (const double longitude : {0.0, 2.0, kPi}) {
    SplatInstance instance = instanceOf(cloud);
    instance.object_to_world(0, 3) = 2 * std::sin(longitude);
    instance.object_to_world(1, 3) = 2 * std::cos(longitude);
    camera.cx = 20.5 - 300 * longitude;
    camera.cy = 20.5;
    const Moments m = momentsOf(sampled(instance, camera, sampling, drawRays), 20.5, 20.5);
    // Unlimited rays keep the tails: 0.3 px^2, the splat's 0.09, two halves of a pixel.
    EXPECT_NEAR(m.xx, radius * radius / 4 + 0.5, 0.3) << longitude;
    EXPECT_NEAR(m.yy, radius * radius / 4 + 0.5, 0.3) << longitude;
    EXPECT_NEAR(m.x, 0, 0.05) << longitude;
  }
}

TEST(SampledRender, BladesRotationAndRatioShapeTheOpening) {
  Aperture aperture;
  aperture.radius = 2;
  for (const uint32_t blades : {3u, 5u, 6u}) {
    aperture.blades = blades;
    aperture.rotation = 0.4;
    aperture.ratio = 1;
    double area_moment = 0;
    for (uint32_t k = 0; k < 4096; ++k) {
      const Vec2d at = aperturePoint(aperture, (k % 64 + 0.5) / 64, (k / 64 + 0.5) / 64);
      // Within every edge: the distance of an edge from the middle is cos(pi / n) of the radius.
      for (uint32_t edge = 0; edge < blades; ++edge) {
        const double turn = 0.4 + 2 * kPi * edge / blades;
        ASSERT_LE(at[0] * std::cos(turn) - at[1] * std::sin(turn),
                  2 * std::cos(kPi / blades) + 1e-12);
      }
      area_moment += at.squaredNorm() / 4096;
    }
    // Of a regular polygon: R^2 (2 + cos(2 pi / n)) / 6.
    EXPECT_NEAR(area_moment, 4 * (2 + std::cos(2 * kPi / blades)) / 6, 0.01);
  }
  aperture.blades = 0;
  aperture.ratio = 2;
  double widest = 0, highest = 0;
  for (uint32_t k = 0; k < 4096; ++k) {
    const Vec2d at = aperturePoint(aperture, (k % 64 + 0.5) / 64, (k / 64 + 0.5) / 64);
    widest = std::max(widest, at[0]);
    highest = std::max(highest, at[1]);
  }
  EXPECT_NEAR(widest, 1, 0.03);
  EXPECT_NEAR(highest, 2, 0.06);
  // The first corner stands to the right, the turn is counterclockwise, y downwards.
  aperture = {1, 1, 3, kPi / 2, 1};
  const Vec2d corner = aperturePoint(aperture, 1 / 3.0 - 1e-9, 0);
  EXPECT_NEAR(corner.norm(), 1, 1e-6);
  EXPECT_NEAR(aperturePoint(aperture, 1e-12, 0.5).norm(), 0, 1e-5);
}

Shutter twoSteps(const Mat4d& first, const Mat4d& last) {
  Shutter shutter;
  shutter.step_count = 2;
  shutter.instances = {first, last};
  return shutter;
}

TEST(SampledRender, AMovingPointIsAnEvenStreak) {
  const SplatCloud cloud = point();
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(64, 16, 100, 4);
  Mat4d first = Mat4d::Identity(), last = Mat4d::Identity();
  first(0, 3) = -0.8;  // 20 px to the left of the middle
  last(0, 3) = 0.8;
  Sampling sampling;
  sampling.shutter = twoSteps(first, last);
  sampling.samples = 2048;
  const RenderResult picture = sampled(instance, camera, sampling);
  const double sum = momentsOf(picture, 32, 8).sum;
  EXPECT_NEAR(sum, pointSum(), 0.01 * sum);
  for (uint32_t x = 0; x < 64; ++x) {
    double column = 0;
    for (uint32_t y = 0; y < 16; ++y) {
      column += static_cast<double>(picture.colour[(size_t{y} * 64 + x) * 4 + 3]);
    }
    const double from = std::abs(x + 0.5 - 32);
    if (from < 18) {
      ASSERT_NEAR(column, sum / 40, 0.05 * sum / 40) << x;
    }
    if (from > 22.5) {
      ASSERT_EQ(column, 0) << x;
    }
  }
  // A shutter that opens and closes evenly: a triangle of variance L^2 / 24 instead of L^2 / 12.
  sampling.shutter.curve = {0, 1, 0};
  const Moments even = momentsOf(picture, 32, 8);
  const Moments peaked = momentsOf(sampled(instance, camera, sampling), 32, 8);
  EXPECT_NEAR(even.xx, 1600 / 12.0 + 0.4, 1);
  EXPECT_NEAR(peaked.xx, 1600 / 24.0 + 0.4, 1);
  EXPECT_NEAR(peaked.x, 0, 0.1);
}

TEST(SampledRender, ATurningCameraDrawsAnArcAndNotItsChord) {
  const SplatCloud cloud = point();
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(64, 64, 100, 4);
  // A half turn about the axis; the point stands 20 px above it.
  Camera raised = camera;
  raised.world_to_camera(1, 3) = -0.8;
  const Mat4d base = raised.world_to_camera;
  Mat4d turn = Mat4d::Identity();
  turn.topLeftCorner<2, 2>() << std::cos(2.5), -std::sin(2.5), std::sin(2.5), std::cos(2.5);
  Sampling sampling;
  sampling.shutter.step_count = 2;
  sampling.shutter.camera = {base, Mat4d(turn * base)};
  sampling.samples = 512;
  const RenderResult picture = sampled(instance, camera, sampling);
  double radius = 0, sum = 0;
  for (uint32_t y = 0; y < 64; ++y) {
    for (uint32_t x = 0; x < 64; ++x) {
      const double alpha = static_cast<double>(picture.colour[(size_t{y} * 64 + x) * 4 + 3]);
      radius += alpha * std::hypot(x + 0.5 - 32, y + 0.5 - 32);
      sum += alpha;
    }
  }
  EXPECT_NEAR(radius / sum, 20, 0.1);
}

/// Lens, time and pixel on grids, every ray by itself: from a point of the lens through the place
/// of focus, in space as it is at that moment.
std::vector<double> bruteForce(const SplatCloud& cloud, const Camera& camera,
                               const Sampling& sampling, const RenderOptions& options) {
  const bool is_still = sampling.shutter.step_count == 0;
  const int kRings = is_still ? 20 : 8, kTurns = is_still ? 36 : 16, kTimes = 16, kPixel = 3;
  std::vector<double> sums(size_t{camera.width} * camera.height * 4, 0.0);
  const bool has_lens = sampling.aperture.radius > 0;
  const bool moves = sampling.shutter.step_count > 0;
  const int rings = has_lens ? kRings : 1, turns = has_lens ? kTurns : 1;
  const int times = moves ? kTimes : 1;
  double count = 0;
  for (int t = 0; t < times; ++t) {
    const double time = moves ? (t + 0.5) / times : 0.5;
    SplatInstance instance = instanceOf(cloud);
    if (moves) {
      // Steps here only shift and turn about z.
      const Mat4d& a = sampling.shutter.instances[0];
      const Mat4d& b = sampling.shutter.instances[1];
      const double turn_a = std::atan2(a(1, 0), a(0, 0)), turn_b = std::atan2(b(1, 0), b(0, 0));
      const double turn = turn_a + time * (turn_b - turn_a);
      instance.object_to_world.topLeftCorner<2, 2>() << std::cos(turn), -std::sin(turn),
          std::sin(turn), std::cos(turn);
      instance.object_to_world.col(3) = (1 - time) * a.col(3) + time * b.col(3);
    }
    const PlacedScene scene = placeScene({&instance, 1}, camera, options);
    const std::vector<RaySplat> splats = raySplats(scene, 1e-9);
    for (int ring = 0; ring < rings; ++ring) {
      for (int turn = 0; turn < turns; ++turn) {
        for (int sub = 0; sub < kPixel * kPixel; ++sub) {
          // Different turns of the grid per ring, so that its spokes do not show.
          const double angle = 2 * kPi * (turn + 0.37 * ring + 0.21 * sub + 0.11 * t) / turns;
          const double out = sampling.aperture.radius * std::sqrt((ring + 0.5) / rings);
          const Vec3d origin(out * std::cos(angle), out * std::sin(angle), 0);
          const double dx = (sub % kPixel + 0.5) / kPixel, dy = (sub / kPixel + 0.5) / kPixel;
          count += 1;
          for (size_t i = 0; i < sums.size() / 4; ++i) {
            const double x = static_cast<double>(i % camera.width) + dx;
            const double y = static_cast<double>(i / camera.width) + dy;
            const Vec3d focus = sampling.aperture.focus_distance *
                                Vec3d((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
            const Vec3d direction = (focus - origin) / sampling.aperture.focus_distance;
            std::vector<std::pair<double, const RaySplat*>> hits;
            for (const RaySplat& splat : splats) {
              const RayResponse response = respond(splat, origin, direction);
              if (response.place >= camera.near_plane) hits.push_back({response.place, &splat});
            }
            std::sort(hits.begin(), hits.end());
            double transmittance = 1;
            for (const auto& [place, splat] : hits) {
              const double alpha =
                  splat->opacity *
                  std::exp(-0.5 * respond(*splat, origin, direction).squared_distance);
              if (alpha < 1e-9) continue;
              for (size_t c = 0; c < 3; ++c) {
                sums[i * 4 + c] += transmittance * alpha * splat->colour[c];
              }
              transmittance *= 1 - alpha;
            }
            sums[i * 4 + 3] += 1 - transmittance;
          }
        }
      }
    }
  }
  for (double& sum : sums) sum /= count;
  return sums;
}

double rootMeanSquare(const RenderResult& picture, const std::vector<double>& truth) {
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    const double difference = static_cast<double>(picture.colour[i]) - truth[i];
    sum += difference * difference;
  }
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

SplatCloud fewSplats() {
  CloudRecipe recipe;
  recipe.count = 20;
  recipe.size_min = 0.1;
  recipe.size_max = 0.5;
  return randomCloud(recipe, 6);
}

TEST(SampledRender, AgreesWithBruteForceOverTheLensAndTime) {
  const SplatCloud cloud = fewSplats();
  const Camera camera = frontCamera(14, 12, 14, 3);
  RenderOptions options = plain();
  options.low_pass = LowPass::kNone;
  for (const bool moves : {false, true}) {
    Sampling sampling;
    sampling.aperture.radius = 0.35;
    sampling.aperture.focus_distance = 2.5;
    if (moves) {
      Mat4d first = Mat4d::Identity(), last = Mat4d::Identity();
      last.topLeftCorner<2, 2>() << std::cos(0.8), -std::sin(0.8), std::sin(0.8), std::cos(0.8);
      last(2, 3) = 0.3;
      sampling.shutter = twoSteps(first, last);
    }
    sampling.samples = 1024;
    const std::vector<double> truth = bruteForce(cloud, camera, sampling, options);
    const SplatInstance instance = instanceOf(cloud);
    const RenderResult picture = sampled(instance, camera, sampling, drawRays, options);
    // Midpoints on 640 and 7680 grid places against 1024 points: both are off by some 1e-3.
    EXPECT_LT(rootMeanSquare(picture, truth), 1.5e-3) << moves;
    for (size_t i = 0; i < truth.size(); ++i) {
      ASSERT_NEAR(static_cast<double>(picture.colour[i]), truth[i], 8e-3) << "value " << i;
    }
  }
}

TEST(SampledRender, TheErrorFallsFasterThanThatOfRandomPoints) {
  const SplatCloud cloud = fewSplats();
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(24, 20, 24, 3);
  Sampling sampling;
  sampling.aperture.radius = 0.35;
  sampling.aperture.focus_distance = 2.5;
  Mat4d first = Mat4d::Identity(), last = Mat4d::Identity();
  last(0, 3) = 0.5;
  sampling.shutter = twoSteps(first, last);
  sampling.samples = 16384;
  const RenderResult best = sampled(instance, camera, sampling);
  const std::vector<double> truth(best.colour.begin(), best.colour.end());
  double error[2];
  for (const size_t k : {0, 1}) {
    sampling.samples = k == 0 ? 16 : 1024;
    error[k] = rootMeanSquare(sampled(instance, camera, sampling), truth);
  }
  // Random points: an exponent of 0.5.
  const double slope = std::log(error[0] / error[1]) / std::log(1024.0 / 16);
  RecordProperty("slope", std::to_string(slope));
  EXPECT_GT(slope, 0.65);
  EXPECT_LT(error[0], 0.02);
}

TEST(SampledRender, OneSampleIsTheMiddleBitForBit) {
  const SplatCloud cloud = randomCloud({}, 3);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(70, 50, 60, 3);
  Sampling sampling;
  sampling.aperture.radius = 0.4;
  Mat4d before = Mat4d::Identity(), after = Mat4d::Identity();
  before(0, 3) = -0.5;
  after(0, 3) = 0.5;
  sampling.shutter = twoSteps(before, after);
  sampling.samples = 1;
  const RenderResult still = renderTiled({&instance, 1}, camera, plain());
  const RenderResult middle = sampled(instance, camera, sampling);
  EXPECT_EQ(still.colour, middle.colour);
  EXPECT_EQ(still.depth, middle.depth);
  // And depth stays that of the middle where colours are averaged.
  sampling.samples = 8;
  const RenderResult blurred = sampled(instance, camera, sampling);
  EXPECT_EQ(still.depth, blurred.depth);
  EXPECT_NE(still.colour, blurred.colour);
  sampling = {};
  EXPECT_FALSE(isSampled(sampling));
}

TEST(SampledRender, GivesTheSameForAnyNumberOfThreads) {
  const SplatCloud cloud = randomCloud({}, 4);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(90, 70, 70, 2);
  Sampling sampling;
  sampling.aperture.radius = 0.1;
  sampling.aperture.focus_distance = 2;
  RenderResult one, two;
  withThreads(1, [&] { one = sampled(instance, camera, sampling); });
  withThreads(2, [&] { two = sampled(instance, camera, sampling); });
  EXPECT_EQ(one.colour, two.colour);
  EXPECT_EQ(one.transmittance, two.transmittance);
}

TEST(SampledRender, ChoosesSamplesByHowFarSplatsSpread) {
  const SplatCloud cloud = randomCloud({}, 4);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(200, 200, 200, 4);
  Sampling sampling;
  sampling.aperture.focus_distance = 4;
  sampling.aperture.radius = 1e-4;
  EXPECT_EQ(automaticSamples({&instance, 1}, camera, sampling), 16u);
  sampling.aperture.radius = 1;
  const uint32_t many = automaticSamples({&instance, 1}, camera, sampling);
  EXPECT_GT(many, 64u);
  EXPECT_LE(many, 256u);
  sampling.aperture.radius = 0;
  Mat4d first = Mat4d::Identity(), last = Mat4d::Identity();
  last(0, 3) = 1;  // 50 px
  sampling.shutter = twoSteps(first, last);
  EXPECT_EQ(automaticSamples({&instance, 1}, camera, sampling), 64u);
}

TEST(SampledRender, ASurfaceTakesPartInEveryPicture) {
  const SplatCloud cloud = oneSplat(0.5f, 0.9f);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = frontCamera(17, 17, 20, 3);
  const std::vector<float> depth(17 * 17, 2.0f), behind(17 * 17, 5.0f);
  Sampling sampling;
  sampling.aperture.radius = 0.2;
  sampling.aperture.focus_distance = 1;
  sampling.samples = 16;
  RenderOptions options = plain();
  options.surface = {17, 17, depth.data(), nullptr, nullptr};
  for (const float value : sampled(instance, camera, sampling, drawTiled, options).colour) {
    ASSERT_EQ(value, 0.0f);  // all of it is behind the matte
  }
  options.surface.depth = behind.data();
  const RenderResult picture = sampled(instance, camera, sampling, drawTiled, options);
  EXPECT_GT(picture.colour[(8 * 17 + 8) * 4 + 3], 0.3f);
}

TEST(SampledRender, StopsWhenCancelledAndTellsHowFarItIs) {
  const SplatCloud cloud = oneSplat(0.5f, 0.9f);
  const SplatInstance instance = instanceOf(cloud);
  Sampling sampling;
  sampling.samples = 8;
  Progress progress;
  int drawn = 0;
  RenderResult result;
  EXPECT_THROW(renderSampled(
                   {&instance, 1}, frontCamera(9, 9, 9, 3), plain(), sampling,
                   [&](std::span<const SplatInstance> instances, const Camera& camera,
                       const RenderOptions& options, RenderResult& out, Progress* p) {
                     if (++drawn == 4) {
                       EXPECT_NEAR(progress.fraction(), 3 / 9.0, 1e-9);
                       progress.cancel();
                     }
                     drawTiled(instances, camera, options, out, p);
                   },
                   result, &progress),
               Error);
  EXPECT_EQ(drawn, 4);
}

std::string refusalOf(const Sampling& sampling, size_t instance_count = 1) {
  const SplatCloud cloud = oneSplat(0.5f, 0.9f);
  const std::vector<SplatInstance> instances(instance_count, instanceOf(cloud));
  try {
    validate(sampling, instances);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(SampledRender, RefusesWhatNoLensOrShutterIs) {
  Sampling sampling;
  EXPECT_EQ(refusalOf(sampling), "");
  sampling.samples = 70000;
  EXPECT_EQ(refusalOf(sampling), "samples is 70000; 0 to 65536 is allowed");
  sampling = {};
  sampling.aperture.blades = 2;
  EXPECT_EQ(refusalOf(sampling),
            "the lens's number of blades is 2; 0 (round) or 3 to 64 is allowed");
  sampling = {};
  sampling.aperture.focus_distance = 0;
  EXPECT_EQ(refusalOf(sampling), "the lens's focus distance is 0; 1e-6 to 1e15 m is allowed");
  sampling = {};
  sampling.aperture.radius = -1;
  EXPECT_EQ(refusalOf(sampling), "the lens's aperture radius is -1; 0 to 1e6 m is allowed");
  sampling = {};
  sampling.shutter = twoSteps(Mat4d::Identity(), Mat4d::Zero());
  EXPECT_NE(refusalOf(sampling).find("instance 0: matrix of step 1"), std::string::npos);
  sampling.shutter = {2, {Mat4d::Identity(), Mat4d::Zero()}, {}, {}};
  EXPECT_NE(refusalOf(sampling).find("not a rotation"), std::string::npos);
  Mat4d mirrored = Mat4d::Identity();
  mirrored(2, 2) = -1;
  sampling.shutter = twoSteps(Mat4d::Identity(), mirrored);
  EXPECT_NE(refusalOf(sampling).find("mirrors"), std::string::npos);
  sampling.shutter = twoSteps(Mat4d::Identity(), Mat4d::Identity());
  EXPECT_NE(refusalOf(sampling, 3), "");
  sampling.shutter.curve = {0, 0};
  EXPECT_NE(refusalOf(sampling).find("not all 0"), std::string::npos);
}

}  // namespace
}  // namespace stipple
