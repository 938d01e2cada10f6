#include "splat/render/draw_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "math/colour.h"
#include "splat/cpu/visible_splats.h"
#include "splat/random_scene.h"
#include "splat/render/scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::randomCloud;

Mat4d placement(double scale, double x, double y, double z) {
  Mat4d matrix = Mat4d::Identity();
  matrix(0, 0) = matrix(1, 1) = matrix(2, 2) = scale;
  matrix(0, 3) = x;
  matrix(1, 3) = y;
  matrix(2, 3) = z;
  return matrix;
}

struct Ordered {
  std::vector<uint32_t> order;
  std::vector<float> rows;
};

Ordered ordered(std::span<const SplatInstance> instances, const Camera& camera,
                std::vector<uint64_t> first_rows = {}, int degree = kMaxShDegree) {
  size_t count = 0;
  for (const SplatInstance& instance : instances) {
    if (first_rows.size() < instances.size()) first_rows.push_back(count);
    count += instance.cloud->size();
  }
  Ordered made{std::vector<uint32_t>(count), std::vector<float>(count * kDrawRowFloats)};
  DrawOrderWorkspace workspace;
  orderForDrawing(instances, camera, {made.order.data(), made.rows.data(), first_rows, degree},
                  workspace);
  return made;
}

/// Centres brought to the world, then to the camera, in double; far ones first, ties by index.
std::vector<uint32_t> referenceOrder(std::span<const SplatInstance> instances,
                                     const Camera& camera) {
  std::vector<float> depths;
  for (const SplatInstance& instance : instances) {
    const auto& p = instance.cloud->positions;
    for (size_t i = 0; i < instance.cloud->size(); ++i) {
      Eigen::Vector4d point(static_cast<double>(p[i * 3]), static_cast<double>(p[i * 3 + 1]),
                            static_cast<double>(p[i * 3 + 2]), 1.0);
      const Eigen::Vector4d view = camera.world_to_camera * (instance.object_to_world * point);
      depths.push_back(static_cast<float>(view[2]));
    }
  }
  std::vector<uint32_t> order(depths.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return depths[a] != depths[b] ? depths[a] > depths[b] : a > b;
  });
  return order;
}

float decoded(double step) {
  return static_cast<float>(64.0 * (step / 65535.0) * (step / 65535.0));
}

/// The colour of a row, by the words of the header.
std::array<float, 3> colourOfRow(const float* row) {
  const uint32_t high = static_cast<uint32_t>(row[2]), low = static_cast<uint32_t>(row[3]);
  return {decoded(high >> 8), decoded((high & 255u) * 256 + (low >> 16)), decoded(low & 65535u)};
}

TEST(DrawOrder, OfManyPlacedCloudsEqualsTheDoubleReference) {
  CloudRecipe recipe;
  recipe.count = 30000;
  const SplatCloud one = randomCloud(recipe, 1), two = randomCloud(recipe, 2);
  // Cameras in front and in the middle of the splats, where depths have both signs.
  for (const double distance : {3.0, 0.0}) {
    Camera camera = frontCamera(64, 48, 60, distance);
    for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
      camera.model = model;
      const SplatInstance instances[] = {{&one, placement(1.0, 0, 0, 0)},
                                         {&two, placement(0.3, 0.5, -0.2, 0.1)},
                                         {&one, placement(-2.0, 0.1, 0.2, 0.3)}};
      EXPECT_EQ(ordered(instances, camera).order, referenceOrder(instances, camera));
    }
  }
}

TEST(DrawOrder, IsTheReverseOfTheRenderersOrder) {
  CloudRecipe recipe;
  recipe.count = 20000;
  const SplatCloud cloud = randomCloud(recipe, 3);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(640, 480, 300, 3.0);
  const PlacedScene scene = placeScene({&instance, 1}, camera, {});
  const VisibleSplats visible = findVisibleSplats(scene, nullptr);
  std::vector<uint32_t> drawn;
  std::vector<bool> shows(cloud.size());
  for (size_t i = visible.count; i-- > 0;) {
    drawn.push_back(visible.extraAt(i).index);
    shows[drawn.back()] = true;
  }
  std::vector<uint32_t> order = ordered({&instance, 1}, camera).order;
  std::erase_if(order, [&](uint32_t splat) { return !shows[splat]; });
  ASSERT_GT(drawn.size(), 10000u);
  EXPECT_EQ(order, drawn);
}

TEST(DrawOrder, BreaksTiesByIndex) {
  SplatCloud cloud = randomCloud({.count = 5000}, 4);
  for (size_t i = 0; i < cloud.size(); ++i) cloud.positions[i * 3 + 1] = float(i % 3);
  const SplatInstance instance{&cloud};
  const std::vector<uint32_t> order = ordered({&instance, 1}, frontCamera(64, 48, 60, 3.0)).order;
  // Depth is y + 3: those of y = 2 are drawn first, the last of them before all.
  EXPECT_EQ(order.front(), 4997u);
  EXPECT_EQ(order.back(), 0u);
  for (size_t i = 1; i < order.size(); ++i) {
    const uint32_t before = order[i - 1] % 3, here = order[i] % 3;
    ASSERT_TRUE(before > here || (before == here && order[i - 1] > order[i])) << i;
  }
}

TEST(DrawOrder, OfNothingWritesNothing) {
  const SplatCloud empty;
  const SplatInstance instance{&empty};
  DrawOrderWorkspace workspace;
  uint32_t order = 7;
  const uint64_t first_row = 0;
  float row[kDrawRowFloats] = {1, 2, 3, 4};
  const DrawOrderOutput output{&order, row, {&first_row, 1}};
  orderForDrawing({&instance, 1}, frontCamera(64, 48, 60, 3.0), output, workspace);
  orderForDrawing({}, frontCamera(64, 48, 60, 3.0), {&order, nullptr, {}}, workspace);
  EXPECT_EQ(order, 7u);
  EXPECT_EQ(row[0], 1.0f);
}

TEST(DrawOrder, TakesAnObjectScaledToZero) {
  const SplatCloud cloud = randomCloud({.count = 100, .degree = 3}, 5);
  const SplatInstance instances[] = {{&cloud, placement(1.0, 0, 0, 0)},
                                     {&cloud, placement(0.0, 0, 0.5, 0)}};
  const Camera camera = frontCamera(64, 48, 60, 3.0);
  const Ordered made = ordered(instances, camera, {0, 0});
  EXPECT_EQ(made.order, referenceOrder(instances, camera));
  for (size_t i = 0; i < made.order.size(); ++i) {
    if (made.order[i] < 100) continue;
    // Without a direction the colour is that of degree 0.
    const size_t splat = made.order[i] - 100;
    const float expected = std::max(0.0f, 0.5f + kShC0 * cloud.sh[splat * cloud.shStride()]);
    EXPECT_NEAR(colourOfRow(&made.rows[i * 4])[0], expected, 3e-4f);
  }
}

TEST(DrawOrder, RowsNameGeometryInstanceAndTheColourFromTheCamera) {
  const CloudRecipe recipe{.count = 500, .degree = 3};
  const SplatCloud cloud = randomCloud(recipe, 6);
  SplatInstance instances[] = {{&cloud, placement(1.0, 0, 0, 0)},
                               {&cloud, placement(0.5, 0.2, 0.1, 0)}};
  instances[1].grade.matrix = {0.5, 0.2, 0, 0, 1.5, 0, 0.1, 0, 0.7};
  instances[1].grade.offset = {0.1, -0.05, 0};
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    Camera camera = frontCamera(64, 48, 60, 3.0);
    camera.model = model;
    for (const int degree : {0, 2, 3}) {
      const Ordered made = ordered(instances, camera, {1000, 1000}, degree);
      RenderOptions options;
      options.sh_degree_limit = degree;
      const PlacedScene scene = placeScene(instances, camera, options);
      for (size_t i = 0; i < made.order.size(); ++i) {
        const uint32_t splat = made.order[i];
        const float* row = &made.rows[i * 4];
        ASSERT_EQ(row[0], float(1000 + splat % 500));
        ASSERT_EQ(row[1], float(splat / 500));
        double expected[3];
        splatColour(scene, scene.clouds[splat / 500], splat % 500, expected);
        for (size_t c = 0; c < 3; ++c) {
          // Half a step of the root at colours up to 4: sqrt(4 * 64) / 65535 = 2.4e-4.
          ASSERT_NEAR(static_cast<double>(colourOfRow(row)[c]), expected[c], 3e-4) << i;
        }
      }
    }
  }
}

TEST(DrawOrder, ColoursOfLinearCloudsAreDisplayValues) {
  SplatCloud cloud = testing::oneSplat(0.1f, 1.0f);
  cloud.colour_space = ColourSpace::kLinear;
  cloud.sh = {(0.2f - 0.5f) / kShC0, (3.0f - 0.5f) / kShC0, -10.0f};
  const SplatInstance instance{&cloud};
  const auto colour =
      colourOfRow(ordered({&instance, 1}, frontCamera(64, 48, 60, 3.0)).rows.data());
  EXPECT_NEAR(colour[0], linearToSrgb(0.2f), 3e-4f);
  EXPECT_NEAR(colour[1], linearToSrgb(3.0f), 3e-4f);
  EXPECT_EQ(colour[2], 0.0f);
}

TEST(DrawOrder, HasTheSameBitsForAnyNumberOfThreadsAndInUsedMemory) {
  const SplatCloud cloud = randomCloud({.count = 100000, .degree = 1}, 7);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(64, 48, 60, 1.0);
  Ordered one, four;
  withThreads(1, [&] { one = ordered({&instance, 1}, camera); });
  withThreads(4, [&] { four = ordered({&instance, 1}, camera); });
  EXPECT_EQ(one.order, four.order);
  EXPECT_EQ(one.rows, four.rows);

  DrawOrderWorkspace workspace;
  std::vector<uint32_t> again(cloud.size());
  orderForDrawing({&instance, 1}, frontCamera(64, 48, 60, 5.0), {again.data(), nullptr, {}},
                  workspace);
  const uint64_t held = workspace.bytes();
  orderForDrawing({&instance, 1}, camera, {again.data(), nullptr, {}}, workspace);
  EXPECT_EQ(again, one.order);
  EXPECT_EQ(workspace.bytes(), held);
  EXPECT_LE(held, drawOrderMemoryBound(cloud.size()));
}

std::string refusalOf(const SplatInstance& instance, const Camera& camera,
                      std::vector<uint64_t> first_rows) {
  std::vector<uint32_t> order(instance.cloud->size(), 7);
  std::vector<float> rows(instance.cloud->size() * kDrawRowFloats);
  DrawOrderWorkspace workspace;
  try {
    orderForDrawing({&instance, 1}, camera, {order.data(), rows.data(), first_rows}, workspace);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_EQ(order, std::vector<uint32_t>(order.size(), 7)) << "nothing is written on an error";
    return error.what();
  }
  ADD_FAILURE() << "not refused";
  return "";
}

TEST(DrawOrder, RefusesWhatIsNotFiniteOrHasTooManyRows) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const SplatCloud good = randomCloud({.count = 10}, 8);
  SplatCloud bad = good;
  bad.positions[5] = nan;
  const Camera camera = frontCamera(64, 48, 60, 3.0);
  EXPECT_NE(refusalOf({&bad}, camera, {0}).find("instance 0"), std::string::npos);
  Mat4d matrix = Mat4d::Identity();
  matrix(1, 2) = std::numeric_limits<double>::infinity();
  EXPECT_NE(refusalOf({&good, matrix}, camera, {0}).find("instance 0: matrix holds inf"),
            std::string::npos);
  matrix = Mat4d::Identity();
  matrix(3, 0) = 1;
  EXPECT_NE(refusalOf({&good, matrix}, camera, {0}).find("last row"), std::string::npos);
  Camera broken = camera;
  broken.world_to_camera(0, 3) = static_cast<double>(nan);
  EXPECT_NE(refusalOf({&good}, broken, {0}), "");
  EXPECT_NE(refusalOf({&good}, camera, {kMaxDrawRows - 9}).find("16777217"), std::string::npos);
  EXPECT_NE(refusalOf({&good}, camera, {}).find("first_rows has 0"), std::string::npos);
}

TEST(DrawOrder, StopsWhenCancelled) {
  const SplatCloud cloud = randomCloud({.count = 20000}, 9);
  const SplatInstance instance{&cloud};
  std::vector<uint32_t> order(cloud.size());
  DrawOrderWorkspace workspace;
  Progress progress;
  progress.cancel();
  EXPECT_THROW(orderForDrawing({&instance, 1}, frontCamera(64, 48, 60, 3.0),
                               {order.data(), nullptr, {}}, workspace, &progress),
               Error);
}

TEST(DrawGeometry, HoldsEverySplatInTwelveFloats) {
  const SplatCloud cloud = randomCloud({.count = 9000}, 10);
  std::vector<float> geometry(cloud.size() * kDrawGeometryFloats, -1.0f);
  packDrawGeometry(cloud, geometry.data());
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float* row = &geometry[i * kDrawGeometryFloats];
    for (size_t k = 0; k < 3; ++k) {
      ASSERT_EQ(row[k], cloud.positions[i * 3 + k]);
      ASSERT_EQ(row[8 + k], cloud.scales[i * 3 + k]);
    }
    ASSERT_EQ(row[3], cloud.opacities[i]);
    for (size_t k = 0; k < 4; ++k) ASSERT_EQ(row[4 + k], cloud.rotations[i * 4 + k]);
    ASSERT_EQ(row[11], 0.0f);
  }
}

}  // namespace
}  // namespace stipple
