#include <benchmark/benchmark.h>

#include <algorithm>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_floor.h"
#include "bench/splat_scene.h"
#include "splat/cpu/rays/ray_tiles.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/render/ray_render.h"

namespace stipple::bench {
namespace {

// A fit's start, a picture, a large scene; and many splats of a few pixels, the hardest load for
// everything around the blending loop. "small": about as many splats as pixels want; "large":
// early in a fit, or a close view.
constexpr SplatCase kCases[] = {
    {"small.15k_256x464", 15000, 256, 464, 0, 1.0},
    {"large.15k_256x464", 15000, 256, 464, 0, 3.0},
    {"small.150k_800x800", 150000, 800, 800, 3, 1.0},
    {"large.150k_800x800", 150000, 800, 800, 3, 3.0},
    {"small.500k_1280x720", 500000, 1280, 720, 2, 1.0},
    {"small.125k_1280x720", 125000, 1280, 720, 2, 1.0},
    {"small.1M_1280x720", 1000000, 1280, 720, 2, 1.0},
    {"large.1M_1280x720", 1000000, 1280, 720, 2, 4.0},
};
constexpr int kRepeats = 5;

void draw(const SplatCase& c, TileKernel kernel, unsigned threads,
          const RenderOptions& options = {}, bool holdout = false) {
  SplatInstance instance{&cloudOf(c)};
  instance.holdout = holdout;
  instance.values_are_checked = true;  // as every cloud handle is drawn, once it has been read
  withThreads(threads, [&] {
    // As a renderer keeps them from one picture to the next.
    static RenderWorkspace workspace;
    static RenderResult picture;
    renderTiledWith(kernel, chosenProjector(), {&instance, 1}, cameraOf(c), options, workspace,
                    picture);
    benchmark::DoNotOptimize(picture.colour.data());
  });
}

void label(benchmark::State& state, const SplatCase& c) {
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

/// The whole call over the blending loop alone on the same pair list: with 16x16 tiles and nothing
/// culled below them, with rows skipped, and as the renderer culls; and the list over the exact
/// one.
void againstFloor(benchmark::State& state, const SplatCase& c) {
  const SplatInstance instance{&cloudOf(c)};
  draw(c, chosenTileKernel(), 2);
  double best = 1e300;
  for (auto step : state) {
    (void)step;
    const double seconds = secondsOf([&] { draw(c, chosenTileKernel(), 2); });
    best = std::min(best, seconds);
    state.SetIterationTime(seconds);
  }
  const BlendFloor floor =
      measureBlendFloor({&instance, 1}, cameraOf(c), chosenTileKernel(), 2, kRepeats);
  label(state, c);
  const double pixels = static_cast<double>(c.width) * c.height;
  state.counters["best_ms"] = 1e3 * best;
  state.counters["floor_ms"] = 1e3 * floor.seconds;
  state.counters["row_skip_floor_ms"] = 1e3 * floor.row_skip_seconds;
  state.counters["culled_floor_ms"] = 1e3 * floor.culled_seconds;
  state.counters["tested_per_pixel"] =
      static_cast<double>(floor.listed_pairs) * kTilePixelCount / pixels;
  state.counters["ratio_floor"] = best / floor.seconds;
  state.counters["ratio_row_skip_floor"] = best / floor.row_skip_seconds;
  const double per_pair = 2e9 / (static_cast<double>(floor.listed_pairs) * kTilePixelCount);
  state.counters["ns_per_listed_pair_call"] = best * per_pair;
  state.counters["ns_per_listed_pair_whole"] = floor.seconds * per_pair;
  state.counters["ns_per_listed_pair_row_skip"] = floor.row_skip_seconds * per_pair;
  state.counters["ns_per_listed_pair_culled"] = floor.culled_seconds * per_pair;
  state.counters["ratio_culled_floor"] = best / floor.culled_seconds;
  state.counters["ratio_exact_pairs"] =
      static_cast<double>(floor.listed_pairs) / static_cast<double>(floor.exact_pairs);
  if (floor.missing_pairs > 0) state.SkipWithError("the pair list lacks pairs of the exact one");
}

/// Vector code against the plain scalar kernel; everything else is the same.
void againstScalar(benchmark::State& state, const SplatCase& c) {
  draw(c, chosenTileKernel(), 2);
  compare(
      state, "scalar", [&] { draw(c, chosenTileKernel(), 2); },
      [&] { draw(c, blendTileScalar, 2); });
}

/// The loop alone: AVX2 over the best instruction set, both on the same lists.
void againstNarrow(benchmark::State& state, const SplatCase& c) {
  const SplatInstance instance{&cloudOf(c)};
  TileKernel narrow = nullptr;
  for (const NamedTileKernel& named : tileKernels()) {
    if (std::string(named.target) == "AVX2") narrow = named.kernel;
  }
  if (!narrow || narrow == chosenTileKernel()) {
    state.SkipWithError("this processor has no wider instruction set than AVX2");
    return;
  }
  double wide_ms = 1e300, narrow_ms = 1e300;
  for (auto step : state) {
    (void)step;
    const auto best = [&](TileKernel kernel) {
      return 1e3 * measureBlendFloor({&instance, 1}, cameraOf(c), kernel, 2, 2).culled_seconds;
    };
    wide_ms = std::min(wide_ms, best(chosenTileKernel()));
    narrow_ms = std::min(narrow_ms, best(narrow));
    state.SetIterationTime(1e-3 * narrow_ms);
  }
  state.counters["best_ms"] = wide_ms;
  state.counters["avx2_ms"] = narrow_ms;
  state.counters["ratio_avx2_throughput"] = wide_ms / narrow_ms;
}

void againstOneThread(benchmark::State& state, const SplatCase& c) {
  draw(c, chosenTileKernel(), 2);
  compare(
      state, "one_thread", [&] { draw(c, chosenTileKernel(), 2); },
      [&] { draw(c, chosenTileKernel(), 1); });
}

/// A half transparent surface through the middle of the scene over the whole picture, the most that
/// a surface can cost, against the picture without; and an opaque one, which ends every pixel
/// there.
void withSurface(benchmark::State& state, const SplatCase& c) {
  const Camera camera = cameraOf(c);
  const size_t pixel_count = static_cast<size_t>(c.width) * c.height;
  const float middle = static_cast<float>(camera.world_to_camera(2, 3));
  const std::vector<float> depth(pixel_count, middle);
  const std::vector<float> colour(pixel_count * 4, 0.5f);
  RenderOptions half, matte;
  half.surface = {c.width, c.height, depth.data(), colour.data(), nullptr};
  matte.surface = {c.width, c.height, depth.data(), nullptr, nullptr};
  const TileKernel kernel = chosenTileKernel();
  draw(c, kernel, 2);
  compare(
      state, "surface_to_none", [&] { draw(c, kernel, 2, half); }, [&] { draw(c, kernel, 2); });
  double matte_seconds = 1e300;
  for (int i = 0; i < kRepeats; ++i) {
    matte_seconds = std::min(matte_seconds, secondsOf([&] { draw(c, kernel, 2, matte); }));
  }
  state.counters["matte_ms"] = 1e3 * matte_seconds;
}

/// The splats as a holdout against the same splats as they are: tiles are blended twice, nothing
/// else is done again.
void asHoldout(benchmark::State& state, const SplatCase& c) {
  const TileKernel kernel = chosenTileKernel();
  draw(c, kernel, 2);
  compare(
      state, "holdout_to_shown", [&] { draw(c, kernel, 2, {}, true); },
      [&] { draw(c, kernel, 2); });
}

/// Exact rays in their exact order, and each of the two alone, in single precision against the
/// whole tiled call; and double precision on a part of the picture, per pixel. What rays cannot
/// save over tiles: every pixel that blends sorts what it meets, about log2(blended) comparisons a
/// splat, and blends in double, lane by lane; the tiled loop does 8 or 16 lanes at once. So the
/// floor is about 4 times the tiled call, and the limit what splats of a few pixels cost beyond it.
void alongRays(benchmark::State& state, const SplatCase& c) {
  const SplatInstance instance{&cloudOf(c)};
  const Camera camera = cameraOf(c);
  draw(c, chosenTileKernel(), 2);
  std::vector<PixelArea> part;  // a diagonal of blocks
  for (uint32_t k = 0; (k + 1) * kRayBlockSide <= std::min(c.width, c.height); k += 2) {
    part.push_back({k * kRayBlockSide, k * kRayBlockSide, kRayBlockSide, kRayBlockSide});
  }
  double tiled = 1e300, both = 1e300, order = 1e300, projection = 1e300, exact = 1e300;
  for (auto step : state) {
    (void)step;
    const auto follow = [&](const RayOptions& options, bool in_double) {
      return secondsOf([&] {
        withThreads(2, [&] {
          const auto draw_rays = in_double ? renderRays : renderRayTiles;
          draw_rays({&instance, 1}, camera, {}, options, nullptr);
        });
      });
    };
    RayOptions ordered, projected, blocks;
    ordered.projection = RayProjection::kAffine;
    projected.order = RayOrder::kCentre;
    blocks.areas = part;
    tiled = std::min(tiled, secondsOf([&] { draw(c, chosenTileKernel(), 2); }));
    both = std::min(both, follow({}, false));
    order = std::min(order, follow(ordered, false));
    projection = std::min(projection, follow(projected, false));
    exact = std::min(exact, follow(blocks, true));
    state.SetIterationTime(both);
  }
  label(state, c);
  const double pixels = static_cast<double>(c.width) * c.height;
  const double per_pixel =
      exact / (static_cast<double>(part.size()) * kRayBlockSide * kRayBlockSide);
  state.counters["tiled_ms"] = 1e3 * tiled;
  state.counters["best_ms"] = 1e3 * both;
  state.counters["ratio_rays_to_tiled"] = both / tiled;
  state.counters["ratio_order_to_tiled"] = order / tiled;
  state.counters["ratio_projection_to_tiled"] = projection / tiled;
  state.counters["ratio_double_to_rays_per_pixel"] = per_pixel * pixels / both;
}

/// A cut-off of 1e-4 against the ray tiles, which follow every splat at every pixel of its reach,
/// and against 1/255 and a cut-off of 0.02: coarser must not be slower.
void atCutOff(benchmark::State& state, const SplatCase& c) {
  const SplatInstance instance{&cloudOf(c)};
  const Camera camera = cameraOf(c);
  const TileKernel kernel = chosenTileKernel();
  RenderOptions fine, coarse;
  fine.least_alpha = 1e-4;
  coarse.least_alpha = 0.02;
  RayOptions rays;
  rays.order = RayOrder::kCentre;
  rays.projection = RayProjection::kAffine;
  rays.limits.least_alpha = fine.least_alpha;
  draw(c, kernel, 2, fine);
  compareWithAll(
      state, [&] { draw(c, kernel, 2, fine); },
      {{"usual", [&] { draw(c, kernel, 2); }},
       {"coarse", [&] { draw(c, kernel, 2, coarse); }},
       {"rays", [&] {
          withThreads(2, [&] { renderRayTiles({&instance, 1}, camera, {}, rays, nullptr); });
        }}});
}

void add(const std::string& name, void (*run)(benchmark::State&, const SplatCase&),
         const SplatCase& c, int iterations) {
  benchmark::RegisterBenchmark(name.c_str(), run, c)
      ->UseManualTime()
      ->Iterations(iterations)
      ->Unit(benchmark::kMillisecond);
}

const bool registered = [] {
  for (const SplatCase& c : kCases) {
    add(std::string("splat.forward_") + c.name, againstFloor, c, kRepeats);
    add(std::string("splat.forward_2_threads_") + c.name, againstOneThread, c, kRepeats);
    add(std::string("splat.forward_avx2_") + c.name, againstNarrow, c, 2);
    add(std::string("splat.forward_scalar_") + c.name, againstScalar, c, 2);
    add(std::string("splat.rays_") + c.name, alongRays, c, 2);
    add(std::string("splat.cut_off_") + c.name, atCutOff, c, kRepeats);
    add(std::string("splat.surface_") + c.name, withSurface, c, kRepeats);
    add(std::string("splat.holdout_") + c.name, asHoldout, c, kRepeats);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
