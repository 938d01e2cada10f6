#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>
#include <vector>

#include "splat/random_scene.h"
#include "shot/sampled_render.h"

// How the error of a sampled picture falls with its samples: the table of docs/results/effects.md. Prints
// root mean square errors of colour and alpha against 16,384 samples, and the slope, beside those
// of as many random points.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::randomCloud;

constexpr uint32_t kCounts[] = {4, 16, 64, 256, 1024};

std::vector<float> drawSampled(const SplatInstance& instance, const Camera& camera,
                               const Sampling& sampling) {
  RenderResult result;
  renderSampled(
      {&instance, 1}, camera, {}, sampling,
      [](std::span<const SplatInstance> instances, const Camera& at, const RenderOptions& options,
         RenderResult& out,
         Progress* progress) { out = renderTiled(instances, at, options, progress); },
      result);
  return result.colour;
}

/// The mean of pictures from random points of the lens, moments and places in the pixel.
std::vector<double> drawRandom(const SplatInstance& instance, const Camera& camera,
                               const Sampling& sampling, uint32_t count) {
  std::mt19937 random(7);
  const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<double> sums(size_t{camera.width} * camera.height * 4, 0.0);
  for (uint32_t i = 0; i < count; ++i) {
    Camera at = camera;
    if (sampling.aperture.radius > 0) {
      const double turn = 2 * std::numbers::pi * uniform();
      const double out = sampling.aperture.radius * std::sqrt(uniform());
      const double x = out * std::cos(turn), y = out * std::sin(turn);
      at.world_to_camera(0, 3) -= x;
      at.world_to_camera(1, 3) -= y;
      at.cx += at.fx * x / sampling.aperture.focus_distance;
      at.cy += at.fy * y / sampling.aperture.focus_distance;
    }
    SplatInstance moved = instance;
    if (sampling.shutter.step_count > 0) {
      const double time = uniform();
      moved.object_to_world =
          (1 - time) * sampling.shutter.instances[0] + time * sampling.shutter.instances[1];
    }
    at.cx -= uniform() - 0.5;
    at.cy -= uniform() - 0.5;
    const RenderResult picture = renderTiled({&moved, 1}, at, {});
    for (size_t k = 0; k < sums.size(); ++k) sums[k] += static_cast<double>(picture.colour[k]);
  }
  for (double& sum : sums) sum /= count;
  return sums;
}

template <typename Value>
double errorOf(const std::vector<Value>& picture, const std::vector<float>& truth) {
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    const double difference = static_cast<double>(picture[i]) - static_cast<double>(truth[i]);
    sum += difference * difference;
  }
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

void printRow(const char* name, const std::vector<double>& errors) {
  std::printf("| %s |", name);
  for (const double error : errors) std::printf(" %.5f |", error);
  // Least squares over the logarithms.
  const double n = static_cast<double>(errors.size());
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (size_t i = 0; i < errors.size(); ++i) {
    const double x = std::log(kCounts[i]), y = std::log(errors[i]);
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  std::printf(" %.2f |\n", (n * sxy - sx * sy) / (n * sxx - sx * sx));
}

void printTable() {
  CloudRecipe recipe;
  recipe.count = 20;
  recipe.size_min = 0.1;
  recipe.size_max = 0.5;
  const SplatCloud cloud = randomCloud(recipe, 6);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(48, 40, 48, 3);
  Sampling both;
  both.aperture.radius = 0.35;
  both.aperture.focus_distance = 2.5;
  Mat4d after = Mat4d::Identity();
  after(0, 3) = 0.5;
  both.shutter.step_count = 2;
  both.shutter.instances = {Mat4d::Identity(), after};
  Sampling lens = both, shutter = both;
  lens.shutter = {};
  shutter.aperture = {};
  std::printf("| picture | 4 | 16 | 64 | 256 | 1024 | slope |\n|---|---|---|---|---|---|---|\n");
  const std::pair<const char*, Sampling*> pictures[] = {
      {"depth of field", &lens}, {"motion blur", &shutter}, {"both", &both}};
  std::vector<float> truth;
  for (const auto& [name, sampling] : pictures) {
    sampling->samples = 16384;
    truth = drawSampled(instance, camera, *sampling);
    std::vector<double> errors;
    for (const uint32_t count : kCounts) {
      sampling->samples = count;
      errors.push_back(errorOf(drawSampled(instance, camera, *sampling), truth));
    }
    printRow(name, errors);
  }
  std::vector<double> errors;
  for (const uint32_t count : kCounts) {
    errors.push_back(errorOf(drawRandom(instance, camera, both, count), truth));
  }
  printRow("both, random points", errors);
}

}  // namespace
}  // namespace stipple

int main() {
  stipple::printTable();
  return 0;
}
