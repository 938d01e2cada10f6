#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstring>
#include <numeric>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "splat/render/draw_order.h"
#include "splat/render/scene.h"

namespace stipple::bench {
namespace {

constexpr int kRepeats = 7;
constexpr double kSortLimitMs = 30.0;  ///< what the 3D view allows for 1 M splats

struct OrderCase {
  const char* name;
  SplatCase splats;
  bool with_rows;
};
constexpr OrderCase kCases[] = {
    {"viewport.sort.1M", {"order.1M", 1000000, 1280, 720, 0, 1.0}, false},
    {"viewport.sort_and_colour_degree_0.1M", {"order.1M", 1000000, 1280, 720, 0, 1.0}, true},
    {"viewport.sort_and_colour_degree_3.1M",
     {"order.1M_degree_3", 1000000, 1280, 720, 3, 1.0},
     true},
    {"viewport.sort.200k", {"order.200k", 200000, 1280, 720, 0, 1.0}, false},
};

/// What every order must read and write: positions, and the numbers that come out.
void passOverBytes(const SplatCloud& cloud, std::vector<uint32_t>& out) {
  parallelFor(cloud.size(), 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float sum =
          cloud.positions[i * 3] + cloud.positions[i * 3 + 1] + cloud.positions[i * 3 + 2];
      std::memcpy(&out[i], &sum, sizeof(sum));
    }
  });
}

/// The obvious way: depths, then std::sort of indices.
void sortPlainly(const SplatCloud& cloud, const Camera& camera, std::vector<uint32_t>& out) {
  std::vector<float> depth(cloud.size());
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float* p = &cloud.positions[i * 3];
    const auto& m = camera.world_to_camera;
    const double z = m(2, 0) * static_cast<double>(p[0]) + m(2, 1) * static_cast<double>(p[1]) +
                     m(2, 2) * static_cast<double>(p[2]) + m(2, 3);
    depth[i] = static_cast<float>(z);
  }
  std::iota(out.begin(), out.end(), 0u);
  std::sort(out.begin(), out.end(), [&](uint32_t a, uint32_t b) {
    return depth[a] != depth[b] ? depth[a] > depth[b] : a > b;
  });
}

void measure(benchmark::State& state, const OrderCase& c) {
  SplatInstance instance{&cloudOf(c.splats)};
  instance.values_are_checked = true;
  const SplatCloud& cloud = *instance.cloud;
  const Camera camera = cameraOf(c.splats);
  DrawOrderWorkspace workspace;
  std::vector<uint32_t> order(cloud.size()), other(cloud.size());
  std::vector<float> rows(c.with_rows ? cloud.size() * kDrawRowFloats : 0);
  const uint64_t first_row = 0;
  DrawOrderOutput output;
  output.order = order.data();
  if (c.with_rows) output.rows = rows.data(), output.first_rows = {&first_row, 1};
  double best = 1e300, pass = 1e300, plain = 1e300;
  withThreads(2, [&] {
    orderForDrawing({&instance, 1}, camera, output, workspace);
    for (auto step : state) {
      (void)step;
      const double seconds = secondsOf([&] {
        orderForDrawing({&instance, 1}, camera, output, workspace);
      });
      best = std::min(best, seconds);
      pass = std::min(pass, secondsOf([&] { passOverBytes(cloud, other); }));
      state.SetIterationTime(seconds);
    }
    plain = secondsOf([&] { sortPlainly(cloud, camera, other); });
  });
  if (order != other) state.SkipWithError("the order differs from the plain one");
  state.counters["best_ms"] = 1e3 * best;
  state.counters["pass_ms"] = 1e3 * pass;
  state.counters["ratio_std_sort"] = plain / best;
  state.counters["ratio_plain_pass"] = best / pass;
  if (c.splats.splats == 1000000 && !c.with_rows) {
    state.counters["ratio_30_ms"] = 1e3 * best / kSortLimitMs;
  }
}

const bool registered = [] {
  for (const OrderCase& c : kCases) {
    benchmark::RegisterBenchmark(c.name, measure, c)
        ->UseManualTime()
        ->Iterations(kRepeats)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
