#pragma once

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <functional>
#include <thread>

namespace stipple {

/// Bytes of this process that no file lies behind.
inline uint64_t ownMemory() {
  std::ifstream file("/proc/self/statm");
  uint64_t total = 0, resident = 0, shared = 0;
  file >> total >> resident >> shared;
  return (resident - shared) * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

/// How much more of it there is at most while something runs, by looking every millisecond.
inline uint64_t peakMemoryOf(const std::function<void()>& work) {
  malloc_trim(0);  // what earlier tests have freed and the allocator has kept
  const uint64_t before = ownMemory();
  uint64_t most = before;
  std::atomic<bool> is_done{false};
  std::thread watch([&] {
    while (!is_done) {
      most = std::max(most, ownMemory());
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  work();
  is_done = true;
  watch.join();
  return most - before;
}

}  // namespace stipple
