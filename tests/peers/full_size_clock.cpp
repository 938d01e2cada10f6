#include "peers/full_size_clock.h"

#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <fstream>
#include <string>

#include "base/parallel.h"
#include "nn/matrix_backend.h"

namespace stipple {

double seconds() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count();
}

double processorSeconds() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const auto of = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return of(usage.ru_utime) + of(usage.ru_stime);
}

ProcessMemory ProcessMemory::now() {
  ProcessMemory memory;
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("RssAnon:")) memory.own = std::stoul(line.substr(8)) * 1024;
    if (line.starts_with("RssFile:")) memory.mapped = std::stoul(line.substr(8)) * 1024;
  }
  return memory;
}

void printMachine() {
  std::printf("%s %s, at most %zu threads\n", defaultMatrixBackend().name(),
              defaultMatrixBackend().instructionSets().c_str(), threadLimit());
}

}  // namespace stipple
