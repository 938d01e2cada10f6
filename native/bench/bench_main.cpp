// Runs the benchmarks and ends with the ratios that they measured, which are counters ratio_X.
// `bash tests/run.sh --bench` judges them by limits.txt. --json is short for
// --benchmark_format=json.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

namespace {

struct Ratio {
  std::string benchmark;
  std::string against;
  double value;
};

template <class Reporter>
class RatioReporter final : public Reporter {
 public:
  void ReportRuns(const std::vector<benchmark::BenchmarkReporter::Run>& runs) override {
    Reporter::ReportRuns(runs);
    for (const auto& run : runs) {
      for (const auto& [name, counter] : run.counters) {
        if (name.rfind("ratio_", 0) != 0) continue;
        ratios.push_back({run.run_name.function_name, name.substr(6), counter.value});
      }
    }
  }
  std::vector<Ratio> ratios;
};

template <class Reporter>
int run(FILE* table) {
  RatioReporter<Reporter> reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  if (reporter.ratios.empty()) return 0;
  std::fprintf(table, "\n%-44s %-24s %8s\n", "benchmark", "against", "ratio");
  for (const Ratio& ratio : reporter.ratios) {
    std::fprintf(table, "%-44s %-24s %7.2fx\n", ratio.benchmark.c_str(), ratio.against.c_str(),
                 ratio.value);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  static char json_flag[] = "--benchmark_format=json";
  bool json = false;
  for (int i = 1; i < argc; ++i) {
    if (!std::strcmp(argv[i], "--json")) argv[i] = json_flag;
    json = json || !std::strcmp(argv[i], json_flag);
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  return json ? run<benchmark::JSONReporter>(stderr) : run<benchmark::ConsoleReporter>(stdout);
}
