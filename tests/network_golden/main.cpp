// Runs every stage that a golden file of a network has numbers for, and compares.
//
//   network_golden FILE...
//
// Prints the largest error of each stage beside what is allowed. Exits with 1 where a stage is
// beyond its tolerance, and where a file has no stage that is known here.

#include <cstdio>
#include <exception>

#include "network_golden/stages.h"

namespace stipple {
namespace {

bool runFile(const char* path) {
  std::printf("%s\n", path);
  StageReport report;
  const GoldenFile file(path);
  struct Group {
    const char* name;
    void (*run)(const GoldenFile&, StageReport&);
  };
  const Group groups[] = {{"encoders", encoderStages},
                          {"flow", flowStages},
                          {"decoder", decoderStages},
                          {"whole", wholeStages}};
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

int main(int count, char** arguments) {
  if (count < 2) {
    std::fprintf(stderr, "network_golden FILE...\n");
    return 2;
  }
  bool passed = true;
  for (int i = 1; i < count; ++i) {
    try {
      passed &= stipple::runFile(arguments[i]);
    } catch (const std::exception& error) {
      std::printf("FAIL  %s\n", error.what());
      passed = false;
    }
  }
  return passed ? 0 : 1;
}
