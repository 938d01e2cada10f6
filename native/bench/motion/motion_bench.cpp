// Splats that move, at a time, and splats that a mesh carries. References: reading all their
// numbers and writing those that change, in pieces that stay in the cache; a frame of a rig in
// Blender.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/comparison.h"
#include "motion/motion_cloud.h"
#include "motion/surface_binding.h"

namespace stipple::bench {

namespace {

constexpr size_t kSplats = 1000000;
constexpr size_t kPiece = 4096;

const MotionCloud& movingMillion() {
  static const MotionCloud moving = [] {
    MotionCloud made;
    uint64_t drawn = 0;
    const auto fill = [&](std::vector<float>& column, size_t width, float from, float to) {
      column.resize(width * kSplats);
      for (float& value : column) {
        value = from + (to - from) * unitFloat(keyedBits(1, RandomUse::kThinning, ++drawn));
      }
    };
    made.splats.resize(kSplats);
    fill(made.splats.positions, 3, -1, 1);
    fill(made.splats.rotations, 4, 0.1f, 1);
    fill(made.splats.opacities, 1, 0, 1);
    for (auto& wave : made.waves) fill(wave, 3, -0.1f, 0.1f);
    fill(made.phases, 4, -3, 3);
    fill(made.spins, 4, -1, 1);
    fill(made.lifespans, 2, 0.05f, 1.1f);
    fill(made.centres, 1, 0, 1);
    made.clip.frame_count = 300;
    return made;
  }();
  return moving;
}

/// Columns that splats at a time fill.
struct Moments {
  std::vector<float> positions = std::vector<float>(3 * kSplats);
  std::vector<float> rotations = std::vector<float>(4 * kSplats);
  std::vector<float> opacities = std::vector<float>(kSplats);
  MomentColumns<float> columns() { return {positions.data(), rotations.data(), opacities.data()}; }
};

void passOver(const MotionCloud& moving, Moments& moments) {
  parallelFor(kSplats, kPiece, [&](size_t begin, size_t end) {
    std::vector<float> kept(4 * kPiece);
    const auto read = [&](const std::vector<float>& column, size_t width) {
      std::copy(column.data() + width * begin, column.data() + width * end, kept.data());
      benchmark::DoNotOptimize(kept.data());
      benchmark::ClobberMemory();
    };
    for (const auto& wave : moving.waves) read(wave, 3);
    read(moving.phases, 4);
    read(moving.spins, 4);
    read(moving.lifespans, 2);
    read(moving.centres, 1);
    const auto copy = [&](const std::vector<float>& from, std::vector<float>& to, size_t width) {
      std::copy(from.data() + width * begin, from.data() + width * end, to.data() + width * begin);
    };
    copy(moving.splats.positions, moments.positions, 3);
    copy(moving.splats.rotations, moments.rotations, 4);
    copy(moving.splats.opacities, moments.opacities, 1);
  });
}

void moments(benchmark::State& state, unsigned threads) {
  const MotionCloud& moving = movingMillion();
  Moments made;
  withThreads(threads, [&] {
    compare(
        state, "bytes", [&] { momentsAt(moving, 6, made.columns()); },
        [&] { passOver(moving, made); });
  });
}

/// A frame of a rig may take this long, on two threads.
constexpr double kFrameMilliseconds = 40;

/// 200,000 splats on a ball of 20,000 triangles that is bent.
void carried(benchmark::State& state, BindingReach reach, int degree) {
  constexpr uint32_t kRings = 100, kSegments = 100;
  constexpr size_t kCount = 200000;
  std::vector<float> rest, bent;
  std::vector<uint32_t> triangles;
  for (uint32_t i = 0; i <= kRings; ++i) {
    for (uint32_t j = 0; j < kSegments; ++j) {
      const float a = 3.1415f * (static_cast<float>(i) + 0.01f) / kRings;
      const float b = 6.2832f * static_cast<float>(j) / kSegments;
      const float x = std::sin(a) * std::cos(b), y = std::sin(a) * std::sin(b), z = std::cos(a);
      rest.insert(rest.end(), {x, y, z});
      bent.insert(bent.end(), {x * std::cos(z), y * (1 + 0.2f * z), z + x * std::sin(z)});
      if (i == kRings) continue;
      const uint32_t at = i * kSegments + j, next = i * kSegments + (j + 1) % kSegments;
      triangles.insert(triangles.end(),
                       {at, at + kSegments, next, next, at + kSegments, next + kSegments});
    }
  }
  SplatCloud cloud;
  cloud.sh_degree = degree;
  cloud.resize(kCount);
  for (size_t i = 0; i < kCount; ++i) {
    const auto number = [&](uint64_t k) {
      return unitFloat(keyedBits(k, RandomUse::kThinning, i));
    };
    const float z = 2 * number(1) - 1, turn = 6.2832f * number(2), r = std::sqrt(1 - z * z);
    const float at[3] = {r * std::cos(turn), r * std::sin(turn), z};
    for (size_t axis = 0; axis < 3; ++axis) {
      cloud.positions[3 * i + axis] = at[axis];
      cloud.scales[3 * i + axis] = axis == 2 ? 0.001f : 0.005f + 0.005f * number(4 + axis);
    }
    for (size_t k = 0; k < 4; ++k) cloud.rotations[4 * i + k] = number(8 + k) - 0.5f;
  }
  normaliseRotations(cloud);
  const SurfaceBinding binding = bindToSurface(cloud.positions, rest, triangles, reach);
  withThreads(2, [&] {
    compare(
        state, "copy",
        [&] { benchmark::DoNotOptimize(carriedSplats(cloud, binding, bent).positions.data()); },
        [&] {
          const SplatCloud copy = cloud;
          benchmark::DoNotOptimize(copy.positions.data());
        });
  });
  state.counters["ratio_frame_limit"] = state.counters["best_ms"] / kFrameMilliseconds;
}

BENCHMARK_CAPTURE(carried, surface, BindingReach::kSurface, 0)
    ->Name("motion.carried_surface.200k")
    ->UseManualTime()
    ->Iterations(10)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(carried, around, BindingReach::kAround, 0)
    ->Name("motion.carried_around.200k")
    ->UseManualTime()
    ->Iterations(10)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(carried, around_degree3, BindingReach::kAround, 3)
    ->Name("motion.carried_around_degree3.200k")
    ->UseManualTime()
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(moments, 1_thread, 1u)
    ->Name("motion.moments_1_thread.1M")
    ->UseManualTime()
    ->Iterations(10)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(moments, 2_threads, 2u)
    ->Name("motion.moments_2_threads.1M")
    ->UseManualTime()
    ->Iterations(10)
    ->Unit(benchmark::kMillisecond);

}  // namespace

}  // namespace stipple::bench
