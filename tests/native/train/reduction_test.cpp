// What the reduction of clouds takes from pictures: views, visibility, refinement.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "data/clouds/cloud_extent.h"
#include "splat/render/projection.h"
#include "splat/render/render.h"
#include "splat/render/render_backward.h"
#include "train/allocation_count.h"
#include "train/loop/refine.h"
#include "train/loop/view_rig.h"
#include "train/loop/visibility.h"

namespace stipple {
namespace {

/// Flat splats that close a sphere of a radius about the origin.
SplatCloud sphere(size_t count, double radius, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  SplatCloud cloud;
  cloud.resize(count);
  const double golden = 3.141592653589793 * (3 - std::sqrt(5.0));
  for (size_t i = 0; i < count; ++i) {
    const double z = 1 - (2.0 * static_cast<double>(i) + 1) / static_cast<double>(count);
    const double ring = std::sqrt(1 - z * z);
    const double angle = golden * static_cast<double>(i);
    const double p[3] = {ring * std::cos(angle), ring * std::sin(angle), z};
    for (size_t k = 0; k < 3; ++k) {
      cloud.positions[i * 3 + k] = static_cast<float>(radius * p[k]);
      cloud.scales[i * 3 + k] = static_cast<float>(2 * radius / std::sqrt(double(count)));
      cloud.sh[i * 3 + k] = 2 * unit(random) - 1;
    }
    cloud.rotations[i * 4] = 1;
    cloud.opacities[i] = 0.9f;
  }
  return cloud;
}

void append(SplatCloud& cloud, const SplatCloud& other) {
  const auto add = [](std::vector<float>& a, const std::vector<float>& b) {
    a.insert(a.end(), b.begin(), b.end());
  };
  add(cloud.positions, other.positions);
  add(cloud.rotations, other.rotations);
  add(cloud.scales, other.scales);
  add(cloud.opacities, other.opacities);
  add(cloud.sh, other.sh);
}

/// Mean squared difference of pictures of both clouds from one rig.
double pictureError(const SplatCloud& a, const SplatCloud& b, const std::vector<Camera>& views) {
  double sum = 0;
  size_t count = 0;
  for (const Camera& camera : views) {
    const SplatInstance one{&a};
    const SplatInstance two{&b};
    const RenderResult first = renderTiled({&one, 1}, camera, {});
    const RenderResult second = renderTiled({&two, 1}, camera, {});
    for (size_t i = 0; i < first.colour.size(); ++i) {
      const double d = static_cast<double>(first.colour[i] - second.colour[i]);
      sum += d * d;
    }
    count += first.colour.size();
  }
  return sum / static_cast<double>(count);
}

TEST(CloudExtent, LeavesOutFarSplats) {
  SplatCloud cloud = sphere(2000, 1.0, 1);
  cloud.positions[0] = 1e6f;
  const CloudExtent extent = cloudExtent(cloud);
  // The half diagonal of the box of a unit sphere, less what lies beyond one splat in 200.
  EXPECT_NEAR(extent.radius, std::sqrt(3.0), 0.03);
  for (const double x : extent.centre) EXPECT_NEAR(x, 0, 0.02);
  EXPECT_EQ(cloudExtent({}).radius, 1.0);
}

TEST(ViewRig, LooksAtThingsFromAroundAndAtRoomsFromInside) {
  // A ball with a core is a thing: from its middle everything is near.
  SplatCloud thing = sphere(3000, 1.0, 1);
  append(thing, sphere(1000, 0.2, 2));
  EXPECT_EQ(chooseRig(*cpuBackends(), thing), ViewRig::kAround);
  EXPECT_EQ(chooseRig(*cpuBackends(), sphere(3000, 1.0, 1)), ViewRig::kInside);
  ViewRigOptions options;
  options.count = 20;
  options.rig = ViewRig::kAround;
  const double radius = cloudExtent(thing).radius;
  for (const Camera& camera : viewsOfCloud(*cpuBackends(), thing, options)) {
    EXPECT_NO_THROW(validate(camera));
    // The sphere around the cloud touches the borders of a picture of 40 degrees.
    EXPECT_NEAR(cameraCentre(camera).norm(), radius / std::sin(20 * 3.141592653589793 / 180), 0.1);
  }
  options.rig = ViewRig::kInside;
  for (const Camera& camera : viewsOfCloud(*cpuBackends(), thing, options)) {
    EXPECT_NO_THROW(validate(camera));
    EXPECT_LT(cameraCentre(camera).norm(), 0.5 * radius);
  }
  // Hollow: a room, or a thing that was a mesh. Seen both ways.
  options.rig = ViewRig::kAutomatic;
  size_t inside_count = 0;
  for (const Camera& camera : viewsOfCloud(*cpuBackends(), sphere(3000, 1.0, 1), options)) {
    inside_count += cameraCentre(camera).norm() < 1 ? 1 : 0;
  }
  EXPECT_EQ(inside_count, options.count / 2);
  for (const Camera& camera : viewsOfCloud(*cpuBackends(), thing, options)) {
    EXPECT_GT(cameraCentre(camera).norm(), 1);
  }
  options.count = 0;
  EXPECT_THROW(viewsOfCloud(*cpuBackends(), thing, options), Error);
  EXPECT_THROW(viewsOfCloud(*cpuBackends(), {}, {}), Error);
}

TEST(ViewRig, LooksOutFromPlacesWithRoomAround) {
  // A shell with a wall through its middle: places near the wall would see little else.
  SplatCloud cloud = sphere(4000, 1.0, 1);
  SplatCloud wall = sphere(1000, 1.0, 2);
  for (size_t i = 0; i < wall.size(); ++i) wall.positions[i * 3] = 0.0f;
  append(cloud, wall);
  ViewRigOptions options;
  options.rig = ViewRig::kInside;
  options.count = 16;
  double sum = 0;
  for (const Camera& camera : viewsOfCloud(*cpuBackends(), cloud, options)) {
    sum += std::abs(cameraCentre(camera)[0]);
  }
  // Places are spread evenly over a quarter of the radius to both sides, so one alone is an eighth
  // away on average; the farthest of sixteen is mostly in the last fifth.
  const double reach = 0.25 * cloudExtent(cloud).radius;
  EXPECT_GT(sum / 16, 0.75 * reach);
}

TEST(ViewRig, LooksEveryWayFromPlacesInsideForVisibility) {
  const SplatCloud room = sphere(3000, 1.0, 1);
  const double radius = cloudExtent(room).radius;
  std::vector<Camera> inside;
  size_t around_count = 0;
  for (const Camera& camera : viewsForVisibility(*cpuBackends(), room, {})) {
    EXPECT_NO_THROW(validate(camera));
    if (cameraCentre(camera).norm() > radius) {
      ++around_count;
    } else {
      inside.push_back(camera);
    }
  }
  EXPECT_EQ(around_count, 4u);
  ASSERT_EQ(inside.size(), 4u * 6);
  // Each place sees each splat: the faces of a cube close.
  for (size_t place = 0; place < 4; ++place) {
    for (size_t i = 0; i < room.size(); ++i) {
      size_t seen_count = 0;
      for (size_t face = 0; face < 6; ++face) {
        const Camera& camera = inside[place * 6 + face];
        EXPECT_EQ(cameraCentre(camera), cameraCentre(inside[place * 6]));
        Eigen::Vector4d point(0, 0, 0, 1);
        for (int k = 0; k < 3; ++k) {
          point[k] = static_cast<double>(room.positions[i * 3 + static_cast<size_t>(k)]);
        }
        const Eigen::Vector4d view = camera.world_to_camera * point;
        const double x = camera.fx * view[0] / view[2] + camera.cx;
        const double y = camera.fy * view[1] / view[2] + camera.cy;
        const bool is_seen = view[2] > 0 && x >= -1e-6 && x <= camera.width + 1e-6 && y >= -1e-6 &&
                             y <= camera.height + 1e-6;
        seen_count += is_seen ? 1 : 0;
      }
      ASSERT_GE(seen_count, 1u);
    }
  }
  // A thing is looked at as it always is.
  SplatCloud thing = sphere(3000, 1.0, 1);
  append(thing, sphere(1000, 0.2, 2));
  const std::vector<Camera> seen = viewsForVisibility(*cpuBackends(), thing, {});
  const std::vector<Camera> usual = viewsOfCloud(*cpuBackends(), thing, {});
  ASSERT_EQ(seen.size(), usual.size());
  for (size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i].world_to_camera, usual[i].world_to_camera);
    EXPECT_EQ(seen[i].width, usual[i].width);
  }
  ViewRigOptions options;
  options.rig = ViewRig::kInside;
  for (const Camera& camera : viewsForVisibility(*cpuBackends(), thing, options)) {
    EXPECT_LT(cameraCentre(camera).norm(), radius);
  }
  options.count = 0;
  EXPECT_THROW(viewsForVisibility(*cpuBackends(), thing, options), Error);
  EXPECT_THROW(viewsForVisibility(*cpuBackends(), {}, {}), Error);
}

TEST(Visibility, CountsEverySplatThatReachesIntoAPicture) {
  // From inside, of splats that are larger than the distance to them, too.
  SplatCloud cloud = sphere(400, 1.0, 1);
  for (size_t i = 0; i < cloud.scales.size(); ++i) {
    cloud.scales[i] =
        0.02f + 0.6f * static_cast<float>(i % 7 == 0) * 0.1f * static_cast<float>(i % 11);
  }
  ViewRigOptions options;
  options.rig = ViewRig::kInside;
  options.count = 3;
  options.size = 96;
  const std::vector<Camera> views = viewsOfCloud(*cpuBackends(), cloud, options);
  std::vector<double> seen(cloud.size(), 0.0), whole(cloud.size(), 0.0);
  RenderOptions plain;
  plain.with_depth = false;
  const SplatInstance instance{&cloud};
  for (const Camera& camera : views) {
    const std::vector<float> zeros(size_t{4} * 96 * 96, 0.0f);
    BackwardInput input;
    input.colour_gradient = zeros;
    input.with_blending_weights = true;
    const BackwardResult result = renderBackward({&instance, 1}, camera, plain, input);
    const View<double> view = makeView<double>(camera);
    const Mat3d linear = camera.world_to_camera.topLeftCorner<3, 3>();
    const Vec3d translation = camera.world_to_camera.topRightCorner<3, 1>();
    for (size_t i = 0; i < cloud.size(); ++i) {
      Projected<double> projected;
      if (!project(view, linear, translation, &cloud.positions[i * 3], &cloud.rotations[i * 4],
                   &cloud.scales[i * 3], static_cast<double>(cloud.opacities[i]), LowPass::kClassic,
                   projected)) {
        continue;
      }
      const Footprint<double>& f = projected.footprint;
      const double area = projected.depth * projected.depth;
      seen[i] += static_cast<double>(result.instances[0].blending_weights[i]) * area;
      whole[i] += 2 * 3.141592653589793 * f.opacity / (f.l00 * f.l11) * area;
    }
  }
  const std::vector<float> visibility = splatVisibility(*cpuBackends(), cloud, views);
  for (size_t i = 0; i < cloud.size(); ++i) {
    const double expected = whole[i] > 0 ? std::min(seen[i] / whole[i], 1.0) : 1.0;
    // Sums of float32 blending weights.
    EXPECT_NEAR(static_cast<double>(visibility[i]), expected, 1e-4);
  }
}

TEST(Visibility, IsALittleInAClosedSurfaceAndNearZeroBehindIt) {
  SplatCloud cloud = sphere(4000, 1.0, 1);
  const size_t front_count = cloud.size();
  append(cloud, sphere(500, 0.5, 2));
  ViewRigOptions options;
  options.rig = ViewRig::kAround;
  options.size = 128;
  const auto views = viewsOfCloud(*cpuBackends(), cloud, options);
  const std::vector<float> visibility = splatVisibility(*cpuBackends(), cloud, views);
  double front = 0;
  double behind = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_TRUE(visibility[i] >= 0 && visibility[i] <= 1);
    (i < front_count ? front : behind) += static_cast<double>(visibility[i]);
  }
  // The surface is closed by overlapping splats of opacity 0.9: each is hidden from the other side
  // of the sphere, and the many neighbours that overlap it share what is seen.
  EXPECT_GT(front / static_cast<double>(front_count), 10 * behind / 500);
  // Four overlapping splats of opacity 0.9 let through little, the rims of two a few hundredths.
  EXPECT_LT(behind / 500, 0.01);
}

TEST(Visibility, IsThatOfTheShapesWhateverTheirColours) {
  SplatCloud cloud = sphere(500, 1.0, 1);
  const auto views = viewsOfCloud(*cpuBackends(), cloud, {});
  const std::vector<float> seen = splatVisibility(*cpuBackends(), cloud, views);
  // Black beyond black, and harmonics that brighten one side.
  for (float& x : cloud.sh) x = -5.0f;
  cloud.sh_degree = 1;
  cloud.sh.resize(cloud.size() * cloud.shStride(), 3.0f);
  EXPECT_EQ(splatVisibility(*cpuBackends(), cloud, views), seen);
}

TEST(Visibility, MatchesTheBlendingWeights) {
  const SplatCloud cloud = sphere(300, 1.0, 4);
  ViewRigOptions options;
  options.count = 1;
  options.size = 96;
  const auto views = viewsOfCloud(*cpuBackends(), cloud, options);
  const SplatInstance instance{&cloud};
  std::vector<float> zeros(size_t{4} * 96 * 96, 0.0f);
  BackwardInput input;
  input.colour_gradient = zeros;
  input.with_blending_weights = true;
  RenderOptions plain;
  plain.with_depth = false;
  const BackwardResult result = renderBackward({&instance, 1}, views[0], plain, input);
  const std::vector<float>& weights = result.instances[0].blending_weights;
  const std::vector<float> visibility = splatVisibility(*cpuBackends(), cloud, views);
  size_t shown = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    SplatCloud alone = sphere(300, 1.0, 4);
    // What the splat adds with nothing in front: all others are too faint to show.
    std::fill(alone.opacities.begin(), alone.opacities.end(), 0.0f);
    alone.opacities[i] = cloud.opacities[i];
    if (i % 30 != 0 || weights[i] < 1.0f) continue;
    ++shown;
    const SplatInstance single{&alone};
    const BackwardResult free = renderBackward({&single, 1}, views[0], plain, input);
    const double expected = static_cast<double>(weights[i]) /
                            static_cast<double>(free.instances[0].blending_weights[i]);
    // Whole weights come from the area of the Gaussian: the cut-off at 1/255 takes off 1/230.
    EXPECT_NEAR(static_cast<double>(visibility[i]), expected, 0.02);
  }
  EXPECT_GE(shown, 4u);
}

TEST(Visibility, OfSplatsApartIsNearlyOne) {
  SplatCloud cloud = sphere(2, 1.0, 1);
  for (float& x : cloud.scales) x = 0.02f;
  ViewRigOptions options;
  options.rig = ViewRig::kAround;
  options.size = 256;
  // Alpha ends at 1/255 (1/230 of the splat's mass), and no view is along the line of both.
  for (const float x :
       splatVisibility(*cpuBackends(), cloud, viewsOfCloud(*cpuBackends(), cloud, options))) {
    EXPECT_GT(x, 0.97f);
  }
  cloud.opacities[1] = 0.001f;
  EXPECT_EQ(splatVisibility(*cpuBackends(), cloud, viewsOfCloud(*cpuBackends(), cloud, options))[1],
            0.0f);
}

TEST(Refine, BringsAWrongCloudNearerToTheFullOne) {
  const SplatCloud full = sphere(400, 1.0, 1);
  SplatCloud start = full;
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  for (float& x : start.sh) x += 0.2f * normal(random);
  for (float& x : start.opacities) x *= 0.8f;
  for (float& x : start.positions) x += 0.01f * normal(random);
  RefineOptions options;
  options.iterations = 80;
  options.view_count = 12;
  options.view_size = 96;
  const SplatCloud refined = refineCloud(*cpuBackends(), start, full, options);
  ASSERT_EQ(refined.size(), start.size());
  ViewRigOptions unseen;
  unseen.seed = 99;
  unseen.size = 96;
  const auto views = viewsOfCloud(*cpuBackends(), full, unseen);
  EXPECT_LT(pictureError(refined, full, views), 0.4 * pictureError(start, full, views));
}

TEST(Refine, EndsInTheTimeThatItGets) {
  const SplatCloud full = sphere(400, 1.0, 1);
  SplatCloud start = full;
  for (float& x : start.sh) x *= 0.5f;
  RefineOptions options;
  options.view_count = 12;
  options.view_size = 96;
  options.iterations = 1000000;  // an hour
  ViewRigOptions unseen;
  unseen.seed = 99;
  unseen.size = 96;
  const auto views = viewsOfCloud(*cpuBackends(), full, unseen);
  const double wanted = 0.9 * pictureError(start, full, views);
  double left_over = wanted;
  // A step takes a few milliseconds; where others use the machine it may take a hundred times that,
  // and a second too short to gain anything.
  for (options.seconds = 1; left_over >= wanted && options.seconds <= 16; options.seconds *= 4) {
    const Stopwatch watch;
    const SplatCloud refined = refineCloud(*cpuBackends(), start, full, options);
    EXPECT_LT(watch.seconds(), options.seconds + 9);
    left_over = pictureError(refined, full, views);
  }
  EXPECT_LT(left_over, wanted);
  // Where no time is left behind the images, the start comes back (by way of logarithms).
  options.seconds = 1e-9;
  const SplatCloud left = refineCloud(*cpuBackends(), start, full, options);
  EXPECT_EQ(left.positions, start.positions);
  EXPECT_EQ(left.sh, start.sh);
}

TEST(Refine, IsTheSameForAnyNumberOfThreads) {
  const SplatCloud full = sphere(300, 1.0, 1);
  SplatCloud start = sphere(100, 1.0, 2);
  RefineOptions options;
  options.iterations = 5;
  options.view_count = 3;
  options.view_size = 64;
  SplatCloud one, four;
  withThreads(1, [&] { one = refineCloud(*cpuBackends(), start, full, options); });
  withThreads(4, [&] { four = refineCloud(*cpuBackends(), start, full, options); });
  EXPECT_EQ(one.positions, four.positions);
  EXPECT_EQ(one.sh, four.sh);
  options.iterations = 0;
  EXPECT_EQ(refineCloud(*cpuBackends(), start, full, options).positions, start.positions);
  EXPECT_THROW(refineCloud(*cpuBackends(), {}, full, options), Error);
  start.colour_space = ColourSpace::kLinear;
  EXPECT_THROW(refineCloud(*cpuBackends(), start, full, options), Error);
}

TEST(Refine, StaysBelowItsMemoryBound) {
  const SplatCloud full = sphere(3000, 1.0, 1);
  const SplatCloud start = sphere(400, 1.0, 2);
  RefineOptions options;
  options.iterations = 2;
  options.view_count = 6;
  options.view_size = 160;
  const size_t most =
      testing::mostBytesDuring([&] { refineCloud(*cpuBackends(), start, full, options); });
  EXPECT_LE(most, refineMemoryBound(*cpuBackends(), start, full, options));
  // The targets alone: more views are more memory, and the bound follows.
  EXPECT_GE(most, 6u * 160 * 160 * 12);
  RefineOptions more = options;
  more.view_count = 12;
  EXPECT_EQ(refineMemoryBound(*cpuBackends(), start, full, more) -
                refineMemoryBound(*cpuBackends(), start, full, options),
            6u * 160 * 160 * 12);
}

TEST(Visibility, StaysBelowItsMemoryBound) {
  const SplatCloud cloud = sphere(5000, 1.0, 1);
  ViewRigOptions options;
  options.size = 128;
  const auto views = viewsOfCloud(*cpuBackends(), cloud, options);
  EXPECT_LE(testing::mostBytesDuring([&] { splatVisibility(*cpuBackends(), cloud, views); }),
            visibilityMemoryBound(*cpuBackends(), cloud, options.size));
}

}  // namespace
}  // namespace stipple
