#include "fit/registration/target_pictures.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "base/error.h"
#include "data/views/view_resample.h"
#include "math/affine.h"
#include "math/colour.h"
#include "math/ray_meeting.h"

namespace stipple {

namespace {

constexpr size_t kFewestViews = 2;
[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

/// [H,W,4] linear colour times coverage, and coverage.
Image coveredImage(const ViewSource& views, size_t view) {
  ViewPicture picture = views.load(view);
  if (picture.alpha.empty() && picture.weights.empty()) {
    refuse("'" + views.name(view) +
           "' has neither alpha nor a mask; a mesh is fitted to images that show where it ends");
  }
  const bool is_masked = picture.alpha.empty();
  const bool is_display = views.colourSpace() == ColourSpace::kDisplay;
  Image image{picture.width, picture.height, 4, {}, Transfer::kLinear};
  image.pixels.assign(image.pixelCount() * 4, 0.0f);
  for (size_t i = 0; i < image.pixelCount(); ++i) {
    const float alpha = is_masked ? (picture.weights[i] > 0 ? 1.0f : 0.0f) : picture.alpha[i];
    if (!(alpha > 0)) continue;
    for (size_t c = 0; c < 3; ++c) {
      const float value = is_masked ? picture.colour[i * 3 + c] : picture.colour[i * 3 + c] / alpha;
      image.pixels[i * 4 + c] = alpha * (is_display ? srgbToLinear(value) : value);
    }
    image.pixels[i * 4 + 3] = alpha;
  }
  return image;
}

/// The middle of what an image covers, pixels, and how many pixels that is.
struct Covered {
  double x = 0, y = 0, area = 0;
};

Covered coveredOf(const TargetPicture& picture) {
  Covered covered;
  for (uint32_t y = 0; y < picture.camera.height; ++y) {
    for (uint32_t x = 0; x < picture.camera.width; ++x) {
      const double alpha =
          static_cast<double>(picture.pixels[(size_t{y} * picture.camera.width + x) * 4 + 3]);
      covered.x += alpha * (x + 0.5);
      covered.y += alpha * (y + 0.5);
      covered.area += alpha;
    }
  }
  if (covered.area > 0) {
    covered.x /= covered.area;
    covered.y /= covered.area;
  }
  return covered;
}

}  // namespace

std::vector<TargetPicture> targetPictures(const ViewSource& views, uint32_t side,
                                          Progress* progress) {
  if (views.count() < kFewestViews) {
    refuse("there is " + std::to_string(views.count()) +
           " image; at least two are needed to fit a mesh to");
  }
  std::vector<TargetPicture> pictures;
  double covered = 0;
  for (size_t i = 0; i < views.count(); ++i) {
    advance(progress, 0, "Reading the images");
    Image image = coveredImage(views, i);
    const uint32_t longer = std::max(image.width, image.height);
    if (longer > side) {
      const double factor = static_cast<double>(side) / longer;
      const auto scaled = [&](uint32_t pixels) {
        return std::max(1u, static_cast<uint32_t>(std::lround(pixels * factor)));
      };
      image = areaAverage(image, scaled(image.width), scaled(image.height));
    }
    TargetPicture picture{resized(views.camera(i), image.width, image.height),
                          std::move(image.pixels)};
    requireImagePlane(picture.camera, "fitting a mesh to images");
    covered += coveredOf(picture).area;
    pictures.push_back(std::move(picture));
  }
  if (!(covered > 0)) refuse("all images are empty; a mesh is fitted to what they show");
  return pictures;
}

UnitBall ballOfPictures(std::span<const TargetPicture> pictures) {
  struct Ray {
    const Camera& camera;
    double area;
  };
  std::vector<Ray> rays;
  std::vector<Line> lines;
  for (const TargetPicture& picture : pictures) {
    const Covered covered = coveredOf(picture);
    if (!(covered.area > 0)) continue;
    const Camera& camera = picture.camera;
    const Mat3d to_world = linearPart(camera.world_to_camera).transpose();
    Vec3d place = cameraCentre(camera);
    Vec3d direction((covered.x - camera.cx) / camera.fx, (covered.y - camera.cy) / camera.fy, 1);
    if (camera.model == CameraModel::kOrthographic) {
      place = to_world *
              (Vec3d(direction.x(), direction.y(), 0) - translationPart(camera.world_to_camera));
      direction = Vec3d(0, 0, 1);
    }
    lines.push_back({place, (to_world * direction).normalized()});
    rays.push_back({camera, covered.area});
  }
  const std::optional<Vec3d> middle = nearestToLines(lines);
  if (!middle) refuse("the cameras all look the same way; their images leave the depth open");
  UnitBall ball;
  ball.middle = *middle;
  double sum = 0;
  for (const Ray& ray : rays) {
    const Vec3d seen = linearPart(ray.camera.world_to_camera) * ball.middle +
                       translationPart(ray.camera.world_to_camera);
    const double pixels = std::sqrt(ray.area / std::numbers::pi);
    const bool is_perspective = ray.camera.model == CameraModel::kPerspective;
    if (is_perspective && !(seen.z() > ray.camera.near_plane)) {
      refuse("what the images show is not before all of their cameras");
    }
    sum += pixels / ray.camera.fx * (is_perspective ? seen.z() : 1.0);
  }
  ball.radius = sum / static_cast<double>(rays.size());
  return ball;
}

}  // namespace stipple
