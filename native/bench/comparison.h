#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "base/stopwatch.h"

namespace stipple::bench {

/// Seconds that `work` takes.
template <class Work>
double secondsOf(const Work& work) {
  const Stopwatch watch;
  work();
  return watch.seconds();
}

/// Work to compare with.
struct Reference {
  std::string name;
  std::function<void()> work;
};

/// Times `ours` and every reference in turn, so that all meet the same machine, and reports the
/// ratios of the best times as counters `ratio_<name>`, which limits.txt may judge; `reference_ms` is
/// the first one's. The benchmark must use manual time.
template <class Ours>
void compareWithAll(benchmark::State& state, const Ours& ours,
                    const std::vector<Reference>& references) {
  double best_ours = 1e300;
  std::vector<double> best(references.size(), 1e300);
  for (auto step : state) {
    (void)step;
    for (size_t r = 0; r < references.size(); ++r) {
      best[r] = std::min(best[r], secondsOf(references[r].work));
    }
    const double seconds = secondsOf(ours);
    best_ours = std::min(best_ours, seconds);
    state.SetIterationTime(seconds);
  }
  state.counters["best_ms"] = 1e3 * best_ours;
  state.counters["reference_ms"] = 1e3 * best.front();
  for (size_t r = 0; r < references.size(); ++r) {
    state.counters["ratio_" + references[r].name] = best[r] / best_ours;
  }
}

/// Times `ours` and `reference` in turn, so that both meet the same machine, and reports the ratio
/// of the best times as counter `ratio_<name>`; the main program prints all such ratios in a table,
/// and limits.txt may judge them. The benchmark must use manual time. In: reference_work_per_ours: how
/// much more the reference does in one call (points over points).
template <class Ours, class Reference>
void compare(benchmark::State& state, const std::string& name, const Ours& ours,
             const Reference& reference, double reference_work_per_ours = 1.0) {
  double best_ours = 1e300;
  double best_reference = 1e300;
  for (auto step : state) {
    (void)step;
    best_reference = std::min(best_reference, secondsOf(reference));
    const double seconds = secondsOf(ours);
    best_ours = std::min(best_ours, seconds);
    state.SetIterationTime(seconds);
  }
  state.counters["best_ms"] = 1e3 * best_ours;
  state.counters["reference_ms"] = 1e3 * best_reference;
  state.counters["ratio_" + name] = best_reference / best_ours / reference_work_per_ours;
}

}  // namespace stipple::bench
