// The merge tree of an existing cloud. References: the nearest-neighbour search that any bottom-up
// tree begins with, over the same positions; a copy of as many splats as a cut has.
#include <benchmark/benchmark.h>

#include <memory>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "decode/tree/hierarchy_decoder.h"
#include "decode/tree/merge_neighbours.h"
#include "decode/tree/merge_rounds.h"

namespace stipple::bench {

namespace {

constexpr SplatCase k100k{"tree.100k", 100000, 0, 0, 0, 1.0};
constexpr SplatCase k300k{"tree.300k", 300000, 0, 0, 0, 1.0};
constexpr SplatCase k300kDegree3{"tree.300k.degree3", 300000, 0, 0, 3, 1.0};
/// A slider that is dragged shows a cut within this time, on one thread.
constexpr double kDragMilliseconds = 50;

/// No target: the ratio shows changes.
void build(benchmark::State& state, const SplatCase& c) {
  const SplatCloud& cloud = cloudOf(c);
  const std::vector<double> places(cloud.positions.begin(), cloud.positions.end());
  compare(
      state, "neighbour_search",
      [&] { benchmark::DoNotOptimize(buildMergeTree(cloud, {}, {}).parents.data()); },
      [&] { benchmark::DoNotOptimize(nearestNeighbours(places, kMergeNeighbours).data()); });
}

/// 150,000 of 300,000 splats.
void cut(benchmark::State& state, const SplatCase& c) {
  constexpr size_t kBudget = 150000;
  const auto leaves = std::make_shared<const SplatCloud>(cloudOf(c));
  const HierarchyDecoder decoder(
      leaves, std::make_shared<const MergeTree>(buildMergeTree(*leaves, {}, {})));
  DecodeRequest request;
  request.budget = kBudget;
  const SplatCloud shown = decoder.decode(request);
  withThreads(1, [&] {
    compare(
        state, "copy", [&] { benchmark::DoNotOptimize(decoder.decode(request).positions.data()); },
        [&] {
          const SplatCloud copy = shown;
          benchmark::DoNotOptimize(copy.positions.data());
        });
  });
  state.counters["ratio_drag_limit"] = state.counters["best_ms"] / kDragMilliseconds;
}

BENCHMARK_CAPTURE(build, 100k, k100k)
    ->Name("tree.build.100k")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(build, 300k, k300k)
    ->Name("tree.build.300k")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(cut, degree0, k300k)
    ->Name("tree.cut.150k")
    ->UseManualTime()
    ->Iterations(20)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(cut, degree3, k300kDegree3)
    ->Name("tree.cut.150k.degree3")
    ->UseManualTime()
    ->Iterations(10)
    ->Unit(benchmark::kMillisecond);

}  // namespace

}  // namespace stipple::bench
