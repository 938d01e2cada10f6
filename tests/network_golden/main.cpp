// Runs every stage that a golden file of a network has numbers for, and compares.
//
//   network_golden [--precision float32|bfloat16] [--weights float16|bfloat16] FILE...
//
// Prints the largest error of each stage beside what is allowed. Exits with 1 where a stage is
// beyond its tolerance, and where a file has no stage that is known here.
//
// --precision: products of matrices have factors of so many bits; --weights: weights are rounded
// first. With either of them errors are told and not judged: the largest, and the root of their
// mean square over that of the numbers. Cells and anchors are the recorded ones then.

#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "base/error.h"
#include "network_golden/stages.h"
#include "nn/matrix_backend.h"

namespace stipple {
namespace {

struct Arguments {
  GoldenNumbers numbers;
  StageJudgement judgement = StageJudgement::kTolerances;
  std::vector<const char*> paths;
};

/// Errors: kInvalidArgument.
Arguments read(int count, char** words) {
  Arguments arguments;
  for (int i = 1; i < count; ++i) {
    const std::string word = words[i];
    if (word != "--precision" && word != "--weights") {
      arguments.paths.push_back(words[i]);
      continue;
    }
    const std::string value = i + 1 < count ? words[++i] : "";
    if (word == "--precision" && (value == "float32" || value == "bfloat16")) {
      arguments.numbers.precision =
          value == "float32" ? FactorPrecision::kFloat32 : FactorPrecision::kBfloat16;
    } else if (word == "--weights" && (value == "float16" || value == "bfloat16")) {
      arguments.numbers.weights = value == "float16" ? WeightType::kFloat16 : WeightType::kBfloat16;
    } else {
      fail(ErrorCode::kInvalidArgument, word + " is '" + value + "'; " +
                                            (word == "--weights" ? "float16" : "float32") +
                                            " or bfloat16 is allowed");
    }
    arguments.judgement = StageJudgement::kErrors;
  }
  const NetworkRun run = {.precision = arguments.numbers.precision};
  if (precisionOf(run) != arguments.numbers.precision) {
    fail(ErrorCode::kUnsupported,
         std::string(backendOf(run).name()) + " has no products of bfloat16 on this machine");
  }
  return arguments;
}

bool runFile(const char* path, const Arguments& arguments) {
  std::printf("%s\n", path);
  StageReport report(arguments.judgement);
  const GoldenFile file(path, arguments.numbers);
  struct Group {
    const char* name;
    void (*run)(const GoldenFile&, StageReport&);
  };
  const Group groups[] = {
      {"encoders", encoderStages},  {"flow", flowStages},
      {"decoder", decoderStages},   {"whole", wholeStages},
      {"training", trainingStages}, {"training of the flow", flowTrainingStages},
      {"detail", detailStages},     {"optimiser", optimiserStages}};
  for (const Group& group : groups) {
    try {
      group.run(file, report);
    } catch (const std::exception& error) {
      report.failed(group.name, error.what());
    }
  }
  if (report.stageCount() == 0) {
    std::printf("FAIL  The file has no stage that is known here.\n");
    return false;
  }
  std::printf("%zu stages, %zu beyond their tolerance\n", report.stageCount(),
              report.failureCount());
  return report.failureCount() == 0;
}

}  // namespace
}  // namespace stipple

int main(int count, char** words) {
  using namespace stipple;
  Arguments arguments;
  try {
    arguments = read(count, words);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  if (arguments.paths.empty()) {
    std::fprintf(stderr,
                 "network_golden [--precision float32|bfloat16] [--weights float16|bfloat16] "
                 "FILE...\n");
    return 2;
  }
  bool passed = true;
  for (const char* path : arguments.paths) {
    try {
      passed &= runFile(path, arguments);
    } catch (const std::exception& error) {
      std::printf("FAIL  %s\n", error.what());
      passed = false;
    }
  }
  return passed ? 0 : 1;
}
