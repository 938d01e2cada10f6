// The tree of splats that move, and its cuts. References: the tree of the same splats as they stand
// at one time; a frame that is played.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/comparison.h"
#include "decode/tree/moving_decoder.h"

namespace stipple::bench {

namespace {

/// A frame that is played may take this long, on two threads.
constexpr double kFrameMilliseconds = 40;

float number(uint64_t stream, size_t i) {
  return unitFloat(keyedBits(stream, RandomUse::kThinning, i));
}

/// Splats on a ball that bends and turns, each with a little of its own, in a clip of 48 frames.
MotionCloud bendingBall(size_t count) {
  MotionCloud moving;
  moving.splats.resize(count);
  for (auto& wave : moving.waves) wave.resize(3 * count);
  moving.phases.resize(4 * count);
  moving.spins.resize(4 * count);
  moving.clip.frame_count = 48;
  const float spacing = 3.5f / std::sqrt(static_cast<float>(count));
  for (size_t i = 0; i < count; ++i) {
    const float z = 2 * number(1, i) - 1, turn = 6.2832f * number(2, i), r = std::sqrt(1 - z * z);
    const float place[3] = {r * std::cos(turn), r * std::sin(turn), z};
    for (size_t axis = 0; axis < 3; ++axis) {
      moving.splats.positions[3 * i + axis] = place[axis];
      moving.splats.scales[3 * i + axis] = spacing * (0.3f + 0.7f * number(3 + axis, i));
      for (size_t wave = 0; wave < kMotionWaves; ++wave) {
        moving.waves[wave][3 * i + axis] =
            0.3f * place[(axis + 1) % 3] / static_cast<float>(wave + 1) +
            0.2f * spacing * (number(10 + 3 * wave + axis, i) - 0.5f);
      }
      moving.splats.sh[3 * i + axis] = 0.3f * place[axis];
    }
    for (size_t k = 0; k < 4; ++k) {
      moving.splats.rotations[4 * i + k] = number(40 + k, i) + 0.1f;
      moving.spins[4 * i + k] = 0.1f * number(50 + k, i);
    }
    moving.splats.opacities[i] = 0.9f;
    moving.lifespans.insert(moving.lifespans.end(), {1.0f, 0.8f});
    constexpr float kCentres[] = {0, 20 / 48.0f, 40 / 48.0f, 47 / 48.0f};
    moving.centres.push_back(kCentres[i % 4]);
  }
  return moving;
}

/// No target: the ratio shows what times cost.
void build(benchmark::State& state, size_t count) {
  const MotionCloud moving = bendingBall(count);
  const SplatCloud still = splatsAt(moving, 1);
  withThreads(2, [&] {
    compare(
        state, "tree_of_one_time",
        [&] { benchmark::DoNotOptimize(buildMovingTree(moving, {}, {}).parents.data()); },
        [&] { benchmark::DoNotOptimize(buildMergeTree(still, {}, {}).parents.data()); });
  });
}

/// A tree whose cuts have inner nodes and leaves from everywhere; it merges nothing.
std::shared_ptr<const MovingTree> scatteredTree(const MotionCloud& leaves) {
  auto tree = std::make_shared<MovingTree>();
  const auto count = static_cast<uint32_t>(leaves.size());
  tree->nodes = bendingBall(count - 1);
  tree->errors.assign(count - 1, 1);
  tree->parents.assign(2 * count - 1, TreeShape::kNoParent);
  std::vector<uint32_t> free = {0, 0};
  for (uint32_t id = 1; id < 2 * count - 1; ++id) {
    std::swap(free[keyedBits(9, RandomUse::kThinning, id) % free.size()], free.back());
    tree->parents[id] = free.back();
    free.pop_back();
    if (id < count - 1) free.insert(free.end(), {id, id});
  }
  return tree;
}

/// 200,000 of 300,000 splats at another time in every turn.
void cut(benchmark::State& state) {
  constexpr size_t kCount = 300000, kBudget = 200000;
  MotionCloud leaves = bendingBall(kCount);
  auto tree = scatteredTree(leaves);
  const MovingDecoder decoder(std::move(leaves), std::move(tree));
  DecodeRequest request;
  request.budget = kBudget;
  const SplatCloud shown = decoder.decode(request);
  withThreads(2, [&] {
    compare(
        state, "copy",
        [&] {
          request.time += 1 / 24.0;
          if (request.time > 1.9) request.time = 0;
          benchmark::DoNotOptimize(decoder.decode(request).positions.data());
        },
        [&] {
          const SplatCloud copy = shown;
          benchmark::DoNotOptimize(copy.positions.data());
        });
  });
  state.counters["ratio_frame_limit"] = state.counters["best_ms"] / kFrameMilliseconds;
}

BENCHMARK_CAPTURE(build, 60k, size_t{60000})
    ->Name("motion.tree.60k")
    ->UseManualTime()
    ->Iterations(2)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(build, 200k, size_t{200000})
    ->Name("motion.tree.200k")
    ->UseManualTime()
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(cut)
    ->Name("motion.cut.200k")
    ->UseManualTime()
    ->Iterations(20)
    ->Unit(benchmark::kMillisecond);

}  // namespace

}  // namespace stipple::bench
