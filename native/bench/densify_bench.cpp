// Density control of a finished cloud against the passes over its views alone.
#include <benchmark/benchmark.h>

#include <numeric>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "bench/splat_views.h"
#include "train/backend/render_backend.h"
#include "train/loop/densify_cloud.h"
#include "train/loop/picture_store.h"

namespace stipple::bench {
namespace {

constexpr SplatCase kCase = {"150k_800x800", 150000, 800, 800, 0, 1.0};
constexpr size_t kViews = 4;
constexpr int kRounds = 3;

/// Every view once: its picture, the drawing, the loss and the backward pass with statistics.
void bareLooks(const std::shared_ptr<const ViewSource>& views) {
  PictureStore pictures(views, UINT64_MAX);
  TargetPicture target;
  const double black[3] = {0, 0, 0};
  const auto backend = makeCpuBackend();
  backend->upload(cloudOf(kCase));
  RenderOptions drawing;
  drawing.with_depth = false;
  drawing.with_background = true;
  StatisticRequest request;
  request.screen_gradients = true;
  for (size_t v = 0; v < kViews; ++v) {
    pictures.load(v, black, target);
    backend->forward(views->camera(v), drawing);
    backend->loss(target.colour, {});
    backend->backward(request);
  }
}

void densify(benchmark::State& state) {
  const auto views = viewsOf(kCase, kViews);
  std::vector<size_t> shown(kViews);
  std::iota(shown.begin(), shown.end(), size_t{0});
  DensifyOptions options;
  options.strategy = "adaptive(threshold=1e-9)";  // every splat that is seen multiplies
  withThreads(2, [&] {
    compare(
        state, "bare_looks",
        [&] {
          benchmark::DoNotOptimize(
              densifyCloud(*cpuBackends(), cloudOf(kCase), views, shown, options));
        },
        [&] { bareLooks(views); });
  });
}

BENCHMARK(densify)
    ->Name("train.densify_cloud.150k_800x800")
    ->UseManualTime()
    ->Iterations(kRounds)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stipple::bench
