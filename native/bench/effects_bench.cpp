#include <memory>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "data/clouds/cloud_transform.h"
#include "shot/sampled_render.h"
#include "splat/render/ray_render.h"

// What effects cost, as ratios to the picture without them.

namespace stipple::bench {
namespace {

constexpr SplatCase kCase = {"100k", 100'000, 640, 480, 1, 1.0};
constexpr SplatCase kColoured = {"100k", 100'000, 640, 480, 3, 1.0};
constexpr SplatCase kFew = {"10k", 10'000, 320, 160, 1, 1.0};

/// Draws into memory that is there already, as engines do.
class Drawer {
 public:
  explicit Drawer(const SplatCase& c) : instance_{&cloudOf(c)}, camera_(cameraOf(c)) {}

  void plain(const RenderOptions& options = {}) {
    withThreads(2, [&] { renderTiled({&instance_, 1}, camera_, options, workspace_, result_); });
  }

  void sampled(const Sampling& sampling) {
    withThreads(2, [&] {
      renderSampled(
          {&instance_, 1}, camera_, {}, sampling,
          [&](std::span<const SplatInstance> instances, const Camera& camera,
              const RenderOptions& options, RenderResult& out, Progress* progress) {
            renderTiled(instances, camera, options, workspace_, out, progress);
          },
          result_);
    });
  }

  const SplatInstance& instance() const { return instance_; }

 private:
  SplatInstance instance_;
  Camera camera_;
  RenderWorkspace workspace_;
  RenderResult result_;
};

/// One more blending for each: 2 and 2 times the plain picture at most.
void passes(benchmark::State& state) {
  Drawer drawer(kCase);
  drawer.plain();
  RenderOptions normal, objects;
  normal.with_normal = true;
  objects.with_objects = true;
  compareWithAll(state, [&] { drawer.plain(); },
                 {{"normal_to_plain", [&] { drawer.plain(normal); }},
                  {"objects_to_plain", [&] { drawer.plain(objects); }}});
}

/// 16 pictures over lens and time against 16 times one.
void lensAndShutter(benchmark::State& state) {
  Drawer drawer(kCase);
  drawer.plain();
  Sampling lens;
  lens.samples = 16;
  lens.aperture.radius = 0.05;
  lens.aperture.focus_distance = 3;
  Sampling shutter;
  shutter.samples = 16;
  Mat4d after = Mat4d::Identity();
  after(0, 3) = 0.1;
  shutter.shutter.step_count = 2;
  shutter.shutter.instances = {Mat4d::Identity(), after};
  compareWithAll(state,
                 [&] {
                   for (int i = 0; i < 16; ++i) drawer.plain();
                 },
                 {{"lens_to_16_pictures", [&] { drawer.sampled(lens); }},
                  {"shutter_to_16_pictures", [&] { drawer.sampled(shutter); }}});
}

/// 16 pictures of splats that change, each read from two clouds and written into a third, against
/// as many with matrices only. The splats go the way that the matrices have, so that both draw the
/// same.
void changingSplats(benchmark::State& state, const SplatCase& c) {
  Drawer drawer(c);
  drawer.plain();
  Sampling by_matrices;
  by_matrices.samples = 16;
  by_matrices.shutter.step_count = 2;
  Mat4d after = Mat4d::Identity();
  after(0, 3) = 0.1;
  Sampling by_clouds = by_matrices;
  by_matrices.shutter.instances = {Mat4d::Identity(), after};
  by_clouds.shutter.clouds = {nullptr,
                              std::make_shared<const SplatCloud>(transformed(cloudOf(c), after))};
  compareWithAll(state, [&] { drawer.sampled(by_matrices); },
                 {{"clouds_to_matrices", [&] { drawer.sampled(by_clouds); }}});
}

/// Panorama and fisheye along rays against a perspective picture along rays, of as many pixels.
void wideCameras(benchmark::State& state) {
  const Drawer drawer(kFew);
  const Camera flat = cameraOf(kFew);
  const auto draw = [&](CameraModel model) {
    Camera camera = flat;
    camera.model = model;
    if (model == CameraModel::kEquirectangular) {
      camera.fx = camera.width / (2 * std::numbers::pi);
      camera.fy = camera.height / std::numbers::pi;
    } else if (!hasImagePlane(camera)) {
      camera.fx = camera.fy = camera.height / std::numbers::pi;
    }
    withThreads(2, [&] { renderRays({&drawer.instance(), 1}, camera, {}, {}); });
  };
  compareWithAll(state, [&] { draw(CameraModel::kPerspective); },
                 {{"panorama_to_perspective", [&] { draw(CameraModel::kEquirectangular); }},
                  {"fisheye_to_perspective", [&] { draw(CameraModel::kFisheyeEquidistant); }}});
}

/// Ten copies in each other, drawn one after the other against all splats together.
void objectOrder(benchmark::State& state) {
  const SplatCloud& cloud = cloudOf(kCase);
  std::vector<SplatInstance> instances(10, SplatInstance{&cloud});
  for (size_t i = 0; i < instances.size(); ++i) {
    instances[i].object_to_world(0, 3) = 0.1 * static_cast<double>(i);
    instances[i].object_to_world(2, 3) = 0.05 * static_cast<double>(i);
  }
  const Camera camera = cameraOf(kCase);
  RenderWorkspace workspace;
  RenderResult result;
  const auto draw = [&](ObjectOrder order, size_t count) {
    RenderOptions options;
    options.object_order = order;
    withThreads(2, [&] {
      renderTiled({instances.data(), count}, camera, options, workspace, result);
    });
  };
  draw(ObjectOrder::kApart, instances.size());
  compareWithAll(state, [&] { draw(ObjectOrder::kTogether, instances.size()); },
                 {{"apart_to_together", [&] { draw(ObjectOrder::kApart, instances.size()); }}});
}

/// The same of one object, which has no order to choose.
void oneObject(benchmark::State& state) {
  Drawer drawer(kCase);
  drawer.plain();
  RenderOptions apart;
  apart.object_order = ObjectOrder::kApart;
  compareWithAll(state, [&] { drawer.plain(); },
                 {{"apart_to_together", [&] { drawer.plain(apart); }}});
}

const bool registered = [] {
  const auto add = [](const char* name, void (*run)(benchmark::State&), int iterations) {
    benchmark::RegisterBenchmark(name, run)
        ->UseManualTime()
        ->Iterations(iterations)
        ->Unit(benchmark::kMillisecond);
  };
  add("effects.passes.100k", passes, 7);
  add("effects.lens_and_shutter.100k", lensAndShutter, 3);
  add(
      "effects.changing_splats.100k", [](benchmark::State& s) { changingSplats(s, kCase); }, 3);
  add(
      "effects.changing_splats.100k_sh3", [](benchmark::State& s) { changingSplats(s, kColoured); },
      3);
  add("effects.wide_cameras.10k", wideCameras, 3);
  add("effects.object_order.10x100k", objectOrder, 7);
  add("effects.object_order.100k", oneObject, 15);
  return true;
}();

}  // namespace
}  // namespace stipple::bench
