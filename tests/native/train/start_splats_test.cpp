#include "train/prior/start_splats.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "base/parallel.h"
#include "math/colour.h"
#include "train/fit_scene.h"
#include "train/sphere_views.h"
#include "train/toy_views.h"

namespace stipple {
namespace {

using namespace stipple::testing;

/// Grey pictures, or transparent ones.
std::shared_ptr<MemoryViewSource> emptyViews(const std::vector<Camera>& cameras,
                                             bool is_transparent = false) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (const Camera& camera : cameras) {
    ViewPicture picture;
    picture.width = camera.width;
    picture.height = camera.height;
    const size_t pixels = size_t{camera.width} * camera.height;
    picture.colour.assign(pixels * 3, is_transparent ? 0.0f : 0.25f);
    if (is_transparent) picture.alpha.assign(pixels, 0.0f);
    views->add(camera, std::move(picture));
  }
  return views;
}

SplatCloud startOf(const MemoryViewSource& views, const StartOptions& options = {}) {
  return startSplats(views, allViews(views), options).splats;
}

TEST(StartSplats, StandAtThePointsAsLargeAsTheirNeighboursAreFar) {
  const auto views = emptyViews(camerasAround(4, 16));
  PointSet points;
  // A unit cube's corners: three neighbours at 1 each; and two far apart.
  for (int corner = 0; corner < 8; ++corner) {
    for (int axis = 0; axis < 3; ++axis) {
      points.positions.push_back(static_cast<float>(corner >> axis & 1));
    }
    points.colours.insert(points.colours.end(), {0.2f, 0.5f, 1.0f});
    points.opacities.push_back(1);
  }
  views->setPoints(points);
  StartOptions options;
  options.count = 8;
  const SplatCloud cloud = startOf(*views, options);
  ASSERT_EQ(cloud.size(), 8u);
  EXPECT_EQ(cloud.sh_degree, 3);
  for (size_t i = 0; i < 8; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(cloud.scales[i * 3 + k], 0.7f, 1e-6f);
      EXPECT_EQ(cloud.positions[i * 3 + k], points.positions[i * 3 + k]);
      const float colour = kShC0 * cloud.sh[i * 48 + k] + 0.5f;
      EXPECT_NEAR(colour, linearToSrgb(points.colours[k]), 1e-6f);
    }
    EXPECT_EQ(cloud.opacities[i], 0.1f);
    EXPECT_EQ(cloud.rotations[i * 4], 1.0f);
    EXPECT_EQ(cloud.sh[i * 48 + 20], 0.0f);
  }
}

TEST(StartSplats, PointsAtOnePlaceAndAPointAloneHaveASize) {
  const auto views = emptyViews(camerasAround(4, 16));
  PointSet points;
  points.positions.assign(30, 0.5f);
  points.colours.assign(30, 0.5f);
  points.opacities.assign(10, 1.0f);
  views->setPoints(points);
  StartOptions options;
  options.count = 10;
  // sqrt(1e-7).
  for (const float scale : startOf(*views, options).scales) {
    EXPECT_NEAR(scale, 0.7f * 3.162e-4f, 1e-6f);
  }
  points.positions.resize(3);
  points.colours.resize(3);
  points.opacities.resize(1);
  views->setPoints(points);
  options.count = 1;
  const SplatCloud one = startOf(*views, options);
  ASSERT_EQ(one.size(), 1u);
  EXPECT_GT(one.scales[0], 0.02f);  // a hundredth of the distance of the nearest camera
  EXPECT_LT(one.scales[0], 0.05f);
}

TEST(StartSplats, FewerThanThePointsAreDrawnByWeight) {
  const auto views = emptyViews(camerasAround(2, 16));
  PointSet points = pointsOf(ballOfSplats(4000, 3), 0, 1);
  points.weights.assign(4000, 1.0f);
  for (size_t i = 0; i < 1000; ++i) points.weights[i] = 9.0f;
  for (size_t i = 1000; i < 2000; ++i) points.weights[i] = 0.0f;
  views->setPoints(points);
  std::map<float, size_t> row_of;
  for (size_t i = 0; i < 4000; ++i) row_of[points.positions[i * 3]] = i;
  StartOptions options;
  options.count = 500;
  const SplatCloud cloud = startOf(*views, options);
  ASSERT_EQ(cloud.size(), 500u);
  size_t heavy = 0;
  for (size_t i = 0; i < 500; ++i) {
    const size_t row = row_of.at(cloud.positions[i * 3]);
    EXPECT_FALSE(row >= 1000 && row < 2000);
    heavy += row < 1000;
  }
  // 9000 of 11000 of the weight, less as heavy ones run out: about 395, +-5 standard deviations.
  EXPECT_NEAR(static_cast<double>(heavy), 395, 45);
  EXPECT_EQ(startOf(*views, options).positions, cloud.positions);
  options.seed = 1;
  EXPECT_NE(startOf(*views, options).positions, cloud.positions);
  options.max_count = 100;
  EXPECT_EQ(startOf(*views, options).size(), 100u);
  options.count = 0;
  EXPECT_EQ(startOf(*views, options).size(), 100u);
}

TEST(StartSplats, KnowWhenTheirPointsWereSeen) {
  const auto views = emptyViews(camerasAround(2, 16));
  PointSet points = pointsOf(ballOfSplats(400, 3), 0, 1);
  views->setPoints(points);
  EXPECT_TRUE(startSplats(*views, allViews(*views), {}).times.empty());
  std::map<float, double> time_of;
  for (size_t i = 0; i < 400; ++i) {
    points.times.push_back(0.01 * static_cast<double>(i));
    time_of[points.positions[i * 3]] = points.times[i];
  }
  views->setPoints(points);
  StartOptions options;
  options.count = 100;
  const StartSplats start = startSplats(*views, allViews(*views), options);
  ASSERT_EQ(start.times.size(), 100u);
  for (size_t i = 0; i < 100; ++i) {
    EXPECT_EQ(start.times[i], time_of.at(start.splats.positions[i * 3]));
  }
}

/// Points of a sphere from a height, of its radius, to its top.
PointSet spherePoints(size_t count, double radius, double lowest) {
  PointSet points;
  for (size_t i = 0; i < count; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double z = lowest + (1 - lowest) * share;
    const double turn = 2.399963 * static_cast<double>(i);  // the golden angle
    const double r = std::sqrt(1 - z * z);
    for (const double at : {r * std::cos(turn), r * std::sin(turn), z}) {
      points.positions.push_back(static_cast<float>(radius * at));
    }
    points.opacities.push_back(1);
  }
  points.colours.assign(count * 3, 0.5f);
  return points;
}

/// A sphere before a pattern, and points of a reconstruction that knows its upper half alone.
std::shared_ptr<MemoryViewSource> halfKnownSphere(size_t count = 300) {
  auto views = sphereViews(camerasAround(24, 64), Behind::kPattern);
  views->setPoints(spherePoints(count, 1, 0));
  return views;
}

TEST(StartSplats, WherePointsAreFewPicturesTellTheRest) {
  const auto views = halfKnownSphere();
  StartOptions options;
  options.count = 3000;
  const SplatCloud cloud = startOf(*views, options);
  ASSERT_EQ(cloud.size(), 3000u);
  const std::vector<float>& known = views->points().positions;
  EXPECT_TRUE(std::equal(known.begin(), known.end(), cloud.positions.begin()));
  // The sphere covers 0.32 of the pictures and the half that is unknown about half of that: 0.16 of
  // the 2,700 others, less those whose depth is off.
  size_t below = 0, behind = 0;
  for (size_t i = 300; i < cloud.size(); ++i) {
    const Vec3d place = Eigen::Map<const Vec3f>(&cloud.positions[i * 3]).cast<double>();
    below += std::abs(place.norm() - 1) < 0.1 && place.z() < 0;
    behind += place.norm() > 5;
  }
  EXPECT_GT(below, 270u);
  EXPECT_GT(behind, 1200u);
  // Unless somebody says how many: one for 16 pixels of 24 pictures.
  options.count = 0;
  EXPECT_EQ(startOf(*views, options).size(), 24u * 64 * 64 / 16);
  options.max_count = 500;
  EXPECT_EQ(startOf(*views, options).size(), 500u);
  options.count = 300;
  EXPECT_EQ(startOf(*views, options).size(), 300u);
}

/// How many splats of the start stand at known points.
size_t atPoints(const ViewSource& views, const SplatCloud& cloud) {
  std::set<std::array<float, 3>> known;
  const std::vector<float>& places = views.points().positions;
  for (size_t i = 0; i < places.size(); i += 3) {
    known.insert({places[i], places[i + 1], places[i + 2]});
  }
  size_t count = 0;
  for (size_t i = 0; i < cloud.positions.size(); i += 3) {
    count += known.count({cloud.positions[i], cloud.positions[i + 1], cloud.positions[i + 2]});
  }
  return count;
}

TEST(StartSplats, HoweverManyPointsThereArePicturesTellOfWhatTheyLeaveOut) {
  const auto views = halfKnownSphere(7000);
  const size_t places = 24u * 64 * 64 / 16;
  StartOptions options;
  SplatCloud cloud = startOf(*views, options);
  EXPECT_EQ(cloud.size(), 7000 + places / 2);
  EXPECT_EQ(atPoints(*views, cloud), 7000u);
  // Without room for both, points are left out.
  options.max_count = 8000;
  cloud = startOf(*views, options);
  EXPECT_EQ(cloud.size(), 8000u);
  EXPECT_EQ(atPoints(*views, cloud), 8000 - places / 2);
  options.max_count = 1000;
  cloud = startOf(*views, options);
  EXPECT_EQ(cloud.size(), 1000u);
  EXPECT_EQ(atPoints(*views, cloud), 500u);
  // Points all around the cameras leave nothing open.
  views->setPoints(spherePoints(60000, 20, -1));
  EXPECT_EQ(startOf(*views).size(), 60000u);
  views->setPoints(spherePoints(7000, 1, 0));
  // Who asks for no more than points gets them alone.
  options = {};
  options.count = 7000;
  EXPECT_EQ(atPoints(*views, startOf(*views, options)), 7000u);
}

TEST(StartSplats, BesidePointsOfThingsThatMoveNothingIsLookedForUnlessAskedFor) {
  const auto views = halfKnownSphere();
  PointSet points = views->points();
  points.times.assign(300, 0.5);
  views->setPoints(points);
  StartOptions options;
  options.with_lives = true;
  const std::vector<size_t> all = allViews(*views);
  EXPECT_EQ(startSplats(*views, all, options).splats.size(), 300u);
  options.count = 400;
  const StartSplats more = startSplats(*views, all, options);
  ASSERT_EQ(more.splats.size(), 400u);
  ASSERT_EQ(more.times.size(), 400u);
  EXPECT_EQ(more.lives.size(), 800u);
  EXPECT_EQ(more.times[299], 0.5);
  EXPECT_TRUE(std::isnan(more.times[300]));
}

TEST(StartSplats, WithoutPointsTheyStandOnWhatDepthShows) {
  // A wall at z = 5 before a camera at the origin, half of it transparent.
  Camera camera;
  camera.width = 40;
  camera.height = 30;
  camera.fx = camera.fy = 30;
  camera.cx = 20;
  camera.cy = 15;
  ViewPicture picture;
  picture.width = 40;
  picture.height = 30;
  picture.colour.assign(1200 * 3, 0.5f);
  picture.depth.assign(1200, 5.0f);
  picture.alpha.assign(1200, 1.0f);
  for (size_t i = 0; i < 1200; ++i) {
    if (i % 40 >= 20) picture.alpha[i] = 0;
    if (i / 40 < 5) picture.depth[i] = 0;
  }
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  views->add(camera, picture);
  StartOptions options;
  options.count = 200;
  const SplatCloud cloud = startOf(*views, options);
  ASSERT_EQ(cloud.size(), 200u);
  for (size_t i = 0; i < 200; ++i) {
    EXPECT_NEAR(cloud.positions[i * 3 + 2], 5, 1e-5f);
    EXPECT_LT(cloud.positions[i * 3], 0);                    // left of the middle
    EXPECT_GT(cloud.positions[i * 3 + 1], -10.0f / 30 * 5);  // below the fifth row
    // The picture is kept in 16 bits: off by 1 / 131070.
    EXPECT_NEAR(kShC0 * cloud.sh[i * 48] + 0.5f, 0.5f, 8e-6f);
  }
  // As many as there are pixels, once each.
  options.count = 100000;
  EXPECT_EQ(startOf(*views, options).size(), 500u);
  // Beside points, which tell of all that is there, only if asked for.
  PointSet point;
  point.positions = {0, 0, 5};
  point.colours = {0.5f, 0.5f, 0.5f};
  point.opacities = {1};
  views->setPoints(point);
  EXPECT_EQ(startOf(*views).size(), 1u);
  options.count = 100;
  EXPECT_EQ(startOf(*views, options).size(), 100u);
}

TEST(StartSplats, WherePicturesTellNothingTheyFillWhatTheCamerasShare) {
  const auto views = emptyViews(camerasAround(10, 32), true);
  StartOptions options;
  options.count = 2000;
  const SplatCloud cloud = startOf(*views, options);
  ASSERT_EQ(cloud.size(), 2000u);
  // Cameras at 3.5 see sin(atan(0.5/1.1)) of that: a ball of radius 1.448.
  double largest = 0;
  Vec3d mean = Vec3d::Zero();
  for (size_t i = 0; i < 2000; ++i) {
    const Vec3d place(static_cast<double>(cloud.positions[i * 3]),
                      static_cast<double>(cloud.positions[i * 3 + 1]),
                      static_cast<double>(cloud.positions[i * 3 + 2]));
    largest = std::max(largest, place.norm());
    mean += place / 2000;
  }
  EXPECT_LT(largest, 1.46);
  EXPECT_GT(largest, 1.38);
  EXPECT_LT(mean.norm(), 0.1);
  SplatCloud others[2];
  for (const unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] { others[threads - 1] = startOf(*views, options); });
  }
  EXPECT_EQ(others[0].positions, cloud.positions);
  EXPECT_EQ(others[1].scales, cloud.scales);
}

TEST(StartSplats, WithoutDepthTheyStandWherePicturesAgree) {
  const SplatCloud truth = toyBall(600);
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  const auto drawn = viewsOf(truth, camerasAround(20, 64));
  for (size_t v = 0; v < drawn->count(); ++v) {
    ViewPicture picture = drawn->load(v);
    picture.depth.clear();
    views->add(drawn->camera(v), std::move(picture));
  }
  StartOptions options;
  options.count = 2000;
  const SplatCloud cloud = startOf(*views, options);
  EXPECT_GT(cloud.size(), 1800u);
  EXPECT_LE(cloud.size(), 2000u);
  // Drawn as it is, opaque: the scene shows. Grey splats in the whole ball make
  // 7.9 dB.
  SplatCloud opaque = cloud;
  std::fill(opaque.opacities.begin(), opaque.opacities.end(), 0.9f);
  EXPECT_GT(meanPsnr(opaque, *views), 12);
  options.max_count = 100;
  EXPECT_LE(startOf(*views, options).size(), 100u);
}

TEST(StartSplats, AnyCamerasGiveAStart) {
  // One camera; cameras that look away from each other; all at one place; parallel ones.
  std::vector<Camera> outward = camerasAround(6, 16, 0.1);
  for (Camera& camera : outward) {
    camera.world_to_camera.row(0) *= -1;  // turned about y
    camera.world_to_camera.row(2) *= -1;
  }
  std::vector<Camera> same(3, camerasAround(1, 16)[0]);
  std::vector<Camera> parallel = same;
  for (size_t i = 0; i < 3; ++i) parallel[i].world_to_camera(0, 3) += static_cast<double>(i);
  std::vector<Camera> flat = camerasAround(5, 16);
  for (Camera& camera : flat) {
    camera.model = CameraModel::kOrthographic;
    camera.fx = camera.fy = 8;
  }
  const std::vector<Camera> sets[] = {camerasAround(1, 16), outward, same, parallel, flat};
  for (size_t k = 0; k < 2 * std::size(sets); ++k) {
    const std::vector<Camera>& cameras = sets[k / 2];
    const auto views = emptyViews(cameras, k % 2 == 1);
    StartOptions options;
    options.count = 300;
    const SplatCloud cloud = startOf(*views, options);
    EXPECT_GE(cloud.size(), 250u);
    validate(cloud, "start");
    // Somebody sees most of them.
    size_t seen = 0;
    for (const Camera& camera : cameras) {
      const SplatInstance instance{&cloud};
      seen += renderTiled({&instance, 1}, camera, {}).visible_count;
    }
    EXPECT_GT(seen, cloud.size() / 2);
  }
}

}  // namespace
}  // namespace stipple
