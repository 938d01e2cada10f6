#include "shot/sampled_render.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "math/cross_product.h"
#include "math/low_discrepancy.h"
#include "math/moving_frame.h"
#include "shot/changing_clouds.h"
#include "splat/render/pixel_passes.h"
#include "splat/render/surface.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

/// Where the shutter has let through a share of its light.
class ShutterTime {
 public:
  explicit ShutterTime(const std::vector<double>& curve) : curve_(curve), sums_(1, 0.0) {
    // Only what a value is to the others counts. By a power of two, which rounds nothing: squares
    // of a faint curve would be 0.
    double most = 0;
    for (const double open : curve_) most = std::max(most, open);
    int exponent = 0;
    std::frexp(most, &exponent);
    for (double& open : curve_) open = std::ldexp(open, -exponent);
    for (size_t i = 0; i + 1 < curve_.size(); ++i) {
      sums_.push_back(sums_.back() + 0.5 * (curve_[i] + curve_[i + 1]));
    }
  }

  /// In: share 0..1. Returns the time, 0..1.
  double at(double share) const {
    if (sums_.size() < 2) return share;
    const double wanted = share * sums_.back();
    const auto after = std::upper_bound(sums_.begin() + 1, sums_.end() - 1, wanted);
    const size_t i = static_cast<size_t>(after - sums_.begin()) - 1;
    // Along a straight piece from a to b, a x + (b - a) x^2 / 2 has come through at x.
    const double a = curve_[i], b = curve_[i + 1], left = wanted - sums_[i];
    const double root = std::sqrt(std::max(0.0, a * a + 2 * (b - a) * left));
    const double x = a + root > 0 ? 2 * left / (a + root) : 0.0;
    return (static_cast<double>(i) + std::clamp(x, 0.0, 1.0)) /
           static_cast<double>(sums_.size() - 1);
  }

 private:
  std::vector<double> curve_;
  std::vector<double> sums_;
};

/// A point of what a sampled picture is an average over.
struct SamplePoint {
  Vec2d lens = Vec2d::Zero();  ///< metres to the right and downwards
  double time = 0.5;
  Vec2d pixel = Vec2d::Zero();  ///< from its centre
};

bool hasLens(const Sampling& sampling) {
  return sampling.aperture.radius > 0;
}

bool moves(const Sampling& sampling) {
  return sampling.shutter.step_count > 0;
}

SamplePoint samplePoint(const Sampling& sampling, const ShutterTime& shutter, uint32_t index) {
  uint32_t dimension = 0;
  const auto next = [&] { return scrambledSobol(index, dimension++); };
  SamplePoint point;
  if (hasLens(sampling)) {
    const double u = next(), v = next();
    point.lens = aperturePoint(sampling.aperture, u, v);
  }
  if (moves(sampling)) point.time = shutter.at(next());
  const double x = next(), y = next();
  point.pixel = {x - 0.5, y - 0.5};
  return point;
}

/// What one of the pictures shows.
struct PictureMoment {
  std::span<const SplatInstance> instances;
  Camera camera;
  LensPoint lens;
};

/// Instances and camera at any moment.
class MovingScene {
 public:
  MovingScene(std::span<const SplatInstance> instances, const Camera& camera,
              const Sampling& sampling)
      : sampling_(sampling),
        still_(instances),
        instances_(instances.begin(), instances.end()),
        clouds_(instances, sampling.shutter),
        camera_(camera) {
    const Shutter& shutter = sampling.shutter;
    std::vector<Mat4d> steps(shutter.step_count);
    if (!shutter.camera.empty()) {
      std::transform(shutter.camera.begin(), shutter.camera.end(), steps.begin(), rigidInverse);
      camera_frame_.emplace_back(steps);
    }
    for (size_t i = 0; i < instances.size() && !shutter.instances.empty(); ++i) {
      for (size_t s = 0; s < steps.size(); ++s) {
        steps[s] = shutter.instances[s * instances.size() + i];
      }
      frames_.emplace_back(steps);
    }
  }

  const ChangingClouds& clouds() const { return clouds_; }

  /// Valid until the next call.
  PictureMoment at(const SamplePoint& point) {
    clouds_.placeAt(point.time, instances_);
    return placedAt(point);
  }

  /// The same without what changes of the splats themselves: the instances have any of their
  /// clouds.
  PictureMoment placedAt(const SamplePoint& point) {
    PictureMoment moment{instances_, camera_, {}};
    for (size_t i = 0; i < instances_.size(); ++i) {
      instances_[i].object_to_world =
          frames_.empty() ? still_[i].object_to_world : frames_[i].at(point.time);
    }
    Camera& camera = moment.camera;
    if (!camera_frame_.empty()) {
      camera.world_to_camera = rigidInverse(camera_frame_.front().at(point.time));
    }
    if (!point.lens.isZero()) lookThrough(point.lens, moment);
    camera.cx -= point.pixel[0];
    camera.cy -= point.pixel[1];
    return moment;
  }

 private:
  void lookThrough(const Vec2d& lens, PictureMoment& moment) {
    const double focus = sampling_.aperture.focus_distance;
    Camera& camera = moment.camera;
    if (camera.model == CameraModel::kPerspective) {
      camera.world_to_camera(0, 3) -= lens[0];
      camera.world_to_camera(1, 3) -= lens[1];
      camera.cx += camera.fx * lens[0] / focus;
      camera.cy += camera.fy * lens[1] / focus;
    } else if (camera.model == CameraModel::kOrthographic) {
      // Rays lean: what they meet at a depth z is straight ahead in a space that is sheared by it.
      Mat4d shear = Mat4d::Identity();
      for (int axis = 0; axis < 2; ++axis) {
        shear(axis, 2) = lens[axis] / focus;
        shear(axis, 3) = -lens[axis];
      }
      const Mat4d leaning = rigidInverse(camera.world_to_camera) * shear * camera.world_to_camera;
      for (SplatInstance& instance : instances_) {
        instance.object_to_world = leaning * instance.object_to_world;
      }
    } else {
      moment.lens = {lens[0], lens[1], focus};
    }
  }

  const Sampling& sampling_;
  std::span<const SplatInstance> still_;
  std::vector<SplatInstance> instances_;
  ChangingClouds clouds_;
  Camera camera_;
  std::vector<MovingFrame> camera_frame_;  ///< one, or none: camera to world
  std::vector<MovingFrame> frames_;        ///< one per instance, or none
};

/// Adds up in double and hands out the mean.
class Average {
 public:
  void add(const std::vector<float>& values) {
    sums_.resize(values.size());
    parallelFor(values.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) sums_[i] += static_cast<double>(values[i]);
    });
  }
  void write(uint32_t count, std::vector<float>& out) const {
    const double share = 1.0 / count;
    out.resize(sums_.size());
    parallelFor(sums_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) out[i] = static_cast<float>(sums_[i] * share);
    });
  }

 private:
  std::vector<double> sums_;
};

RenderOptions coloursOnly(RenderOptions options) {
  options.with_depth = options.with_median_depth = options.with_counts = false;
  options.with_normal = options.with_objects = false;
  return options;
}

bool wantsMiddle(const RenderOptions& options) {
  return options.with_depth || options.with_median_depth || options.with_counts ||
         hasPasses(options);
}

/// Pixels by which a point seen from the camera's middle at depth z spreads.
double blurRadius(const Camera& camera, const Aperture& aperture, double z) {
  const double reach = aperture.radius * std::max(1.0, 1.0 / aperture.ratio);
  const double pixels = std::max(camera.fx, camera.fy) * reach;
  if (camera.model == CameraModel::kOrthographic) {
    return pixels * std::abs(1 - z / aperture.focus_distance);
  }
  return pixels * std::abs(1 / z - 1 / aperture.focus_distance);
}

/// Pixels from one place of a point in the camera's frame to another.
double pathLength(const Camera& camera, const Vec3d& from, const Vec3d& to) {
  const double focal = std::max(camera.fx, camera.fy);
  if (camera.model == CameraModel::kOrthographic) return focal * (to - from).head<2>().norm();
  if (camera.model == CameraModel::kPerspective) {
    if (!(from[2] >= camera.near_plane && to[2] >= camera.near_plane)) return 0;
    return focal * (to.head<2>() / to[2] - from.head<2>() / from[2]).norm();
  }
  return focal * std::atan2(crossProduct(from, to).norm(), from.dot(to));
}

/// The value that 19 of 20 do not exceed. Places that are not finite are for the renderer to
/// refuse.
double nineteenOfTwenty(std::vector<double>& values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return 0;
  const size_t place = (values.size() - 1) * 19 / 20;
  std::nth_element(values.begin(), values.begin() + static_cast<ptrdiff_t>(place), values.end());
  return values[place];
}

/// Near enough to the picture to show in it.
bool isInView(const Camera& camera, const Vec3d& point) {
  const double depth = hasImagePlane(camera) ? point[2] : point.norm();
  if (!(depth >= camera.near_plane && depth <= camera.far_plane)) return false;
  if (!hasImagePlane(camera)) return true;
  const double scale = camera.model == CameraModel::kPerspective ? 1 / depth : 1.0;
  const double x = camera.fx * point[0] * scale + camera.cx;
  const double y = camera.fy * point[1] * scale + camera.cy;
  return x >= 0 && x <= camera.width && y >= 0 && y <= camera.height;
}

/// Moments at which paths are looked at: each step, as far as there are not too many, and some of
/// the arcs between few.
uint32_t lookedAtTimes(uint32_t step_count) {
  constexpr uint32_t kLeast = 8, kMost = 128;
  const uint32_t pieces = step_count - 1;
  return std::min(pieces * ((kLeast + pieces - 1) / pieces), kMost) + 1;
}

}  // namespace

bool isSampled(const Sampling& sampling) {
  return sampling.samples > 1 || hasLens(sampling) || moves(sampling);
}

void validate(const Sampling& sampling, std::span<const SplatInstance> instances) {
  if (sampling.samples > kMaxSamples) {
    fail(ErrorCode::kInvalidArgument,
         "samples is " + std::to_string(sampling.samples) + "; 0 to 65536 is allowed");
  }
  validate(sampling.aperture);
  validate(sampling.shutter, instances);
}

uint32_t automaticSamples(std::span<const SplatInstance> instances, const Camera& camera,
                          const Sampling& sampling) {
  constexpr size_t kLookedAt = 2048;
  MovingScene scene(instances, camera, sampling);
  size_t total = 0;
  for (const SplatInstance& instance : instances) total += instance.cloud->size();
  const size_t stride = std::max<size_t>(1, (total + kLookedAt - 1) / kLookedAt);
  std::vector<Vec3d> before;
  std::vector<double> paths, radii;
  const uint32_t times = moves(sampling) ? lookedAtTimes(sampling.shutter.step_count) : 1;
  for (uint32_t k = 0; k < times; ++k) {
    SamplePoint point;
    if (times > 1) point.time = static_cast<double>(k) / (times - 1);
    const PictureMoment moment = scene.placedAt(point);
    size_t row = 0, looked = 0;
    for (size_t i = 0; i < instances.size(); ++i) {
      const Mat4d to_camera = moment.camera.world_to_camera * moment.instances[i].object_to_world;
      for (; row < instances[i].cloud->size(); row += stride, ++looked) {
        const Vec3d place = scene.clouds().positionAt(i, row, point.time);
        const Vec3d here = linearPart(to_camera) * place + translationPart(to_camera);
        if (k == 0) {
          before.push_back(here);
          paths.push_back(0);
        } else {
          paths[looked] += pathLength(camera, before[looked], here);
          before[looked] = here;
        }
        if (k == times / 2 && isInView(camera, here)) {
          radii.push_back(
              blurRadius(camera, sampling.aperture, hasImagePlane(camera) ? here[2] : here.norm()));
        }
      }
      row -= instances[i].cloud->size();
    }
  }
  double wanted = 16;
  if (hasLens(sampling)) {
    // Two pixels apart: one point for each 4 px^2 of a disc.
    const double radius = nineteenOfTwenty(radii);
    wanted = std::max(wanted, 0.785 * radius * radius);
  }
  if (moves(sampling)) wanted = std::max(wanted, nineteenOfTwenty(paths));
  return std::bit_ceil(static_cast<uint32_t>(std::min(wanted, 256.0)));
}

void renderSampled(std::span<const SplatInstance> instances, const Camera& camera,
                   const RenderOptions& options, const Sampling& sampling, const DrawMoment& draw,
                   RenderResult& result, Progress* progress) {
  validate(camera);
  validate(sampling, instances);
  MovingScene scene(instances, camera, sampling);
  scene.clouds().validateValues();
  const uint32_t samples =
      sampling.samples > 0 ? sampling.samples : automaticSamples(instances, camera, sampling);
  if (samples == 1) {
    const PictureMoment middle = scene.at({});
    draw(middle.instances, middle.camera, options, result, progress);
    return;
  }
  const bool has_middle = wantsMiddle(options);
  const uint32_t pictures = samples + (has_middle ? 1 : 0);
  const auto enter = [&](uint32_t picture) {
    if (progress) {
      progress->enterPart(static_cast<double>(picture) / pictures, (picture + 1.0) / pictures);
    }
  };
  const ShutterTime shutter(sampling.shutter.curve);
  RenderOptions plain = coloursOnly(options);
  RenderResult one;
  Average colour, transmittance, surface_weight;
  for (uint32_t i = 0; i < samples; ++i) {
    enter(i);
    const PictureMoment moment = scene.at(samplePoint(sampling, shutter, i));
    plain.lens = moment.lens;
    draw(moment.instances, moment.camera, plain, one, progress);
    colour.add(one.colour);
    transmittance.add(one.transmittance);
    surface_weight.add(one.surface_weight);
  }
  enter(samples);
  if (has_middle) {
    const PictureMoment middle = scene.at({});
    draw(middle.instances, middle.camera, options, result, progress);
  } else {
    result = std::move(one);
  }
  colour.write(samples, result.colour);
  transmittance.write(samples, result.transmittance);
  surface_weight.write(samples, result.surface_weight);
  if (progress) progress->enterPart(0, 1);
}

uint64_t renderSampledBytes(std::span<const SplatInstance> instances, const Camera& camera,
                            const RenderOptions& options, const Sampling& sampling) {
  const size_t instance_count = instances.size();
  const uint64_t pixels = static_cast<uint64_t>(camera.width) * camera.height;
  const uint64_t averaged =
      4u + (options.with_transmittance ? 1u : 0u) + (hasSurface(options) ? 1u : 0u);
  // Sums, and one picture beside the result.
  return pixels * averaged * (sizeof(double) + sizeof(float)) +
         2 * renderMemory({}, camera, options).result_bytes +
         ChangingClouds::memoryBound(instances, sampling.shutter) +
         instance_count * (sizeof(SplatInstance) + sizeof(MovingFrame)) +
         // The steps' matrices, each taken apart.
         (instance_count + 1) * (sampling.shutter.step_count + 1) * 3 * sizeof(Mat4d);
}

}  // namespace stipple
