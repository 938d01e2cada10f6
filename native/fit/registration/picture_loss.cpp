// Based on: Jung, Kim et al., Mesh Density Adaptation for Template-based Shape Reconstruction,
// SIGGRAPH 2023, its inverse rendering. Differs: the light is not given but found.
#include "fit/registration/picture_loss.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "math/affine.h"
#include "mesh/adapt/moving_samples.h"
#include "train/backend/backend_factory.h"

namespace stipple {

namespace {

/// What nearly nothing covers has no colour to speak of.
constexpr float kLeastAlpha = 0.5f;
/// Steps after which the light is found again.
constexpr uint32_t kLightSteps = 10;

/// Metres that a pixel shows in the middle of a mesh, the mean over all pictures.
double pixelAt(std::span<const TargetPicture> pictures, std::span<const Vec3d> positions) {
  Vec3d middle = Vec3d::Zero();
  for (const Vec3d& p : positions) middle += p / static_cast<double>(positions.size());
  double sum = 0;
  for (const TargetPicture& picture : pictures) {
    const Camera& camera = picture.camera;
    const double depth =
        (linearPart(camera.world_to_camera) * middle + translationPart(camera.world_to_camera)).z();
    const bool is_perspective = camera.model == CameraModel::kPerspective;
    sum += (is_perspective ? std::abs(depth) : 1.0) / camera.fx;
  }
  return sum / static_cast<double>(pictures.size());
}

}  // namespace

/// The splats, and who draws them.
struct PictureLoss::Splats {
  Splats(const BackendFactory& backends, const MeshLinks& links, std::span<const Vec3d> positions,
         double pixel)
      : bound(links, positions, pixel), pass(backends.makeViewPass()) {}

  BoundSplats bound;
  SplatCloud cloud, gradients;
  std::unique_ptr<ViewPass> pass;
  std::vector<float> signs;  ///< [H,W,4]
};

PictureLoss::PictureLoss(std::vector<TargetPicture> pictures, const MeshLinks& links)
    : pictures_(std::move(pictures)), links_(links), renderer_(links.triangles()) {
  size_t numbers = 0;
  for (const TargetPicture& picture : pictures_) {
    numbers += picture.pixels.size();
    double sum = 0;
    for (const float number : picture.pixels) sum += static_cast<double>(std::abs(number));
    shown_.push_back(sum);
  }
  share_ = 1.0 / static_cast<double>(numbers);
}

void PictureLoss::drawSplats(const BackendFactory& backends, std::span<const Vec3d> positions) {
  splats_ = std::make_shared<Splats>(backends, links_, positions, pixelAt(pictures_, positions));
}

void PictureLoss::drawAll(std::span<const Vec3d> positions, std::span<const Vec3d> colours) {
  views_.resize(pictures_.size());
  parallelFor(views_.size(), 1, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      renderer_.draw(pictures_[i].camera, positions, colours, views_[i]);
    }
  });
}

std::vector<Vec3d> PictureLoss::coloursOf(std::span<const Vec3d> normals) const {
  std::vector<Vec3d> colours(normals.size());
  for (size_t v = 0; v < colours.size(); ++v) colours[v] = light_.on(normals[v]);
  return colours;
}

void PictureLoss::findLight(std::span<const Vec3d> normals) {
  std::vector<HarmonicLight::Terms> terms(normals.size());
  for (size_t v = 0; v < terms.size(); ++v) terms[v] = HarmonicLight::terms(normals[v]);
  std::vector<LightFit> fits(views_.size());
  const std::span<const uint32_t> triangles = links_.triangles();
  const auto addPixel = [&](size_t i, uint32_t pixel) {
    const TargetPicture& picture = pictures_[i];
    const uint32_t t = views_[i].triangles[pixel];
    const float* shown = &picture.pixels[size_t{pixel} * 4];
    if (t == MeshView::kNoTriangle || !(shown[3] > kLeastAlpha)) return;
    const Vec3d weights = MeshRenderer::weightsAt(views_[i], picture.camera, pixel);
    const HarmonicLight::Terms here = weights[0] * terms[triangles[size_t{t} * 3]] +
                                      weights[1] * terms[triangles[size_t{t} * 3 + 1]] +
                                      weights[2] * terms[triangles[size_t{t} * 3 + 2]];
    const Vec3d colour = Vec3d(static_cast<double>(shown[0]), static_cast<double>(shown[1]),
                               static_cast<double>(shown[2])) /
                         static_cast<double>(shown[3]);
    fits[i].add(here, colour);
  };
  parallelFor(views_.size(), 1, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      views_[i].forEachRow([&](uint32_t first, uint32_t last) {
        for (uint32_t pixel = first; pixel < last; ++pixel) addPixel(i, pixel);
      });
    }
  });
  LightFit all;
  for (const LightFit& of_view : fits) all.add(of_view);
  if (all.isEmpty()) return;  // no image shows the mesh where it is
  light_ = all.light();
  light_age_ = 1;
}

double PictureLoss::differenceOf(size_t picture, std::span<double> by_pixel) const {
  const MeshView& view = views_[picture];
  const std::vector<float>& shown = pictures_[picture].pixels;
  double sum = shown_[picture];  // what lies outside of the box is all there is
  view.forEachRow([&](size_t begin, size_t end) {
    for (size_t k = begin * 4; k < end * 4; ++k) {
      const double aim = static_cast<double>(shown[k]), difference = view.pixels[k] - aim;
      sum += std::abs(difference) - std::abs(aim);
      if (!by_pixel.empty()) {
        by_pixel[k] = difference > 0 ? share_ : difference < 0 ? -share_ : 0.0;
      }
    }
  });
  return share_ * sum;
}

double PictureLoss::addByTriangles(std::span<const Vec3d> colours, double outline_weight,
                                   std::span<Vec3d> by_position, std::span<Vec3d> by_colour) const {
  std::vector<double> losses(views_.size(), 0.0);
  std::vector<std::vector<Vec3d>> positions_of(views_.size()), colours_of(views_.size());
  parallelFor(views_.size(), 1, [&](size_t begin, size_t end) {
    std::vector<double> by_pixel;
    for (size_t i = begin; i < end; ++i) {
      const MeshView& view = views_[i];
      by_pixel.resize(view.pixels.size());
      losses[i] = differenceOf(i, by_pixel);
      positions_of[i].assign(colours.size(), Vec3d::Zero());
      colours_of[i].assign(colours.size(), Vec3d::Zero());
      renderer_.addGradient(view, pictures_[i].camera, colours, by_pixel, outline_weight,
                            positions_of[i], colours_of[i]);
    }
  });
  double loss = 0;
  for (size_t i = 0; i < views_.size(); ++i) {
    loss += losses[i];
    for (size_t v = 0; v < colours.size(); ++v) {
      by_position[v] += positions_of[i][v];
      by_colour[v] += colours_of[i][v];
    }
  }
  return loss;
}

double PictureLoss::addBySplats(std::span<const Vec3d> positions, std::span<const Vec3d> colours,
                                std::span<Vec3d> by_position, std::span<Vec3d> by_colour) {
  Splats& splats = *splats_;
  splats.bound.place(positions, colours, splats.cloud);
  splats.pass->forget();
  const RenderOptions options = boundSplatsDrawing();
  double loss = 0;
  for (const TargetPicture& picture : pictures_) {
    splats.pass->forward(splats.cloud, picture.camera, options);
    const std::span<const float> colour = splats.pass->image();
    splats.signs.resize(colour.size());
    double sum = 0;
    for (size_t k = 0; k < colour.size(); ++k) {
      const float difference = colour[k] - picture.pixels[k];
      sum += static_cast<double>(std::abs(difference));
      splats.signs[k] = difference > 0 ? 1.0f : difference < 0 ? -1.0f : 0.0f;
    }
    loss += share_ * sum;
    splats.pass->setLossGradient(splats.signs);
    splats.pass->backward({});
    splats.pass->swapGradients(splats.gradients);
    splats.bound.addGradient(positions, splats.gradients, share_, by_position, by_colour);
    splats.pass->swapGradients(splats.gradients);
  }
  return loss;
}

double PictureLoss::addGradient(std::span<const Vec3d> positions, double outline_weight,
                                std::span<Vec3d> gradient) {
  const std::vector<Vec3d> normals = vertexNormals(links_, positions);
  if (light_age_ == 0 || light_age_ > kLightSteps) {
    drawAll(positions, coloursOf(normals));
    findLight(normals);
  }
  ++light_age_;
  const std::vector<Vec3d> colours = coloursOf(normals);
  const size_t count = positions.size();
  std::vector<Vec3d> by_colour(count, Vec3d::Zero()), by_normal(count);
  double loss = 0;
  if (splats_) {
    loss = addBySplats(positions, colours, gradient, by_colour);
  } else {
    drawAll(positions, colours);
    loss = addByTriangles(colours, outline_weight, gradient, by_colour);
  }
  for (size_t v = 0; v < count; ++v) by_normal[v] = light_.gradient(normals[v], by_colour[v]);
  double mean = 0;
  for (uint32_t t = 0; t < links_.triangleCount(); ++t) {
    mean += areaVector(links_.triangles(), positions, t).norm();
  }
  mean *= 3 / static_cast<double>(count);  // a vertex has about so much around it
  addNormalsGradient(links_, positions, by_normal, 0.01 * mean, gradient);
  return loss;
}

double PictureLoss::at(std::span<const Vec3d> positions) {
  const std::vector<Vec3d> normals = vertexNormals(links_, positions);
  drawAll(positions, coloursOf(normals));
  findLight(normals);
  drawAll(positions, coloursOf(normals));
  double loss = 0;
  for (size_t i = 0; i < views_.size(); ++i) loss += differenceOf(i, {});
  light_age_ = kLightSteps + 1;  // the next step may begin elsewhere
  return loss;
}

}  // namespace stipple
