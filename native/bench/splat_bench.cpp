#include <benchmark/benchmark.h>

#include <cmath>
#include <map>
#include <random>
#include <string>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "splat/cpu/tiled_render.h"

namespace stipple::bench {
namespace {

struct Case {
  const char* name;
  size_t splats;
  uint32_t width, height;
  int degree;
};

constexpr Case kCases[] = {{"15k_256x464", 15000, 256, 464, 0},
                           {"150k_800x800", 150000, 800, 800, 3},
                           {"1M_1280x720", 1000000, 1280, 720, 2}};

/// Splats in a ball, as fitted scenes have them: flat-ish, many faint, log-normal sizes whose mean
/// keeps about twenty splats in front of each pixel.
SplatCloud ball(const Case& c) {
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
  SplatCloud cloud;
  cloud.sh_degree = c.degree;
  cloud.resize(c.splats);
  const float size = 1.0f / std::sqrt(static_cast<float>(c.splats));
  for (size_t i = 0; i < c.splats; ++i) {
    float d[3] = {normal(random), normal(random), normal(random)};
    const float length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    const float radius = 0.4f + 0.6f * std::cbrt(uniform(random));
    const float base = size * std::exp(0.6f * normal(random));
    for (size_t axis = 0; axis < 3; ++axis) {
      cloud.positions[i * 3 + axis] = radius * d[axis] / length;
      cloud.scales[i * 3 + axis] = base * std::exp(0.5f * normal(random));
    }
    for (size_t k = 0; k < 4; ++k) cloud.rotations[i * 4 + k] = normal(random);
    const float o = uniform(random);
    cloud.opacities[i] = 0.02f + 0.97f * o * o;
  }
  for (float& value : cloud.sh) value = 0.3f * normal(random);
  return cloud;
}

const SplatCloud& cloudOf(const Case& c) {
  static std::map<std::string, SplatCloud> clouds;
  const auto [found, is_new] = clouds.try_emplace(c.name);
  if (is_new) found->second = ball(c);
  return found->second;
}

Camera cameraOf(const Case& c) {
  Camera camera;
  camera.width = c.width;
  camera.height = c.height;
  camera.fx = camera.fy = 1.2 * std::min(c.width, c.height);
  camera.cx = c.width / 2.0;
  camera.cy = c.height / 2.0;
  camera.world_to_camera(2, 3) = 2.6;
  return camera;
}

void draw(const Case& c, TileKernel kernel, unsigned threads) {
  const SplatInstance instance{&cloudOf(c)};
  withThreads(threads, [&] {
    const RenderResult picture = renderTiledWith(kernel, {&instance, 1}, cameraOf(c), {});
    benchmark::DoNotOptimize(picture.colour.data());
  });
}

void label(benchmark::State& state, const Case& c) {
  state.SetItemsProcessed(static_cast<int64_t>(c.splats) * state.iterations());
  RenderOptions options;
  options.with_counts = true;
  const SplatInstance instance{&cloudOf(c)};
  const RenderResult picture = renderTiled({&instance, 1}, cameraOf(c), options);
  double blended = 0;
  for (const uint32_t count : picture.counts) blended += count;
  state.counters["visible"] = static_cast<double>(picture.visible_count);
  state.counters["blended_per_pixel"] = blended / static_cast<double>(picture.counts.size());
}

/// Vector code against the plain scalar kernel; everything else is the same.
void againstScalar(benchmark::State& state, const Case& c) {
  cloudOf(c);
  compare(
      state, "scalar", 0.0, [&] { draw(c, chosenTileKernel(), 2); },
      [&] { draw(c, blendTileScalar, 2); });
  label(state, c);
}

void againstOneThread(benchmark::State& state, const Case& c) {
  cloudOf(c);
  compare(
      state, "one_thread", 0.0, [&] { draw(c, chosenTileKernel(), 2); },
      [&] { draw(c, chosenTileKernel(), 1); });
}

const bool registered = [] {
  for (const Case& c : kCases) {
    const std::string name = std::string("splat.forward.") + c.name;
    benchmark::RegisterBenchmark(name.c_str(), againstScalar, c)
        ->UseManualTime()
        ->Iterations(3)
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark((name + ".2_threads").c_str(), againstOneThread, c)
        ->UseManualTime()
        ->Iterations(3)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
