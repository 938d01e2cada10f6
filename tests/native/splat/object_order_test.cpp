#include "splat/render/object_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/cpu/rays/ray_tiles.h"
#include "splat/random_scene.h"
#include "splat/render/accurate_render.h"

// Objects that are drawn one after the other: brute force composites the picture of each in double.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using ::testing::HasSubstr;
using testing::randomCloud;

/// Objects in each other, or one behind the other, in an order that is none of depth.
class Objects {
 public:
  explicit Objects(std::initializer_list<double> depths, size_t count = 300) {
    CloudRecipe recipe;
    recipe.count = count;
    recipe.degree = 1;
    // So that no pixel ends early: then the picture of all is made of the pictures of each.
    recipe.opacity_min = 0.02;
    recipe.opacity_max = 0.1;
    for (size_t i = 0; i < depths.size(); ++i) {
      clouds_.push_back(randomCloud(recipe, 40 + static_cast<uint32_t>(i)));
    }
    for (const SplatCloud& cloud : clouds_) {
      SplatInstance instance = testing::instanceOf(cloud);
      instance.object_to_world(1, 3) = depths.begin()[list_.size()];
      list_.push_back(instance);
    }
  }

  std::vector<SplatInstance>& list() { return list_; }

  /// Mean of the view depths of the centres.
  double depthOf(size_t object, const Camera& camera) const {
    const SplatInstance& instance = list_[object];
    const Mat4d to_view = camera.world_to_camera * instance.object_to_world;
    double sum = 0;
    for (size_t i = 0; i < instance.cloud->size(); ++i) {
      const float* at = &instance.cloud->positions[i * 3];
      const Vec4d centre{static_cast<double>(at[0]), static_cast<double>(at[1]),
                         static_cast<double>(at[2]), 1.0};
      const Vec4d seen = to_view * centre;
      sum += hasImagePlane(camera) ? seen[2] : Vec3d(seen[0], seen[1], seen[2]).norm();
    }
    return sum / static_cast<double>(instance.cloud->size());
  }

  /// Colours of draw(instance), one over the other.
  template <typename Draw>
  std::vector<double> composited(const Camera& camera, Draw draw) const {
    std::vector<size_t> order(list_.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return depthOf(a, camera) < depthOf(b, camera); });
    std::vector<double> out(size_t{camera.width} * camera.height * 4, 0.0);
    for (const size_t object : order) {
      const auto picture = draw(list_[object]);
      for (size_t i = 0; i < out.size(); i += 4) {
        const double left = 1 - out[i + 3];
        for (size_t c = 0; c < 4; ++c) out[i + c] += left * static_cast<double>(picture[i + c]);
      }
    }
    return out;
  }

 private:
  std::vector<SplatCloud> clouds_;
  std::vector<SplatInstance> list_;
};

RenderOptions options(ObjectOrder order) {
  RenderOptions made;
  made.object_order = order;
  return made;
}

template <typename T>
double largestDifference(const std::vector<T>& picture, const std::vector<double>& wanted) {
  EXPECT_EQ(picture.size(), wanted.size());
  double largest = 0;
  for (size_t i = 0; i < wanted.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(picture[i]) - wanted[i]));
  }
  return largest;
}

const Camera kCamera = frontCamera(70, 50, 60, 4);

TEST(ObjectOrder, EachObjectIsOneLayer) {
  Objects objects({0.3, -0.2, 0.1, -0.2});
  const auto wanted = objects.composited(kCamera, [](const SplatInstance& one) {
    return renderReference({&one, 1}, kCamera, {}).colour;
  });
  const RenderOptions apart = options(ObjectOrder::kApart);
  // The same sums in another order of additions.
  EXPECT_LT(largestDifference(renderReference(objects.list(), kCamera, apart).colour, wanted),
            1e-13);
  // Single precision, as the tiled renderer is of the reference.
  EXPECT_LT(largestDifference(renderTiled(objects.list(), kCamera, apart).colour, wanted), 1e-6);
  // The order matters here: else this test would show nothing.
  EXPECT_GT(largestDifference(renderReference(objects.list(), kCamera, {}).colour, wanted), 0.01);
}

TEST(ObjectOrder, AlongRaysToo) {
  Objects objects({0.3, -0.2, 0.1});
  const RenderOptions apart = options(ObjectOrder::kApart);
  RayOptions rays;
  rays.order = RayOrder::kCentre;
  for (const RayProjection projection : {RayProjection::kRay, RayProjection::kAffine}) {
    rays.projection = projection;
    const auto wanted = objects.composited(kCamera, [&](const SplatInstance& one) {
      return renderRays({&one, 1}, kCamera, {}, rays).colour;
    });
    // Each of the pictures is rounded to float32; the tiles blend single precision alphas.
    EXPECT_LT(largestDifference(renderRays(objects.list(), kCamera, apart, rays).colour, wanted),
              3e-7);
    EXPECT_LT(
        largestDifference(renderRayTiles(objects.list(), kCamera, apart, rays).colour, wanted),
        3e-6);
    EXPECT_GT(largestDifference(renderRays(objects.list(), kCamera, {}, rays).colour, wanted),
              0.01);
  }
  Camera around = kCamera;
  around.model = CameraModel::kEquirectangular;
  around.fx = 70 / 6.3;
  around.fy = 50 / 3.2;
  rays.projection = RayProjection::kRay;
  const auto wanted = objects.composited(around, [&](const SplatInstance& one) {
    return renderRays({&one, 1}, around, {}, rays).colour;
  });
  EXPECT_LT(largestDifference(renderRays(objects.list(), around, apart, rays).colour, wanted),
            3e-7);
}

TEST(ObjectOrder, DrawsTheSameBitsWhereNoTwoObjectsShareARangeOfDepth) {
  Objects objects({3, -2.5, 6, 9.1});
  for (const Precision precision : {Precision::kFloat, Precision::kDouble}) {
    for (const RayProjection projection : {RayProjection::kAffine, RayProjection::kRay}) {
      RenderAccuracy accuracy;
      accuracy.precision = precision;
      accuracy.projection = projection;
      RenderWorkspace workspace;
      RenderResult together, apart;
      renderAccurate(objects.list(), kCamera, options(ObjectOrder::kTogether), accuracy, workspace,
                     together);
      renderAccurate(objects.list(), kCamera, options(ObjectOrder::kApart), accuracy, workspace,
                     apart);
      EXPECT_EQ(together.colour, apart.colour);
      EXPECT_EQ(together.depth, apart.depth);
    }
  }
}

TEST(ObjectOrder, EqualObjectsComeInTheirOrder) {
  Objects objects({0.0}, 200);
  SplatCloud red = *objects.list()[0].cloud, blue = red;
  for (size_t i = 0; i < red.size(); ++i) {
    for (size_t k = 0; k < red.shStride(); ++k) {
      red.sh[i * red.shStride() + k] = k == 0 ? 1.7f : k < 3 ? -1.7f : 0.0f;
      blue.sh[i * red.shStride() + k] = k == 2 ? 1.7f : k < 3 ? -1.7f : 0.0f;
    }
  }
  const SplatInstance of_red = testing::instanceOf(red), of_blue = testing::instanceOf(blue);
  const RenderOptions apart = options(ObjectOrder::kApart);
  const auto sums = [&](std::vector<SplatInstance> list) {
    const RenderResult picture = renderTiled(list, kCamera, apart);
    double red_sum = 0, blue_sum = 0;
    for (size_t i = 0; i < picture.colour.size(); i += 4) {
      red_sum += static_cast<double>(picture.colour[i]);
      blue_sum += static_cast<double>(picture.colour[i + 2]);
    }
    return red_sum - blue_sum;
  };
  EXPECT_GT(sums({of_red, of_blue}), 1.0);
  EXPECT_LT(sums({of_blue, of_red}), -1.0);
}

TEST(ObjectOrder, OneObjectIsDrawnAsBefore) {
  Objects objects({0.0});
  EXPECT_EQ(renderTiled(objects.list(), kCamera, options(ObjectOrder::kApart)).colour,
            renderTiled(objects.list(), kCamera, {}).colour);
  PlacedScene scene = placeScene(objects.list(), kCamera, options(ObjectOrder::kApart));
  EXPECT_FALSE(scene.objects_apart);
}

TEST(ObjectOrder, IsThatOfAnyNumberOfThreadsAndRange) {
  // Objects that share ranges of slots, and one of many; the last is empty.
  Objects objects({0.2, 0.1, 0.3, -0.1, 0.0}, 5000);
  const SplatCloud nothing;
  objects.list().push_back(testing::instanceOf(nothing));
  const RenderOptions apart = options(ObjectOrder::kApart);
  RenderResult one, many;
  withThreads(1, [&] { one = renderTiled(objects.list(), kCamera, apart); });
  withThreads(5, [&] { many = renderTiled(objects.list(), kCamera, apart); });
  EXPECT_EQ(one.colour, many.colour);
}

TEST(ObjectOrder, RefusesWhatOrdersSingleSplats) {
  Objects objects({0.0, 0.1});
  RenderOptions apart = options(ObjectOrder::kApart);
  const auto refusal = [&](auto draw) -> std::string {
    try {
      draw();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kUnsupported);
      return error.what();
    }
    return "nothing was refused";
  };
  RayOptions rays;
  EXPECT_THAT(refusal([&] { renderRays(objects.list(), kCamera, apart, rays); }),
              HasSubstr("only the order of their centres is allowed"));
  EXPECT_THAT(refusal([&] { renderRayTiles(objects.list(), kCamera, apart, rays); }),
              HasSubstr("only the order of their centres is allowed"));
  std::vector<float> depth(size_t{kCamera.width} * kCamera.height, 1e10f);
  apart.surface = {kCamera.width, kCamera.height, depth.data(), nullptr, nullptr};
  // A surface that stands nowhere: a picture of Cycles without meshes.
  renderTiled(objects.list(), kCamera, apart);
  depth.back() = 4;
  EXPECT_THAT(refusal([&] { renderTiled(objects.list(), kCamera, apart); }),
              HasSubstr("no mesh can hide splats"));
  apart.surface = {};
  apart.object_order = static_cast<ObjectOrder>(2);
  EXPECT_THROW(renderTiled(objects.list(), kCamera, apart), Error);
}

}  // namespace
}  // namespace stipple
