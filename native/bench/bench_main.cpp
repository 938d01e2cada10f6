// Runs the benchmarks and ends with the ratios that they measured: counters ratio_X with target_X
// (at least) or limit_X (at most). --json is short for --benchmark_format=json.
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
  double target;  ///< at least; 0: none
  double limit;   ///< at most; 0: none
};

template <class Reporter>
class RatioReporter final : public Reporter {
 public:
  void ReportRuns(const std::vector<benchmark::BenchmarkReporter::Run>& runs) override {
    Reporter::ReportRuns(runs);
    for (const auto& run : runs) {
      for (const auto& [name, counter] : run.counters) {
        if (name.rfind("ratio_", 0) != 0) continue;
        const std::string against = name.substr(6);
        const auto bound = [&](const char* kind) {
          const auto found = run.counters.find(kind + against);
          return found == run.counters.end() ? 0.0 : found->second.value;
        };
        ratios.push_back({run.run_name.function_name, against, counter.value, bound("target_"),
                          bound("limit_")});
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
  std::fprintf(table, "\n%-44s %-16s %8s %8s\n", "benchmark", "against", "ratio", "target");
  for (const Ratio& ratio : reporter.ratios) {
    std::fprintf(table, "%-44s %-16s %7.2fx", ratio.benchmark.c_str(), ratio.against.c_str(),
                 ratio.value);
    if (ratio.target > 0.0) {
      std::fprintf(table, " %7.2fx %s", ratio.target,
                   ratio.value >= ratio.target ? "met" : "MISSED");
    }
    if (ratio.limit > 0.0) {
      std::fprintf(table, " <%6.2fx %s", ratio.limit,
                   ratio.value <= ratio.limit ? "met" : "MISSED");
    }
    std::fprintf(table, "\n");
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
