#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <vector>

#include "data/views/memory_view_source.h"
#include "splat/random_scene.h"
#include "splat/render/render.h"
#include "train/loop/fit_model.h"

// A cloud that is known, seen from around: what a fit shall find.

namespace stipple::testing {

/// Looks from `eye` at the origin, z up.
inline Camera lookingAtOrigin(const Vec3d& eye, uint32_t size) {
  Camera camera;
  camera.width = camera.height = size;
  camera.fx = camera.fy = 1.1 * size;
  camera.cx = camera.cy = 0.5 * size;
  const Vec3d forward = -eye.normalized();
  const Vec3d right = forward.cross(Vec3d(0, 0, 1)).normalized();
  Mat3d rotation;
  rotation.row(0) = right;
  rotation.row(1) = forward.cross(right);
  rotation.row(2) = forward;
  camera.world_to_camera.topLeftCorner<3, 3>() = rotation;
  camera.world_to_camera.topRightCorner<3, 1>() = -rotation * eye;
  return camera;
}

inline std::vector<Camera> camerasAround(size_t count, uint32_t size, double distance = 3.5) {
  std::vector<Camera> cameras;
  for (size_t i = 0; i < count; ++i) {
    const double turn = 2.399963 * static_cast<double>(i);  // the golden angle
    const double z = -0.7 + 1.4 * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double r = std::sqrt(1 - z * z);
    cameras.push_back(
        lookingAtOrigin(distance * Vec3d(r * std::cos(turn), r * std::sin(turn), z), size));
  }
  return cameras;
}

/// Colourful splats inside a ball of radius 1.
inline SplatCloud ballOfSplats(size_t count, uint32_t seed, double size = 0.08) {
  CloudRecipe recipe;
  recipe.count = count;
  recipe.degree = 0;
  recipe.size_min = 0.7 * size;
  recipe.size_max = 1.4 * size;
  recipe.opacity_min = 0.6;
  SplatCloud cloud = randomCloud(recipe, seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (size_t i = 0; i < count; ++i) {
    float p[3];
    do {
      for (float& value : p) value = uniform(random);
    } while (p[0] * p[0] + p[1] * p[1] + p[2] * p[2] > 1);
    std::copy_n(p, 3, &cloud.positions[i * 3]);
    for (size_t c = 0; c < 3; ++c) cloud.sh[i * 3 + c] = 1.6f * uniform(random);
  }
  return cloud;
}

/// What the cameras see of it, with alpha.
inline std::shared_ptr<MemoryViewSource> viewsOf(const SplatCloud& cloud,
                                                 const std::vector<Camera>& cameras) {
  auto views = std::make_shared<MemoryViewSource>(cloud.colour_space);
  const SplatInstance instance{&cloud};
  for (const Camera& camera : cameras) {
    const RenderResult drawn = renderTiled({&instance, 1}, camera, {});
    ViewPicture picture;
    picture.width = camera.width;
    picture.height = camera.height;
    for (size_t i = 0; i < drawn.colour.size(); ++i) {
      (i % 4 == 3 ? picture.alpha : picture.colour).push_back(drawn.colour[i]);
    }
    picture.depth = drawn.depth;
    for (float& depth : picture.depth) depth = depth < 1e9f ? depth : 0.0f;
    views->add(camera, std::move(picture));
  }
  return views;
}

/// The points of a cloud, moved a little, as a reconstruction would have them.
inline PointSet pointsOf(const SplatCloud& cloud, float jitter, uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0, jitter);
  PointSet points;
  points.positions.assign(cloud.positions.begin(), cloud.positions.end());
  for (float& value : points.positions) value += normal(random);
  points.colours.assign(cloud.size() * 3, 0.2f);
  points.opacities.assign(cloud.size(), 1.0f);
  return points;
}

/// Takes iterations [first, last] of a fit of `iterations`, transparent views over other greys.
class Fit {
 public:
  Fit(const MemoryViewSource& views, FitModel& model, uint64_t iterations)
      : views_(views), model_(model) {
    moment_.iterations = iterations;
    moment_.extent = 1.1 * 3.5;
    moment_.seed = 5;
    for (size_t v = 0; v < views.count(); ++v) pictures_.push_back(views.load(v));
  }
  FitMoment& moment() { return moment_; }

  StepReport run(uint64_t last, ViewEvaluator* evaluator = nullptr) {
    StepReport report;
    for (; moment_.iteration <= last; ++moment_.iteration) {
      const size_t index = (moment_.iteration * 7) % views_.count();
      const ViewPicture& picture = pictures_[index];
      StepView view;
      view.index = index;
      view.time = moment_.time = views_.time(index);
      view.camera = &views_.camera(index);
      const double grey =
          picture.alpha.empty() ? 0.0 : 0.1 * static_cast<double>(moment_.iteration % 11);
      std::fill_n(view.background, 3, grey);
      target_ = picture.colour;
      for (size_t i = 0; i < target_.size() && grey > 0; ++i) {
        target_[i] += (1 - picture.alpha[i / 3]) * static_cast<float>(grey);
      }
      view.target = target_.data();
      view.weights = picture.weights.empty() ? nullptr : picture.weights.data();
      view.is_opaque = picture.alpha.empty();
      report = model_.step(moment_, view, evaluator, nullptr);
    }
    return report;
  }

 private:
  const MemoryViewSource& views_;
  FitModel& model_;
  std::vector<ViewPicture> pictures_;
  FitMoment moment_;
  std::vector<float> target_;
};

/// Mean PSNR over black, dB.
inline double meanPsnr(const SplatCloud& cloud, const MemoryViewSource& views) {
  const SplatInstance instance{&cloud};
  double sum = 0;
  for (size_t v = 0; v < views.count(); ++v) {
    const RenderResult drawn = renderTiled({&instance, 1}, views.camera(v), {});
    const ViewPicture picture = views.load(v);
    double squares = 0;
    for (size_t i = 0; i < drawn.colour.size(); ++i) {
      if (i % 4 == 3) continue;
      const double wanted = static_cast<double>(picture.colour[i / 4 * 3 + i % 4]);
      squares += std::pow(static_cast<double>(drawn.colour[i]) - wanted, 2);
    }
    sum += -10 * std::log10(squares / static_cast<double>(drawn.colour.size() / 4 * 3) + 1e-12);
  }
  return sum / static_cast<double>(views.count());
}

inline std::vector<size_t> allViews(const ViewSource& views) {
  std::vector<size_t> all(views.count());
  for (size_t i = 0; i < all.size(); ++i) all[i] = i;
  return all;
}

}  // namespace stipple::testing
