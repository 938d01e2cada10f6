#include "train/loop/refine.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/stopwatch.h"
#include "data/clouds/cloud_extent.h"
#include "mesh/mesh_image.h"
#include "train/loop/view_order.h"
#include "train/optimiser/adam.h"

namespace stipple {

namespace {

constexpr uint32_t kMaxIterations = 1000000;
constexpr uint32_t kRaysPerSide = 3;  ///< of a pixel, where pictures are of a mesh

/// Rates at the start; they fall to kLastRate of it along a half cosine, so that the last steps
/// settle. Positions: in units of a typical splat of the start.
constexpr double kPositionRate = 0.05;
constexpr double kRotationRate = 5e-3;
constexpr double kLogScaleRate = 1e-2;
constexpr double kLogitRate = 3e-2;
constexpr double kColourRate = 1e-2;
constexpr double kHigherColourRate = 5e-4;
constexpr double kLastRate = 0.1;
/// A step of Adam has the size of the rate, whatever the gradient: near the goal it must be small.
/// Rates are whole where the start is off by this mean L1, and fall in proportion below it.
constexpr double kErrorOfFullRates = 4e-3;
constexpr double kLeastShare = 0.02;
/// Few steps: the second moment must follow within tens of them.
constexpr double kBeta2 = 0.99;

void validateStart(const SplatCloud& start, const RefineOptions& options) {
  validate(start, "cloud");
  if (start.size() == 0) {
    fail(ErrorCode::kInvalidArgument, "refining needs splats; the cloud has 0");
  }
  if (options.iterations > kMaxIterations) {
    fail(ErrorCode::kInvalidArgument, "iterations is " + std::to_string(options.iterations) +
                                          "; at most " + std::to_string(kMaxIterations) +
                                          " is allowed");
  }
}

void validateInput(const SplatCloud& start, const SplatCloud& full, const RefineOptions& options) {
  validateStart(start, options);
  validate(full, "full cloud");
  if (full.size() == 0) {
    fail(ErrorCode::kInvalidArgument, "refining needs splats; the full cloud has 0");
  }
  if (start.colour_space != full.colour_space) {
    fail(ErrorCode::kInvalidArgument, "the cloud and the full cloud have different colour spaces");
  }
}

/// Display values, as the pictures of a mesh have them.
void validateInput(const SplatCloud& start, const TriMesh& mesh, const RefineOptions& options) {
  validateStart(start, options);
  validate(mesh);
  if (start.colour_space != ColourSpace::kDisplay) {
    fail(ErrorCode::kInvalidArgument,
         "the colours of the cloud are scene linear; those of splats of a mesh are display values");
  }
}

/// Median of the middle axis: the size of a splat as it is mostly seen, metres.
double typicalSize(const SplatCloud& cloud) {
  std::vector<float> sizes(cloud.size());
  for (size_t i = 0; i < sizes.size(); ++i) {
    const float* s = &cloud.scales[i * 3];
    sizes[i] = std::max(std::min(s[0], s[1]), std::min(std::max(s[0], s[1]), s[2]));
  }
  const auto middle = sizes.begin() + static_cast<ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return static_cast<double>(*middle);
}

StepOptions stepOptions(double size, double share, double progress) {
  const double fall =
      kLastRate + (1 - kLastRate) * 0.5 * (1 + std::cos(progress * 3.141592653589793));
  StepOptions step;
  step.adam.beta2 = kBeta2;
  const auto set = [&](ParameterGroup group, double rate) {
    // Splats of many kilometres take smaller steps than their size asks for.
    step.learning_rates[static_cast<size_t>(group)] =
        std::min(rate * share * fall, kMaxLearningRate);
  };
  set(ParameterGroup::kPositions, kPositionRate * size);
  set(ParameterGroup::kRotations, kRotationRate);
  set(ParameterGroup::kLogScales, kLogScaleRate);
  set(ParameterGroup::kLogits, kLogitRate);
  set(ParameterGroup::kShFirst, kColourRate);
  set(ParameterGroup::kShOthers, kHigherColourRate);
  return step;
}

/// Every second view stands before white: then coverage shows where colours are dark, too.
RenderOptions renderOptions(size_t view) {
  RenderOptions options;
  options.with_depth = false;
  options.with_background = true;
  std::fill_n(options.background, 3, view % 2 == 0 ? 0.0 : 1.0);
  return options;
}

/// What a view is to show: [H,W,3] over the background of its options.
using DrawTarget =
    std::function<void(const Camera&, const RenderOptions&, std::span<float> pixels, Progress*)>;

DrawTarget drawingOf(const SplatCloud& full, ImageRenderer& images) {
  return
      [&full, &images, picture = RenderResult()](const Camera& camera, const RenderOptions& options,
                                                 std::span<float> pixels, Progress*) mutable {
        const SplatInstance instance{&full};
        images.render({&instance, 1}, camera, options, {}, picture);
        for (size_t i = 0; i < pixels.size() / 3; ++i) {
          std::copy_n(&picture.colour[i * 4], 3, &pixels[i * 3]);
        }
      };
}

DrawTarget drawingOf(const TriMesh& mesh, const SurfaceColour& colour) {
  return [&mesh, &colour, picture = std::vector<float>()](
             const Camera& camera, const RenderOptions& options, std::span<float> pixels,
             Progress* progress) mutable {
    picture.resize(pixels.size() / 3 * 4);
    drawMeshImage(mesh, colour, camera, kRaysPerSide, picture, progress);
    for (size_t i = 0; i < pixels.size() / 3; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        pixels[i * 3 + c] = picture[i * 4 + c] +
                            (1 - picture[i * 4 + 3]) * static_cast<float>(options.background[c]);
      }
    }
  };
}

void addTargets(const DrawTarget& draw, const std::vector<Camera>& views, const char* stage,
                RenderBackend& backend, Progress* progress) {
  std::vector<float> pixels;
  for (size_t v = 0; v < views.size(); ++v) {
    advance(progress, 0.2 * static_cast<double>(v) / static_cast<double>(views.size()), stage);
    pixels.resize(size_t{views[v].width} * views[v].height * 3);
    draw(views[v], renderOptions(v), pixels, progress);
    backend.addTarget(views[v].width, views[v].height, pixels);
  }
}

/// What the start lacks: mean L1 loss of a few views.
double startingError(const std::vector<Camera>& views, const ImageLossOptions& loss,
                     RenderBackend& backend) {
  const size_t count = std::min<size_t>(views.size(), 4);
  double sum = 0;
  for (size_t v = 0; v < count; ++v) {
    backend.forward(views[v], renderOptions(v));
    sum += backend.loss(static_cast<uint32_t>(v), loss).l1;
  }
  return sum / static_cast<double>(count);
}

/// As large as a view, anywhere: bounds of memory do not look at places.
Camera cameraOfSize(uint32_t size) {
  Camera camera;
  camera.width = camera.height = size;
  camera.fx = camera.fy = size;
  return camera;
}

/// Bytes that the loss works with: half a megabyte per thread, and two sums per row of a tile.
uint64_t lossBytes(uint64_t pixel_count) {
  const uint64_t threads = std::max(1u, std::thread::hardware_concurrency());
  return threads * (uint64_t{1} << 20) + pixel_count * sizeof(double);
}

ViewRigOptions rigOf(const RefineOptions& options) {
  ViewRigOptions rig;
  rig.rig = options.rig;
  rig.count = options.view_count;
  rig.size = options.view_size;
  rig.seed = options.seed;
  return rig;
}

/// Whether the faces of a mesh look at its middle, as those of a room do: more flux of places goes
/// into it than out.
bool facesItsMiddle(const TriMesh& mesh) {
  const auto corner = [&](size_t triangle, size_t k) {
    const float* p = &mesh.positions[size_t{mesh.triangles[triangle * 3 + k]} * 3];
    return Vec3d(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]));
  };
  // Twice the area of a triangle, along its normal.
  const auto normal = [&](size_t t) -> Vec3d {
    return (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
  };
  const auto centre = [&](size_t t) -> Vec3d {
    return (corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3;
  };
  Vec3d middle = Vec3d::Zero();
  double area = 0, flux = 0;
  for (size_t t = 0; t < mesh.triangleCount(); ++t) {
    middle += normal(t).norm() * centre(t);
    area += normal(t).norm();
  }
  middle /= area;
  for (size_t t = 0; t < mesh.triangleCount(); ++t) flux += normal(t).dot(centre(t) - middle);
  return flux < 0;
}

/// How much of the steps is over, by their number or by the time that there is.
class StepClock {
 public:
  /// In: watch: of the whole work, which must outlive this.
  StepClock(const Stopwatch& watch, const RefineOptions& options)
      : watch_(watch), options_(options), begin_(watch.seconds()), last_(begin_) {}

  /// Before step i. 1 or more: there is no time for another one that takes as long as the last.
  double done(uint32_t i) {
    const double by_number = static_cast<double>(i) / options_.iterations;
    if (options_.seconds == 0) return by_number;
    const double now = watch_.seconds();
    const double step = now - last_;
    last_ = now;
    if (now + step >= options_.seconds) return 1;
    return std::max(by_number, (now - begin_) / (options_.seconds - begin_));
  }

 private:
  const Stopwatch& watch_;
  const RefineOptions& options_;
  double begin_, last_;  ///< seconds
};

SplatCloud refineTo(const DrawTarget& draw, const char* stage, const std::vector<Camera>& views,
                    RenderBackend& backend, const SplatCloud& start, const RefineOptions& options,
                    Progress* progress) {
  const Stopwatch watch;
  backend.upload(start);
  addTargets(draw, views, stage, backend, progress);
  ImageLossOptions loss;
  loss.ssim_share = options.ssim_share;
  const double size = typicalSize(start);
  const double share =
      std::clamp(startingError(views, loss, backend) / kErrorOfFullRates, kLeastShare, 1.0);
  ViewOrder order(views.size(), options.seed);
  StepClock clock(watch, options);
  for (uint32_t i = 0; i < options.iterations; ++i) {
    const double done = clock.done(i);
    if (done >= 1) break;
    advance(progress, 0.2 + 0.8 * done, "Refining splats");
    const size_t view = order.at(i);
    backend.forward(views[view], renderOptions(view));
    backend.loss(static_cast<uint32_t>(view), loss);
    backend.backward({});
    backend.step(stepOptions(size, share, done));
  }
  SplatCloud refined = backend.download();
  refined.frame = start.frame;
  return refined;
}

/// Upper bound of the bytes of targets and steps, where drawing a target takes `drawing`.
uint64_t memoryBound(const BackendFactory& backends, const SplatCloud& start, uint64_t drawing,
                     const RefineOptions& options) {
  const uint64_t pixel_count = uint64_t{options.view_size} * options.view_size;
  const Camera camera = cameraOfSize(options.view_size);
  // The drawing of the targets is over when the steps begin, the targets stay.
  const uint64_t picture = pixel_count * (4 * sizeof(float));
  const uint64_t pass = backends.passMemory(start, camera, renderOptions(0));
  // Raw splats, their zeros and both moments, the cloud that is drawn and that is handed back.
  const uint64_t row = sizeof(float) * (11 + start.shStride());
  const uint64_t steps = 2 * picture + pass + 6 * row * start.size() + lossBytes(pixel_count);
  return (options.view_count + uint64_t{1}) * pixel_count * (3 * sizeof(float)) +
         std::max(drawing, steps) + (uint64_t{1} << 20);
}

}  // namespace

uint64_t refineMemoryBound(const BackendFactory& backends, const SplatCloud& start,
                           const SplatCloud& full, const RefineOptions& options) {
  validateInput(start, full, options);
  const SplatInstance whole{&full};
  const Camera camera = cameraOfSize(options.view_size);
  return memoryBound(backends, start,
                     backends.imageMemory({&whole, 1}, camera, renderOptions(0), {}).sum(),
                     options);
}

uint64_t refineToMeshMemoryBound(const BackendFactory& backends, const SplatCloud& start,
                                 const TriMesh& mesh, const RefineOptions& options) {
  validateInput(start, mesh, options);
  const Camera camera = cameraOfSize(options.view_size);
  const uint64_t picture = uint64_t{camera.width} * camera.height * (4 * sizeof(float));
  return memoryBound(backends, start, picture + meshImageMemoryBound(mesh, camera, kRaysPerSide),
                     options);
}

SplatCloud refineCloud(const BackendFactory& backends, const SplatCloud& start,
                       const SplatCloud& full, const RefineOptions& options, Progress* progress) {
  validateInput(start, full, options);
  if (options.iterations == 0) return start;
  const std::vector<Camera> views = viewsOfCloud(backends, full, rigOf(options));
  const std::unique_ptr<ImageRenderer> images = backends.makeImageRenderer();
  return refineTo(drawingOf(full, *images), "Drawing all splats", views,
                  *backends.makeRenderBackend(), start, options, progress);
}

SplatCloud refineToMesh(const BackendFactory& backends, const SplatCloud& start,
                        const TriMesh& mesh, const RefineOptions& options, Progress* progress) {
  validateInput(start, mesh, options);
  if (options.iterations == 0) return start;
  ViewRigOptions rig = rigOf(options);
  // Splats of a thing are hollow, too, but nobody looks at them from inside.
  if (rig.rig == ViewRig::kAutomatic && !facesItsMiddle(mesh)) rig.rig = ViewRig::kAround;
  const std::vector<Camera> views = viewsOfCloud(backends, start, rig);
  const SurfaceColour colour(mesh);
  return refineTo(drawingOf(mesh, colour), "Drawing the mesh", views, *backends.makeRenderBackend(),
                  start, options, progress);
}

}  // namespace stipple
