#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/parallel.h"
#include "math/cross_product.h"
#include "splat/random_scene.h"
#include "splat/render/ray_render.h"
#include "splat/render/ray_splats.h"

// Panoramas and fisheyes: closed forms of round splats in every direction, brute force without
// tiles, and perspective pictures of the same directions.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::everyBuffer;
using testing::instanceOf;
using testing::oneSplat;
using testing::randomCloud;

constexpr double kPi = std::numbers::pi;
constexpr CameraModel kWide[] = {CameraModel::kEquirectangular, CameraModel::kFisheyeEquidistant,
                                 CameraModel::kFisheyeEquisolid};

/// In the middle of the world; camera x, y, z = world x, -z, y. The whole sphere.
Camera around(CameraModel model, uint32_t width, uint32_t height) {
  Camera camera;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  camera.cx = width / 2.0;
  camera.cy = height / 2.0;
  camera.fx = width / (2 * kPi);
  camera.fy = height / (model == CameraModel::kEquirectangular ? kPi : 2 * kPi);
  if (model == CameraModel::kFisheyeEquisolid) camera.fx = camera.fy = width / 4.0;
  camera.world_to_camera << 1, 0, 0, 0,  //
      0, 0, -1, 0,                       //
      0, 1, 0, 0,                        //
      0, 0, 0, 1;
  return camera;
}

double value(const std::vector<float>& numbers, size_t i) {
  return static_cast<double>(numbers[i]);
}

/// Another way to the directions than the library's: by rotating the axis.
bool look(const Camera& camera, uint32_t column, uint32_t row, Vec3d& direction) {
  const double x = (column + 0.5 - camera.cx) / camera.fx;
  const double y = (row + 0.5 - camera.cy) / camera.fy;
  if (camera.model == CameraModel::kEquirectangular) {
    direction = {std::sin(x) * std::cos(y), std::sin(y), std::cos(x) * std::cos(y)};
    return std::abs(y) <= kPi / 2;
  }
  const double turn = std::atan2(y, x);
  const double radius = std::sqrt(x * x + y * y);
  const bool is_equisolid = camera.model == CameraModel::kFisheyeEquisolid;
  if (is_equisolid && radius > 2) return false;
  const double angle = is_equisolid ? std::acos(1 - radius * radius / 2) : radius;
  direction = {std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), std::cos(angle)};
  return angle <= (camera.field_of_view > 0 ? camera.field_of_view / 2 : kPi);
}

TEST(WideCamera, ARoundSplatFallsWithTheAngleWhereverItIs) {
  // Ahead, behind (at the seam of the panorama and the rim of the fisheye), at both poles, between.
  const Vec3d places[] = {{0, 0, 2}, {0, 0.01, -2}, {0.3, 0, -2}, {0, -2, 0},
                          {0, 2, 0}, {2, 0, 0},     {-1, 1, -1}};
  const double sigma = 0.4;
  for (const CameraModel model : kWide) {
    const bool is_panorama = model == CameraModel::kEquirectangular;
    const Camera camera = around(model, 100, is_panorama ? 50 : 100);
    for (const Vec3d& place : places) {
      SplatCloud cloud = oneSplat(static_cast<float>(sigma), 0.8f);
      // World of camera: x, z, -y.
      for (size_t i = 0; i < 3; ++i) {
        cloud.positions[i] = static_cast<float>(i == 0 ? place[0] : i == 1 ? place[2] : -place[1]);
      }
      const Vec3d centre = place.cast<float>().cast<double>();
      const SplatInstance instance = instanceOf(cloud);
      const RenderResult picture =
          renderRays({&instance, 1}, camera, everyBuffer(), unlimitedRays());
      double most = 0;
      for (uint32_t y = 0; y < camera.height; ++y) {
        for (uint32_t x = 0; x < camera.width; ++x) {
          Vec3d ray;
          const size_t i = size_t{y} * camera.width + x;
          double alpha = 0, along = 1e10;
          if (look(camera, x, y, ray) && centre.dot(ray) > 0.01) {
            const double across = (centre - centre.dot(ray) * ray).norm();
            alpha = double{0.8f} * std::exp(-0.5 * across * across / (sigma * sigma));
            along = centre.dot(ray);
          }
          most = std::max(most, alpha);
          // float32 of the result; the scale is a float too.
          ASSERT_NEAR(value(picture.colour, i * 4 + 3), alpha < 1e-9 ? 0 : alpha, 3e-7)
              << "model " << static_cast<int>(model) << " at " << x << ", " << y;
          // Unlimited rays leave out what is fainter than 1e-9; alpha above has rounded here.
          if (alpha > 1e-8) {
            ASSERT_NEAR(value(picture.depth, i), along, 1e-6);
          }
        }
      }
      EXPECT_GT(most, 0.6) << "the splat is in the picture";
    }
  }
}

TEST(WideCamera, TilesLeaveNothingOut) {
  CloudRecipe recipe;
  recipe.size_min = 1e-4;
  const SplatCloud cloud = randomCloud(recipe, 5);  // all around the camera, some around it
  const SplatInstance instance = instanceOf(cloud);
  for (const CameraModel model : kWide) {
    const bool is_panorama = model == CameraModel::kEquirectangular;
    // The whole sphere in tiles of a part, of a half and in one tile.
    for (const uint32_t width : {150u, 40u, 7u, 1u}) {
      const Camera camera = around(model, width, is_panorama ? (width + 1) / 2 : width);
      for (const RayOrder order : {RayOrder::kCentre, RayOrder::kResponse}) {
        RayOptions rays;
        rays.order = order;
        const RenderOptions options = everyBuffer(LowPass::kClassic);
        const RenderResult picture = renderRays({&instance, 1}, camera, options, rays);
        const PlacedScene scene = placeSceneForRays({&instance, 1}, camera, options);
        const std::vector<RaySplat> splats = raySplats(scene, rays.limits.least_alpha);
        ASSERT_GT(splats.size(), 100u);
        ReferenceResult all;
        sizeResult(camera, options, all);
        for (uint32_t y = 0; y < camera.height; ++y) {
          for (uint32_t x = 0; x < camera.width; ++x) {
            const size_t i = size_t{y} * camera.width + x;
            DoublePixel pixel(options, 0);
            Vec3d ray;
            std::vector<std::pair<double, const RaySplat*>> hits;
            if (look(camera, x, y, ray)) {
              for (const RaySplat& splat : splats) {
                const double place = respond(splat, Vec3d::Zero(), ray).place;
                if (place >= camera.near_plane) hits.push_back({place, &splat});
              }
            }
            std::stable_sort(hits.begin(), hits.end(), [&](const auto& a, const auto& b) {
              if (order == RayOrder::kResponse) return a.first < b.first;
              return depthKey(a.second->centre.norm()) < depthKey(b.second->centre.norm());
            });
            for (const auto& [place, splat] : hits) {
              const double distance = respond(*splat, Vec3d::Zero(), ray).squared_distance;
              const double alpha = splat->opacity * std::exp(-0.5 * distance);
              if (alpha < rays.limits.least_alpha) continue;
              if (!pixel.add(std::min(alpha, kMaxAlpha), splat->colour, place, false)) break;
            }
            pixel.write(options, i, all);
          }
        }
        for (size_t i = 0; i < all.colour.size(); ++i) {
          // A ray that is rounded in another way may pass 1/255 on the other side: not in these.
          ASSERT_NEAR(value(picture.colour, i), all.colour[i], 3e-7)
              << "model " << static_cast<int>(model) << ", width " << width << ", value " << i;
        }
      }
    }
  }
}

/// Where a wide picture shows a direction, pixels.
Vec2d seenAt(const Camera& camera, const Vec3d& direction) {
  if (camera.model == CameraModel::kEquirectangular) {
    return {camera.cx + camera.fx * std::atan2(direction[0], direction[2]),
            camera.cy + camera.fy * std::asin(direction[1] / direction.norm())};
  }
  const double across = std::hypot(direction[0], direction[1]);
  const double angle = std::atan2(across, direction[2]);
  const double radius =
      camera.model == CameraModel::kFisheyeEquisolid ? 2 * std::sin(angle / 2) : angle;
  const double factor = across > 0 ? radius / across : 0;
  return {camera.cx + camera.fx * factor * direction[0],
          camera.cy + camera.fy * factor * direction[1]};
}

TEST(WideCamera, EveryFaceOfACubeAgreesWithAPerspectivePicture) {
  // One-pixel pictures of the wide camera, moved so that its pixel looks exactly where a pixel of
  // the face does: no interpolation stands between the two.
  CloudRecipe recipe;
  recipe.count = 150;
  recipe.degree = 2;
  recipe.size_min = 0.02;
  recipe.size_max = 0.12;  // a face leaves out splats centred behind it, whatever their tails
  SplatCloud cloud = randomCloud(recipe, 12);
  for (float& value : cloud.positions) value *= 3;
  const SplatInstance instance = instanceOf(cloud);
  RayOptions rays;  // by response: the order of centres is by z there and by distance here
  rays.limits = unlimitedRays().limits;
  constexpr uint32_t kSide = 6;
  for (int face = 0; face < 6; ++face) {
    Mat3d turn;
    const int forward = face / 2;
    turn.setZero();
    turn(2, forward) = face % 2 == 0 ? 1 : -1;
    turn(0, (forward + 1) % 3) = 1;
    turn.row(1) = crossProduct(Vec3d(turn.row(2)), Vec3d(turn.row(0)));
    Camera flat;
    flat.width = flat.height = kSide;
    flat.fx = flat.fy = kSide / 2.0;
    flat.cx = flat.cy = kSide / 2.0;
    flat.near_plane = 1e-3;
    // Camera of the cube: that of around(), turned.
    const Camera base = around(CameraModel::kEquirectangular, 1, 1);
    flat.world_to_camera = base.world_to_camera;
    flat.world_to_camera.topLeftCorner<3, 3>() =
        turn * Mat3d(base.world_to_camera.topLeftCorner<3, 3>());
    const RenderResult picture = renderRays({&instance, 1}, flat, everyBuffer(), rays);
    for (const CameraModel model : kWide) {
      for (uint32_t y = 0; y < kSide; ++y) {
        for (uint32_t x = 0; x < kSide; ++x) {
          const Vec3d ray = turn.transpose() *
                            Vec3d((x + 0.5 - flat.cx) / flat.fx, (y + 0.5 - flat.cy) / flat.fy, 1);
          Camera wide = around(model, 360, model == CameraModel::kEquirectangular ? 180 : 360);
          const Vec2d place = seenAt(wide, ray);
          wide.width = wide.height = 1;
          wide.cx += 0.5 - place[0];
          wide.cy += 0.5 - place[1];
          wide.near_plane = flat.near_plane;
          const RenderResult pixel = renderRays({&instance, 1}, wide, everyBuffer(), rays);
          const size_t i = size_t{y} * kSide + x;
          for (size_t c = 0; c < 4; ++c) {
            // Rays of the two agree to 1e-15; colours are float32, tails of splats behind the face
            // are up to 1e-5.
            ASSERT_NEAR(pixel.colour[c], picture.colour[i * 4 + c], 1e-5f)
                << "model " << static_cast<int>(model) << ", face " << face << " at " << x << ", "
                << y;
          }
        }
      }
    }
  }
}

TEST(WideCamera, TheSeamIsNowhere) {
  // Turning the camera by whole pixels rolls the panorama.
  CloudRecipe recipe;
  recipe.count = 100;
  recipe.size_min = 0.05;
  const SplatCloud cloud = randomCloud(recipe, 2);
  SplatInstance instance = instanceOf(cloud);
  const Camera camera = around(CameraModel::kEquirectangular, 80, 40);
  const RenderResult ahead = renderRays({&instance, 1}, camera, everyBuffer(LowPass::kClassic), {});
  const uint32_t shift = 29;
  const double turn = 2 * kPi * shift / 80;
  // About the world's z: what is to the right comes to the middle.
  instance.object_to_world.topLeftCorner<2, 2>() << std::cos(turn), -std::sin(turn), std::sin(turn),
      std::cos(turn);
  const RenderResult turned =
      renderRays({&instance, 1}, camera, everyBuffer(LowPass::kClassic), {});
  size_t moved = 0;
  for (uint32_t y = 0; y < 40; ++y) {
    for (uint32_t x = 0; x < 80; ++x) {
      const size_t a = (size_t{y} * 80 + (x + shift) % 80) * 4, b = (size_t{y} * 80 + x) * 4;
      for (size_t c = 0; c < 4; ++c) {
        // Alphas at 1/255 may fall on the other side: that much of one splat.
        ASSERT_NEAR(ahead.colour[a + c], turned.colour[b + c], 5e-3f) << x << ", " << y;
        moved += std::abs(ahead.colour[a + c] - turned.colour[b + c]) > 1e-5f;
      }
    }
  }
  EXPECT_LT(moved, 40u);
}

TEST(WideCamera, AFisheyeSeesItsFieldOfViewAndNothingElse) {
  SplatCloud cloud = oneSplat(100.0f, 0.9f);
  cloud.positions = {0, 0.5f, 0};
  const SplatInstance instance = instanceOf(cloud);
  for (const CameraModel model :
       {CameraModel::kFisheyeEquidistant, CameraModel::kFisheyeEquisolid}) {
    Camera camera = around(model, 60, 60);
    camera.fx = camera.fy = model == CameraModel::kFisheyeEquisolid ? 30 : 60 / kPi;
    camera.field_of_view = 120 * kPi / 180;
    RenderOptions options = everyBuffer();
    options.with_background = true;
    options.background[0] = options.background[1] = options.background[2] = 1;
    const RenderResult picture = renderRays({&instance, 1}, camera, options, {});
    size_t inside = 0;
    for (uint32_t y = 0; y < 60; ++y) {
      for (uint32_t x = 0; x < 60; ++x) {
        const double radius = std::hypot(x + 0.5 - 30, y + 0.5 - 30) / camera.fx;
        const bool sees = model == CameraModel::kFisheyeEquisolid
                              ? radius <= 2 * std::sin(camera.field_of_view / 4)
                              : radius <= camera.field_of_view / 2;
        const size_t i = size_t{y} * 60 + x;
        ASSERT_EQ(picture.colour[i * 4 + 3], sees ? 1.0f : 0.0f);
        ASSERT_EQ(picture.colour[i * 4] > 0, sees);
        if (!sees) {
          ASSERT_EQ(picture.depth[i], kEmptyDepth);
        }
        inside += sees;
      }
    }
    EXPECT_GT(inside, 500u);
    EXPECT_LT(inside, 3000u);
  }
}

std::string refusalOf(const Camera& camera) {
  try {
    validate(camera);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(WideCamera, RefusesWhatItsModelDoesNotHold) {
  Camera camera = around(CameraModel::kFisheyeEquisolid, 64, 64);
  camera.field_of_view = 400 * kPi / 180;
  EXPECT_EQ(refusalOf(camera), "the fisheye's field of view is 400 degrees; 0 to 360 is allowed");
  camera.field_of_view = 2 * kPi;
  EXPECT_EQ(refusalOf(camera), "");
  camera.model = CameraModel::kPerspective;
  EXPECT_EQ(refusalOf(camera),
            "camera.field_of_view is 6.28319; it is that of fisheyes, for other cameras 0 is "
            "allowed");
  camera = around(CameraModel::kEquirectangular, 64, 32);
  EXPECT_EQ(refusalOf(camera), "");
  camera.fx /= 1.2;
  EXPECT_EQ(refusalOf(camera), "the panorama is 432 degrees wide; at most 360 is allowed");
  const SplatCloud cloud = oneSplat(1, 0.5f);
  const SplatInstance instance = instanceOf(cloud);
  for (const CameraModel model : kWide) {
    camera = around(model, 64, 32);
    EXPECT_THROW(renderTiled({&instance, 1}, camera, {}), Error);
    EXPECT_THROW(renderReference({&instance, 1}, camera, {}), Error);
  }
}

TEST(WideCamera, GivesTheSameForAnyNumberOfThreads) {
  const SplatCloud cloud = randomCloud({}, 4);
  const SplatInstance instance = instanceOf(cloud);
  const Camera camera = around(CameraModel::kEquirectangular, 150, 75);
  RenderResult one, two;
  withThreads(1, [&] { one = renderRays({&instance, 1}, camera, everyBuffer(), {}); });
  withThreads(2, [&] { two = renderRays({&instance, 1}, camera, everyBuffer(), {}); });
  EXPECT_EQ(one.colour, two.colour);
  EXPECT_EQ(one.depth, two.depth);
}

}  // namespace
}  // namespace stipple
