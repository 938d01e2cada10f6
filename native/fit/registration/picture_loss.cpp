// Based on: Jung, Kim et al., Mesh Density Adaptation for Template-based Shape Reconstruction,
// SIGGRAPH 2023, its inverse rendering. Differs: the light is not given but found.
#include "fit/registration/picture_loss.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "data/views/view_resample.h"
#include "math/affine.h"
#include "math/colour.h"
#include "math/ray_meeting.h"
#include "mesh/adapt/moving_samples.h"

namespace stipple {

namespace {

constexpr size_t kFewestViews = 2;
/// What nearly nothing covers has no colour to speak of.
constexpr float kLeastAlpha = 0.5f;

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
    const double pixels = std::sqrt(ray.area / M_PI);
    const bool is_perspective = ray.camera.model == CameraModel::kPerspective;
    if (is_perspective && !(seen.z() > ray.camera.near_plane)) {
      refuse("what the images show is not before all of their cameras");
    }
    sum += pixels / ray.camera.fx * (is_perspective ? seen.z() : 1.0);
  }
  ball.radius = sum / static_cast<double>(rays.size());
  return ball;
}

PictureLoss::PictureLoss(std::vector<TargetPicture> pictures, const MeshLinks& links)
    : pictures_(std::move(pictures)), links_(links), renderer_(links.triangles()) {
  size_t numbers = 0;
  for (const TargetPicture& picture : pictures_) numbers += picture.pixels.size();
  share_ = 1.0 / static_cast<double>(numbers);
}

std::vector<MeshView> PictureLoss::drawAll(std::span<const Vec3d> positions,
                                           std::span<const Vec3d> colours) const {
  std::vector<MeshView> views(pictures_.size());
  parallelFor(views.size(), 1, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      views[i] = renderer_.draw(pictures_[i].camera, positions, colours);
    }
  });
  return views;
}

std::vector<Vec3d> PictureLoss::coloursOf(std::span<const Vec3d> normals) const {
  std::vector<Vec3d> colours(normals.size());
  for (size_t v = 0; v < colours.size(); ++v) colours[v] = light_.on(normals[v]);
  return colours;
}

void PictureLoss::findLight(std::span<const MeshView> views, std::span<const Vec3d> normals) {
  std::vector<HarmonicLight::Terms> terms(normals.size());
  for (size_t v = 0; v < terms.size(); ++v) terms[v] = HarmonicLight::terms(normals[v]);
  std::vector<LightFit> fits(views.size());
  const std::span<const uint32_t> triangles = links_.triangles();
  parallelFor(views.size(), 1, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const TargetPicture& picture = pictures_[i];
      for (uint32_t pixel = 0; pixel < views[i].triangles.size(); ++pixel) {
        const uint32_t t = views[i].triangles[pixel];
        const float* shown = &picture.pixels[size_t{pixel} * 4];
        if (t == MeshView::kNoTriangle || !(shown[3] > kLeastAlpha)) continue;
        const Vec3d weights = MeshRenderer::weightsAt(views[i], picture.camera, pixel);
        const HarmonicLight::Terms here = weights[0] * terms[triangles[size_t{t} * 3]] +
                                          weights[1] * terms[triangles[size_t{t} * 3 + 1]] +
                                          weights[2] * terms[triangles[size_t{t} * 3 + 2]];
        const Vec3d colour = Vec3d(static_cast<double>(shown[0]), static_cast<double>(shown[1]),
                                   static_cast<double>(shown[2])) /
                             static_cast<double>(shown[3]);
        fits[i].add(here, colour);
      }
    }
  });
  LightFit all;
  for (const LightFit& of_view : fits) all.add(of_view);
  if (all.isEmpty()) return;  // no image shows the mesh where it is
  light_ = all.light();
  has_light_ = true;
}

/// What a look at all pictures gives.
struct PictureLoss::Step {
  std::vector<Vec3d> normals, colours;
  std::vector<MeshView> views;
};

double PictureLoss::addGradient(std::span<const Vec3d> positions, double outline_weight,
                                std::span<Vec3d> gradient) {
  Step step;
  step.normals = vertexNormals(links_, positions);
  if (!has_light_) findLight(drawAll(positions, coloursOf(step.normals)), step.normals);
  step.colours = coloursOf(step.normals);
  step.views = drawAll(positions, step.colours);
  const size_t count = positions.size();
  std::vector<double> losses(pictures_.size(), 0.0);
  std::vector<std::vector<Vec3d>> by_position(pictures_.size()), by_colour(pictures_.size());
  parallelFor(pictures_.size(), 1, [&](size_t begin, size_t end) {
    std::vector<double> by_pixel;
    for (size_t i = begin; i < end; ++i) {
      const MeshView& view = step.views[i];
      const std::vector<float>& shown = pictures_[i].pixels;
      by_pixel.resize(view.pixels.size());
      for (size_t k = 0; k < by_pixel.size(); ++k) {
        const double difference = view.pixels[k] - static_cast<double>(shown[k]);
        losses[i] += share_ * std::abs(difference);
        by_pixel[k] = difference > 0 ? share_ : difference < 0 ? -share_ : 0.0;
      }
      by_position[i].assign(count, Vec3d::Zero());
      by_colour[i].assign(count, Vec3d::Zero());
      renderer_.addGradient(view, pictures_[i].camera, step.colours, by_pixel, outline_weight,
                            by_position[i], by_colour[i]);
    }
  });
  std::vector<Vec3d> by_normal(count);
  double mean = 0;
  for (size_t v = 0; v < count; ++v) {
    Vec3d colour = Vec3d::Zero();
    for (size_t i = 0; i < pictures_.size(); ++i) {
      gradient[v] += by_position[i][v];
      colour += by_colour[i][v];
    }
    by_normal[v] = light_.gradient(step.normals[v], colour);
  }
  for (uint32_t t = 0; t < links_.triangleCount(); ++t) {
    mean += areaVector(links_.triangles(), positions, t).norm();
  }
  mean *= 3 / static_cast<double>(count);  // a vertex has about so much around it
  addNormalsGradient(links_, positions, by_normal, 0.01 * mean, gradient);
  findLight(step.views, step.normals);
  double loss = 0;
  for (const double of_view : losses) loss += of_view;
  return loss;
}

double PictureLoss::at(std::span<const Vec3d> positions) {
  const std::vector<Vec3d> normals = vertexNormals(links_, positions);
  findLight(drawAll(positions, coloursOf(normals)), normals);
  const std::vector<MeshView> views = drawAll(positions, coloursOf(normals));
  double loss = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    for (size_t k = 0; k < views[i].pixels.size(); ++k) {
      loss += share_ * std::abs(views[i].pixels[k] - static_cast<double>(pictures_[i].pixels[k]));
    }
  }
  return loss;
}

}  // namespace stipple
