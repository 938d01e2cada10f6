// The image of a fit's report. Reference: the same pixels, filled once with white.
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "bench/comparison.h"
#include "data/images/image.h"
#include "io/reports/fit_report.h"
#include "plot/plot_image.h"

namespace stipple::bench {

namespace {

FitHistory history(size_t iterations) {
  FitHistory made;
  for (size_t i = 0; i < iterations; ++i) {
    const auto t = static_cast<float>(i);
    FitRecord record;
    record.loss = 0.3f * std::exp(-t / 3000) + 0.02f + 0.01f * static_cast<float>(i * 7 % 11) / 11;
    record.splat_count = static_cast<uint32_t>(1000 + i);
    record.render_seconds = 0.004f + 1e-7f * t;
    record.backward_seconds = 0.009f + 2e-7f * t;
    record.optimiser_seconds = 0.002f;
    made.records.push_back(record);
    if ((i + 1) % (iterations / 20) != 0) continue;
    FitMeasure measure;
    measure.iteration = i + 1;
    measure.splat_count = record.splat_count;
    measure.psnr = 30 - 8 * std::exp(-static_cast<double>(i) / 4000);
    made.measures.push_back(measure);
  }
  return made;
}

/// At twice the size of its sheet, as Blender shows it. No target: the ratio shows changes.
void report(benchmark::State& state) {
  const FitHistory told = history(30000);
  const Image like = imageOf(sheetOf(fitPlots(told)), 2);
  compare(
      state, "fill",
      [&] { benchmark::DoNotOptimize(imageOf(sheetOf(fitPlots(told)), 2).pixels.data()); },
      [&] {
        const std::vector<float> white(like.pixels.size(), 1.0f);
        benchmark::DoNotOptimize(white.data());
      });
}
BENCHMARK(report)
    ->Name("plot.report.30k")
    ->UseManualTime()
    ->Iterations(10)
    ->Unit(benchmark::kMillisecond);

}  // namespace

}  // namespace stipple::bench
