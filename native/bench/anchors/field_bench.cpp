// Whole iterations of a fit of a field, with the density gradient, split by what they do: against
// the passes of as many explicit splats, against a field over a far larger octree, and against
// those of other budgets. What its regularisers cost against looking at all pairs of anchors.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/anchors/ball_views.h"
#include "bench/comparison.h"
#include "decode/anchor_spacing.h"
#include "decode/field/field_decoder.h"
#include "density/learned_draws.h"
#include "splat/cpu/tiles/tile_lists.h"
#include "splat/render/render.h"
#include "train/backend/render_backend.h"
#include "train/loop/field_model.h"
#include "train/optimiser/field_regularisers.h"

namespace stipple::bench {
namespace {

struct FieldCase {
  const char* name;
  uint64_t anchors;
  uint32_t size;  ///< pixels a side
};
constexpr FieldCase kCases[] = {{"4k_256x256", 4096, 256}, {"16k_512x512", 16384, 512}};
constexpr uint32_t kGaussians = 4;
constexpr int kSteps = 10;

std::unique_ptr<FitModel> modelOf(const BallViews& ball, const FieldCase& c, int leaf_level) {
  FieldModelOptions options;
  options.least_anchors = options.most_anchors = c.anchors;
  options.gaussians_per_anchor = kGaussians;
  options.leaf_level = leaf_level;
  options.shell = ShellChoice::kOff;
  const std::vector<size_t> training = {0};
  return makeFieldModel(*cpuBackends(), ball.views(), training, options);
}

void steps(benchmark::State& state, const FieldCase& c) {
  const BallViews few(20000, c.size), many(600000, c.size);
  const auto small = modelOf(few, c, 7), large = modelOf(many, c, 9);
  // The passes of explicit splats that look the same.
  StatisticRequest request;
  request.contributions = true;
  const ExplicitPasses passes(few, small->splats(c.anchors), request);
  uint64_t iteration = 1000;
  StepSeconds least;
  double best = 1e300, best_large = 1e300, best_passes = 1e300;
  few.step(*small, iteration);
  many.step(*large, iteration);
  passes();
  for (auto step : state) {
    (void)step;
    ++iteration;
    StepReport report;
    const double seconds = secondsOf([&] { report = few.step(*small, iteration); });
    state.SetIterationTime(seconds);
    if (seconds < best) least = report.seconds;
    best = std::min(best, seconds);
    best_large = std::min(best_large, secondsOf([&] { many.step(*large, iteration); }));
    best_passes = std::min(best_passes, secondsOf(passes));
  }
  state.counters["step_ms"] = 1e3 * best;
  state.counters["render_ms"] = 1e3 * least.render;
  state.counters["backward_ms"] = 1e3 * least.backward;
  state.counters["field_ms"] = 1e3 * least.field;
  state.counters["optimiser_ms"] = 1e3 * least.optimiser;
  state.counters["edit_ms"] = 1e3 * least.edit;
  state.counters["large_octree_ms"] = 1e3 * best_large;
  state.counters["passes_ms"] = 1e3 * best_passes;
  // Thirty times as many points in cells of a quarter of the side: colder memory and two levels
  // more, but not thirty times the work.
  state.counters["ratio_large_octree"] = best / best_large;
  state.counters["ratio_explicit_passes"] = best_passes / best;
}

/// Pairs of a splat and a tile that it reaches.
double pairsOf(const SplatCloud& cloud, const Camera& camera) {
  const SplatInstance instance{&cloud};
  const PlacedScene scene = placeScene({&instance, 1}, camera, RenderOptions{});
  const VisibleSplats visible = findVisibleSplats(scene, nullptr);
  size_t pairs = 0;
  forEachTileGroup(visible, TileGrid(camera.width, camera.height), nullptr,
                   [&](const TileListGroup& group) {
                     for (size_t t = group.first_tile; t < group.end_tile; ++t) {
                       pairs += group.tile(t).size();
                     }
                   });
  return static_cast<double>(pairs);
}

/// Steps of the same octree at budgets that double, by turns: time against pairs.
void growth(benchmark::State& state) {
  constexpr std::array<uint64_t, 5> kBudgets = {2048, 4096, 8192, 16384, 32768};
  const BallViews ball(20000, 512);
  std::vector<std::unique_ptr<FitModel>> models;
  std::array<double, kBudgets.size()> best, passes, pairs;
  best.fill(1e300);
  passes.fill(1e300);
  uint64_t iteration = 1000;
  for (size_t b = 0; b < kBudgets.size(); ++b) {
    models.push_back(modelOf(ball, {"", kBudgets[b], 512}, 8));
    ball.step(*models[b], iteration);
    pairs[b] = pairsOf(models[b]->splats(kBudgets[b]), ball.views().camera(0));
  }
  for (auto step : state) {
    (void)step;
    ++iteration;
    double sum = 0;
    for (size_t b = 0; b < kBudgets.size(); ++b) {
      StepReport report;
      const double seconds = secondsOf([&] { report = ball.step(*models[b], iteration); });
      best[b] = std::min(best[b], seconds);
      passes[b] = std::min(passes[b], report.seconds.render + report.seconds.backward);
      sum += seconds;
    }
    state.SetIterationTime(sum);
  }
  for (size_t b = 0; b < kBudgets.size(); ++b) {
    const std::string budget = std::to_string(kBudgets[b]);
    state.counters["ms_" + budget] = 1e3 * best[b];
    state.counters["drawing_ms_" + budget] = 1e3 * passes[b];
    state.counters["kpairs_" + budget] = 1e-3 * pairs[b];
  }
  // Above 1: less than in proportion, as of what the budget does not change. Drawing and its way
  // back go by pairs, which grow more slowly than anchors do, as smaller splats reach fewer tiles;
  // all else goes by anchors.
  state.counters["ratio_pairs"] = (passes[0] / pairs[0]) / (passes.back() / pairs.back());
  state.counters["ratio_anchors"] = 16 * best[0] / best.back();
}

/// The spread of a field's Gaussians against all pairs of its anchors.
void spread(benchmark::State& state, uint64_t anchor_count) {
  const BallViews ball(20000, 64);
  const auto model = modelOf(ball, {"", anchor_count, 64}, 8);
  const FieldResult result = *fieldResult(*model);
  AnchorSamplingOptions sampling;
  sampling.count = anchor_count;
  const AnchorSet anchors = drawLearned(result.density, sampling, result.draws);
  FieldTape tape;
  SplatCloud cloud;
  FieldDecoder(result.field).forward(anchors, tape, cloud);
  SplatCloud gradient = cloud;
  double of_all = 0;
  const auto allPairs = [&] {
    std::vector<double> sums(anchor_count);
    parallelFor(anchor_count, 64, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const float* a = &anchors.positions[i * 3];
        double squares = 0;
        for (size_t k = 0; k < kGaussians * 3; ++k) {
          const double offset =
              static_cast<double>(tape.centres[i * kGaussians * 3 + k] - a[k % 3]);
          squares += offset * offset / kGaussians;
        }
        const auto reach = static_cast<float>(squares);
        for (size_t j = 0; j < anchor_count; ++j) {
          const float* b = &anchors.positions[j * 3];
          const float x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
          const float distance = x * x + y * y + z * z;
          if (distance < reach && j != i)
            sums[i] += std::sqrt(squares) - std::sqrt(static_cast<double>(distance));
        }
      }
    });
    of_all = 0;
    for (const double sum : sums) of_all += sum;
    benchmark::DoNotOptimize(of_all);
  };
  double loss = 0;
  const auto ours = [&] {
    loss = regularise({}, *result.field, anchors, tape, cloud, gradient);
    benchmark::DoNotOptimize(loss);
  };
  compare(state, "all_pairs", ours, allPairs);
}

const bool registered = [] {
  benchmark::RegisterBenchmark("train.step.field.growth_512x512", growth)
      ->UseManualTime()
      ->Iterations(kSteps)
      ->Unit(benchmark::kMillisecond);
  for (const uint64_t anchors : {4096, 16384}) {
    benchmark::RegisterBenchmark(
        ("train.field_regularisers." + std::to_string(anchors >> 10) + "k").c_str(), spread,
        anchors)
        ->UseManualTime()
        ->Iterations(kSteps)
        ->Unit(benchmark::kMillisecond);
  }
  for (const FieldCase& c : kCases) {
    benchmark::RegisterBenchmark((std::string("train.step.field.") + c.name).c_str(), steps, c)
        ->UseManualTime()
        ->Iterations(kSteps)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
