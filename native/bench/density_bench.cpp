#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/openvdb_scatter.h"
#include "density/anchor_sampling.h"
#include "density/octree_density.h"

namespace stipple::bench {
namespace {

struct WeightedPoints {
  std::vector<float> positions;
  std::vector<float> weights;
};

/// A wavy sheet with weights that vary smoothly by a factor of four and from point to point.
WeightedPoints sheet(size_t count) {
  WeightedPoints points;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
  for (size_t i = 0; i < count; ++i) {
    const float x = uniform(random);
    const float y = uniform(random);
    const float z = 0.5f + 0.15f * std::sin(9.0f * x) * std::cos(7.0f * y);
    points.positions.insert(points.positions.end(), {x, y, z});
    points.weights.push_back((1.0f + 3.0f * x * y) * (0.5f + uniform(random)));
  }
  return points;
}

/// An octree of about a million leaves and the peer on the same density.
struct Scene {
  OctreeDensity density;
  std::unique_ptr<OpenvdbScatter> peer;
};

const Scene& scene() {
  static const Scene scene = [] {
    const WeightedPoints points = sheet(2500000);
    Scene made{OctreeDensity::fromPoints(points.positions, points.weights, {10}), nullptr};
    std::vector<uint64_t> cells{0};
    std::vector<double> log_q{0.0};
    for (int level = 0; level < 10; ++level) {
      std::vector<uint64_t> next_cells;
      std::vector<double> next_log_q;
      for (size_t i = 0; i < cells.size(); ++i) {
        for (size_t k = 0; k < 8; ++k) {
          const float log_p = made.density.logProbabilities(level)[8 * i + k];
          if (std::isinf(log_p)) continue;
          next_cells.push_back(cells[i] << 3 | k);
          next_log_q.push_back(log_q[i] + static_cast<double>(log_p));
        }
      }
      cells = std::move(next_cells);
      log_q = std::move(next_log_q);
    }
    for (double& value : log_q) value = std::exp(value);
    made.peer = std::make_unique<OpenvdbScatter>(cells, log_q);
    return made;
  }();
  return scene;
}

void sampleOn(unsigned threads, const AnchorSamplingOptions& options) {
  withThreads(threads, [&] {
    AnchorSet anchors = sampleAnchors(scene().density, options);
    benchmark::DoNotOptimize(anchors.positions.data());
  });
}

void label(benchmark::State& state, uint64_t count) {
  state.SetItemsProcessed(static_cast<int64_t>(count) * state.iterations());
  state.SetLabel(std::to_string(scene().density.leafCount()) + " leaves");
}

void againstOpenvdb(benchmark::State& state, AnchorOrder order, uint64_t count) {
  const double peer_count = static_cast<double>(scene().peer->scatter(count));
  compare(
      state, "openvdb", [&] { sampleOn(1, {.count = count, .order = order}); },
      [&] { benchmark::DoNotOptimize(scene().peer->scatter(count)); },
      peer_count / static_cast<double>(count));
  label(state, count);
}

void againstOneThread(benchmark::State& state, AnchorOrder order, uint64_t count) {
  scene();
  compare(
      state, "one_thread", [&] { sampleOn(2, {.count = count, .order = order}); },
      [&] { sampleOn(1, {.count = count, .order = order}); });
  label(state, count);
}

/// What two threads are worth on this machine at this moment: arithmetic that touches no memory.
void twoThreadArithmetic(benchmark::State& state) {
  const auto work = [](unsigned threads) {
    withThreads(threads, [] {
      parallelFor(64, 1, [](size_t begin, size_t) {
        uint64_t bits = begin;
        for (int i = 0; i < 150000; ++i) bits = mixBits(bits);
        benchmark::DoNotOptimize(bits);
      });
    });
  };
  compare(
      state, "one_thread", [&] { work(2); }, [&] { work(1); });
}

void sampleAlone(benchmark::State& state, AnchorOrder order, uint64_t count) {
  scene();
  for (auto step : state) {
    (void)step;
    sampleOn(1, {.count = count, .order = order});
  }
  label(state, count);
}

void withRanks(benchmark::State& state, uint64_t count) {
  scene();
  for (auto step : state) {
    (void)step;
    sampleOn(1, {.count = count, .order = AnchorOrder::kProgressive, .with_ranks = true});
  }
  label(state, count);
}

void fromPoints(benchmark::State& state, size_t count, unsigned threads) {
  const WeightedPoints points = sheet(count);
  for (auto step : state) {
    (void)step;
    withThreads(threads, [&] {
      const auto density = OctreeDensity::fromPoints(points.positions, points.weights, {10});
      benchmark::DoNotOptimize(density.leafCount());
    });
  }
  state.SetItemsProcessed(static_cast<int64_t>(count) * state.iterations());
}

const bool registered = [] {
  struct Size {
    const char* name;
    uint64_t count;
    int repeats;
  };
  for (const Size& size : {Size{"1M", 1000000, 12}, Size{"10M", 10000000, 6}}) {
    for (const auto order : {AnchorOrder::kSystematic, AnchorOrder::kProgressive}) {
      const std::string name =
          std::string("density.sample_") +
          (order == AnchorOrder::kSystematic ? "systematic." : "progressive.") + size.name;
      benchmark::RegisterBenchmark(name.c_str(), againstOpenvdb, order, size.count)
          ->UseManualTime()
          ->Iterations(size.repeats)
          ->Unit(benchmark::kMillisecond);
      benchmark::RegisterBenchmark((name + ".2threads").c_str(), againstOneThread, order,
                                   size.count)
          ->UseManualTime()
          ->Iterations(2 * size.repeats)
          ->Unit(benchmark::kMillisecond);
    }
    benchmark::RegisterBenchmark((std::string("density.ranks.") + size.name).c_str(), withRanks,
                                 size.count)
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::RegisterBenchmark("density.sample_systematic.50k", sampleAlone,
                               AnchorOrder::kSystematic, uint64_t{50000})
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("density.sample_progressive.50k", sampleAlone,
                               AnchorOrder::kProgressive, uint64_t{50000})
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("density.arithmetic.2threads", twoThreadArithmetic)
      ->UseManualTime()
      ->Iterations(24)
      ->Unit(benchmark::kMillisecond);
  for (const unsigned threads : {1u, 2u}) {
    const char* name = threads == 1 ? "density.from_points.1M" : "density.from_points.1M.2threads";
    benchmark::RegisterBenchmark(name, fromPoints, size_t{1000000}, threads)
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
