#include <benchmark/benchmark.h>

#include <chrono>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "splat/cpu/tiles/tile.h"
#include "splat/cpu/tiles/tiled_backward.h"

namespace stipple::bench {
namespace {

constexpr SplatCase kCases[] = {{"15k_256x464", 15000, 256, 464, 0, 1.0},
                                {"150k_800x800", 150000, 800, 800, 3, 1.0}};
// Every pixel of every tile blends nearly every splat, so that a pair is a pair however it is
// counted.
constexpr SplatCase kFullTiles = {"full_tiles_256x464", 600, 256, 464, 0, 60.0, 0.02f};
constexpr int kRepeats = 5;

/// What the backward pass is given: derivatives and residuals without a pattern.
struct Loss {
  std::vector<float> gradient;
  std::vector<float> residual;
  std::vector<float> edges;

  explicit Loss(const SplatCase& c) {
    std::mt19937 random(2);
    std::uniform_real_distribution<float> uniform(-1.0f, 1.0f);
    const size_t pixels = static_cast<size_t>(c.width) * c.height;
    gradient.resize(pixels * 4);
    residual.resize(pixels * 3);
    for (float& value : gradient) value = uniform(random);
    for (float& value : residual) value = 0.1f * uniform(random);
    edges.resize(pixels);
    for (float& value : edges) value = 0.5f + 0.5f * uniform(random);
  }
  BackwardInput input(BackwardWants wants) const {
    BackwardInput input;
    if (wants.mode == BackwardMode::kWeights) {
      input.with_blending_weights = true;
      return input;
    }
    input.colour_gradient = gradient;
    if (wants.depth) input.depth_gradient = std::span(residual).first(residual.size() / 3);
    if (wants.mode == BackwardMode::kEdges) {
      input.edge_weights = edges;
      input.with_screen_gradients = true;
      return input;
    }
    if (wants.mode != BackwardMode::kGradients) input.residual = residual;
    if (wants.mode == BackwardMode::kStatistics) {
      input.with_blending_weights = true;
      input.with_screen_gradients = input.with_absolute_screen_gradients = true;
    }
    return input;
  }
};

RenderWorkspace& workspaceOf() {
  static RenderWorkspace workspace;
  workspace.keepForBackward(true);
  return workspace;
}

RenderResult& pictureOf() {
  static RenderResult picture;
  return picture;
}

/// As in training: the memory of the last step serves the next.
struct Step {
  BackwardWorkspace workspace;
  BackwardResult result;
};
Step& stepMemory() {
  static Step step;
  return step;
}

/// The call from nothing.
void fromNothing(const SplatCase& c, const BackwardInput& input) {
  const SplatInstance instance{&cloudOf(c)};
  withThreads(2, [&] {
    renderBackward({&instance, 1}, cameraOf(c), {}, input, stepMemory().workspace,
                   stepMemory().result);
  });
}

void draw(const SplatCase& c, unsigned threads) {
  const SplatInstance instance{&cloudOf(c)};
  withThreads(threads, [&] {
    renderTiled({&instance, 1}, cameraOf(c), {}, workspaceOf(), pictureOf());
  });
}

/// The call of a step of training, after `draw`.
void goBack(const BackwardInput& input, unsigned threads) {
  withThreads(threads, [&] {
    renderBackward(workspaceOf(), pictureOf(), input, stepMemory().workspace, stepMemory().result);
  });
}

/// The two loops alone, one thread, splats made ready outside the clock.
struct LoopTimes {
  double blend = 1e300;  ///< seconds, front to back
  double take_off = 1e300;
  /// The same over all 256 pixels of every pair, and without rows outside the splat's box; of plain
  /// gradients only.
  double take_off_whole = 1e300;
  double take_off_row_skip = 1e300;
  double listed = 0;   ///< pixel-splat pairs of the lists
  double reached = 0;  ///< of them, those in front of the last end of their tile's pixels
  double blended = 0;
};

/// Whether the loop can be timed with less culling.
bool hasLesserCullings(BackwardWants wants) {
  return wants.mode == BackwardMode::kGradients && !wants.depth;
}

void neverAsked(const void*, size_t, uint32_t, BackwardPixels&, float*) {}

LoopTimes measureLoops(const SplatCase& c, const BackwardKernel& kernel, const Loss& loss,
                       BackwardWants wants) {
  const SplatInstance instance{&cloudOf(c)};
  RenderOptions options;
  options.with_counts = true;
  LoopTimes times;
  for (const uint32_t n : renderTiled({&instance, 1}, cameraOf(c), options).counts) {
    times.blended += n;
  }
  const PlacedScene scene = placeScene({&instance, 1}, cameraOf(c), {});
  const VisibleSplats visible = findVisibleSplats(scene, nullptr);
  const TileGrid grid(c.width, c.height);
  const auto blended = std::make_unique<TilePixels>();
  const auto pixels = std::make_unique<BackwardPixels>();
  const auto state = std::make_unique<BackwardPixels>();
  std::vector<TileSplat> splats;
  std::vector<float> sums;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    double blend = 0;
    double take_off = 0, whole = 0, row_skip = 0;
    times.listed = times.reached = 0;
    forEachTileGroup(visible, grid, nullptr, [&](const TileListGroup& group) {
      for (size_t index = group.first_tile; index < group.end_tile; ++index) {
        const Tile tile = tileOf(grid, index, group.tile(index));
        splats.resize(tile.splats.size());
        float largest = 0;
        makeTileSplats(visible.splats.get(), tile, 0, splats.size(), largest, splats.data());
        sums.resize(splats.size() * backwardFieldCount(wants));
        clearPixels(tile, *blended);
        blend += secondsOf([&] {
          kernel.blend(splats.data(), splats.size(), {true, false}, *blended);
        });
        *state = {};
        for (uint32_t i = 0; i < kTilePixelCount; ++i) {
          state->transmittance[i] = blended->transmittance[i];
          state->end[i] = blended->end[i];
          state->row_end[i / kTileSide] = std::max(state->row_end[i / kTileSide], state->end[i]);
          for (size_t channel = 0; channel < 4; ++channel) {
            state->gradient[channel][i] = loss.gradient[i * 4 + channel];
          }
          for (size_t channel = 0; channel < 3; ++channel) {
            const float residual = loss.residual[i * 3 + channel];
            state->signed_weight[channel][i] = residual < 0 ? -1.0f : 1.0f;
            state->room[channel][i] = 2.0f * std::abs(residual);
          }
        }
        const int32_t most = *std::max_element(state->row_end, state->row_end + kTileSide);
        const size_t used = std::min(splats.size(), static_cast<size_t>(most));
        const auto timeTakeOff = [&](TileCulling culling) {
          *pixels = *state;
          return secondsOf([&] {
            kernel.take_off(splats.data(), used, {wants, 0, neverAsked, nullptr, culling}, *pixels,
                            sums.data());
          });
        };
        take_off += timeTakeOff(TileCulling::kAll);
        if (hasLesserCullings(wants)) {
          row_skip += timeTakeOff(TileCulling::kRows);
          whole += timeTakeOff(TileCulling::kNothing);
        }
        times.listed += static_cast<double>(splats.size()) * kTilePixelCount;
        times.reached += static_cast<double>(used) * kTilePixelCount;
      }
    });
    times.blend = std::min(times.blend, blend);
    times.take_off = std::min(times.take_off, take_off);
    times.take_off_whole = std::min(times.take_off_whole, whole);
    times.take_off_row_skip = std::min(times.take_off_row_skip, row_skip);
  }
  return times;
}

/// Both calls over their loops on the same lists. The call of a step of training goes back from the
/// picture that was drawn: its loop is the one that takes splats off, over all 256 pixels of every
/// pair of splat and tile (floor), without rows outside the splat's box, and as it is (culled). The
/// call from nothing blends first, so both loops are its floor, as they are of a drawing and a call
/// after it.
void againstFloor(benchmark::State& state, const SplatCase& c, BackwardWants wants) {
  const Loss loss(c);
  const BackwardInput input = loss.input(wants);
  fromNothing(c, input);
  draw(c, 2);
  goBack(input, 2);
  double alone = 1e300;
  double forward = 1e300;
  double backward = 1e300;
  for (auto step : state) {
    (void)step;
    alone = std::min(alone, secondsOf([&] { fromNothing(c, input); }));
    forward = std::min(forward, secondsOf([&] { draw(c, 2); }));
    const double seconds = secondsOf([&] { goBack(input, 2); });
    backward = std::min(backward, seconds);
    state.SetIterationTime(seconds);
  }
  const LoopTimes loops = measureLoops(c, chosenBackwardKernel(), loss, wants);
  state.counters["after_drawing_ms"] = 1e3 * backward;
  state.counters["from_nothing_ms"] = 1e3 * alone;
  state.counters["drawing_ms"] = 1e3 * forward;
  state.counters["blend_1_thread_ms"] = 1e3 * loops.blend;
  state.counters["take_off_1_thread_ms"] = 1e3 * loops.take_off;
  state.counters["ns_per_listed_pair"] = 1e9 * loops.take_off / loops.listed;
  state.counters["ns_per_blended_pair"] = 1e9 * loops.take_off / loops.blended;
  if (hasLesserCullings(wants)) {
    state.counters["take_off_whole_1_thread_ms"] = 1e3 * loops.take_off_whole;
    state.counters["take_off_row_skip_1_thread_ms"] = 1e3 * loops.take_off_row_skip;
    state.counters["ns_per_reached_pair_whole"] = 1e9 * loops.take_off_whole / loops.reached;
    state.counters["ns_per_reached_pair_row_skip"] = 1e9 * loops.take_off_row_skip / loops.reached;
    state.counters["ratio_floor"] = backward / (loops.take_off_whole / 2);
    state.counters["ratio_row_skip_floor"] = backward / (loops.take_off_row_skip / 2);
  }
  state.counters["ns_per_listed_pair_call"] = 2e9 * backward / loops.listed;
  state.counters["ns_per_reached_pair_culled"] = 1e9 * loops.take_off / loops.reached;
  state.counters["ratio_culled_floor"] = backward / (loops.take_off / 2);
  state.counters["ratio_from_nothing"] = alone / ((loops.blend + loops.take_off) / 2);
  state.counters["ratio_drawing_and_after"] =
      (forward + backward) / ((loops.blend + loops.take_off) / 2);
}

/// What contributions add to the loop, per pair. "Listed" pairs are those of the lists, "blended"
/// those that a pixel shows; lanes that show nothing cost as much as others.
void contributionsPerPair(benchmark::State& state, const SplatCase& c) {
  const Loss loss(c);
  double plain = 1e300;
  double with = 1e300;
  LoopTimes times;
  for (auto step : state) {
    (void)step;
    times = measureLoops(c, chosenBackwardKernel(), loss, {BackwardMode::kGradients, false});
    plain = std::min(plain, times.take_off);
    times = measureLoops(c, chosenBackwardKernel(), loss, {BackwardMode::kContributions, false});
    with = std::min(with, times.take_off);
    state.SetIterationTime(times.take_off);
  }
  state.counters["take_off_ms"] = 1e3 * plain;
  state.counters["ns_per_blended_pair"] = 1e9 * plain / times.blended;
  state.counters["blended_of_listed"] = times.blended / times.listed;
  state.counters["ratio_ns_more_per_listed"] = 1e9 * (with - plain) / times.listed;
  state.counters["ratio_ns_more_per_blended"] = 1e9 * (with - plain) / times.blended;
}

void againstOneThread(benchmark::State& state, const SplatCase& c) {
  const Loss loss(c);
  const BackwardInput input = loss.input({BackwardMode::kGradients, false});
  draw(c, 2);
  compare(
      state, "one_thread", [&] { goBack(input, 2); }, [&] { goBack(input, 1); });
}

/// What `improved` asks for, over what `adaptive` does.
void edgesToGradients(benchmark::State& state, const SplatCase& c) {
  const Loss loss(c);
  BackwardInput plain = loss.input({BackwardMode::kGradients, false});
  plain.with_screen_gradients = true;
  const BackwardInput edges = loss.input({BackwardMode::kEdges, false});
  draw(c, 2);
  compare(
      state, "without", [&] { goBack(edges, 2); }, [&] { goBack(plain, 2); });
}

/// What visibility asks for, over what a step of a fit does.
void weightsToGradients(benchmark::State& state, const SplatCase& c) {
  const Loss loss(c);
  const BackwardInput plain = loss.input({BackwardMode::kGradients, false});
  const BackwardInput weights = loss.input({BackwardMode::kWeights, false});
  draw(c, 2);
  compare(
      state, "gradients", [&] { goBack(weights, 2); }, [&] { goBack(plain, 2); });
}

/// AVX2 over the best instruction set, the loop alone.
void againstNarrow(benchmark::State& state, const SplatCase& c) {
  const Loss loss(c);
  const BackwardKernel wide = chosenBackwardKernel();
  for (const BackwardKernel& narrow : backwardKernels()) {
    if (std::string(narrow.target) != "AVX2" || narrow.take_off == wide.take_off) continue;
    double wide_seconds = 1e300;
    double narrow_seconds = 1e300;
    for (auto step : state) {
      (void)step;
      const LoopTimes a = measureLoops(c, wide, loss, {BackwardMode::kGradients, false});
      const LoopTimes b = measureLoops(c, narrow, loss, {BackwardMode::kGradients, false});
      wide_seconds = std::min(wide_seconds, a.take_off);
      narrow_seconds = std::min(narrow_seconds, b.take_off);
      state.SetIterationTime(b.take_off);
    }
    state.counters["best_ms"] = 1e3 * wide_seconds;
    state.counters["avx2_ms"] = 1e3 * narrow_seconds;
    state.counters["ratio_avx2_throughput"] = wide_seconds / narrow_seconds;
    return;
  }
  state.SkipWithError("this processor has no wider instruction set than AVX2");
}

template <typename... Arguments>
void add(const std::string& name, int iterations, Arguments... arguments) {
  benchmark::RegisterBenchmark(name.c_str(), arguments...)
      ->UseManualTime()
      ->Iterations(iterations)
      ->Unit(benchmark::kMillisecond);
}

const bool registered = [] {
  add(std::string("splat.contributions_per_pair.") + kFullTiles.name, 2, contributionsPerPair,
      kFullTiles);
  for (const SplatCase& c : kCases) {
    const std::string name = c.name;
    add("splat.backward." + name, kRepeats, againstFloor, c,
        BackwardWants{BackwardMode::kGradients, false});
    add("splat.backward_depth." + name, kRepeats, againstFloor, c,
        BackwardWants{BackwardMode::kGradients, true});
    add("splat.backward_contributions." + name, kRepeats, againstFloor, c,
        BackwardWants{BackwardMode::kContributions, false});
    add("splat.backward_statistics." + name, kRepeats, againstFloor, c,
        BackwardWants{BackwardMode::kStatistics, false});
    add("splat.backward_edges." + name, kRepeats, edgesToGradients, c);
    add("splat.backward_weights." + name, kRepeats, weightsToGradients, c);
    add("splat.contributions_per_pair." + name, 2, contributionsPerPair, c);
    add("splat.backward_2_threads." + name, kRepeats, againstOneThread, c);
    add("splat.backward_avx2." + name, 1, againstNarrow, c);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
