// Splats to voxels. The reference is the floor of the method: as many values of the extinction as
// the splats have voxels inside their ellipsoids, evaluated by the same kernel with every lane in
// use, without reading splats, finding bricks or fetching lists.
#include <benchmark/benchmark.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/comparison.h"
#include "splat/voxels/voxelize.h"
#include "splat/voxels/voxelize_kernel.h"
#include "splat/voxels/voxelize_splat.h"

namespace stipple::bench {
namespace {

constexpr uint32_t kResolution = 256;
constexpr uint32_t kCoarseResolution = 12;  // two to three bricks a side

// Flat splats on a sphere of radius 1, as wide as their spacing: what a surface decoder makes.
SplatCloud sphereCloud(size_t count) {
  SplatCloud cloud;
  cloud.colour_space = ColourSpace::kLinear;
  cloud.resize(count);
  const double spacing = std::sqrt(4.0 * std::numbers::pi / static_cast<double>(count));
  for (size_t i = 0; i < count; ++i) {
    const double u = unitDouble(keyedBits(1, RandomUse::kDecoder, 2 * i));
    const double v = unitDouble(keyedBits(1, RandomUse::kDecoder, 2 * i + 1));
    const double z = 2.0 * u - 1.0;
    const double r = std::sqrt(1.0 - z * z);
    const double phi = 2.0 * std::numbers::pi * v;
    const double n[3] = {r * std::cos(phi), r * std::sin(phi), z};
    // Turns the z axis into the normal: half-way quaternion of the two.
    const double w = std::sqrt(0.5 * (1.0 + z));
    const double q[4] = {w, -n[1] / (2.0 * std::max(w, 1e-6)), n[0] / (2.0 * std::max(w, 1e-6)),
                         0.0};
    for (size_t k = 0; k < 3; ++k) cloud.positions[i * 3 + k] = static_cast<float>(n[k]);
    for (size_t k = 0; k < 4; ++k) cloud.rotations[i * 4 + k] = static_cast<float>(q[k]);
    cloud.scales[i * 3] = cloud.scales[i * 3 + 1] = static_cast<float>(0.7 * spacing);
    cloud.scales[i * 3 + 2] = static_cast<float>(0.05 * spacing);
    cloud.opacities[i] = 0.95f;
    for (size_t k = 0; k < 3; ++k) cloud.sh[i * 3 + k] = static_cast<float>(n[k]);
  }
  return cloud;
}

// Values of the extinction inside the ellipsoids, every sample counted.
double valueCount(const std::vector<VoxelSplat>& splats) {
  double values = 0.0;
  for (const VoxelSplat& splat : splats) {
    const Vec3d reach = splat.to_unit.rowwise().norm().cwiseInverse() * splat.reach;
    values += 4.0 / 3.0 * std::numbers::pi * reach.prod() * splat.samples[0] * splat.samples[1] *
              splat.samples[2];
  }
  return values;
}

void floorOfValues(double values) {
  VoxelSplat splat;
  splat.centre = Vec3d(3.5, 3.5, 3.5);
  splat.to_unit = Mat3d::Identity() / 4.0;
  splat.reach = 4.0;
  splat.half_extent = Vec3d(16.0, 16.0, 16.0);
  splat.minus_log_opacity = 0.05f;
  splat.amplitude = 1.0f;
  const std::vector<VoxelSplat> splats = {splat};
  const std::vector<uint32_t> list(1024, 0);
  const auto count =
      static_cast<size_t>(std::ceil(values / static_cast<double>(list.size()) / kBrickVoxelCount));
  const BrickKernel sum_brick = chosenBrickKernel();
  parallelFor(count, 4, [&](size_t begin, size_t end) {
    BrickSums sums = {};
    for (size_t i = begin; i < end; ++i) {
      sum_brick({0, 0, 0}, splats.data(), list.data(), list.size(), sums);
      benchmark::DoNotOptimize(sums.data());
    }
  });
}

void cloud(benchmark::State& state, size_t count, uint32_t resolution, unsigned threads) {
  const SplatCloud splats = sphereCloud(count);
  const SplatInstance instance{&splats, Mat4d::Identity()};
  const std::span<const SplatInstance> instances(&instance, 1);
  VoxelizeOptions options;
  options.resolution = resolution;
  const double size = chooseVoxelSize(instances, options);
  const double values = valueCount(prepareVoxelSplats(instances, options, size, nullptr));
  size_t bricks = 0;
  compare(
      state, "floor",
      [&] { withThreads(threads, [&] { bricks = voxelize(instances, options).brickCount(); }); },
      [&] { withThreads(threads, [&] { floorOfValues(values); }); });
  state.counters["splats"] = static_cast<double>(count);
  state.counters["values_per_splat"] = values / static_cast<double>(count);
  state.counters["bricks"] = static_cast<double>(bricks);
}

const bool registered = [] {
  struct Case {
    const char* name;
    size_t count;
    uint32_t resolution;
    int repeats;
  };
  for (const Case& one :
       {Case{"cloud.10k", 10000, kResolution, 6}, Case{"cloud.100k", 100000, kResolution, 4},
        Case{"cloud.1M", 1000000, kResolution, 2},
        Case{"coarse.100k", 100000, kCoarseResolution, 6}}) {
    for (const unsigned threads : {1u, 2u}) {
      const std::string name =
          std::string("voxelize.") + one.name + (threads == 1 ? "" : ".2threads");
      benchmark::RegisterBenchmark(name.c_str(), cloud, one.count, one.resolution, threads)
          ->UseManualTime()
          ->Iterations(one.repeats)
          ->Unit(benchmark::kMillisecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
