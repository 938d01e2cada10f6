// Splats that move, at a time. References: reading all their numbers and writing those that change,
// in pieces that stay in the cache; one thread over two.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/comparison.h"
#include "motion/motion_cloud.h"

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
