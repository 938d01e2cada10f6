#include "base/memory_limit.h"

#include <algorithm>

#include "base/error.h"
#include "base/platform/memory.h"

namespace stipple {

namespace {

/// "1.50 GiB".
std::string bytesText(uint64_t bytes) {
  constexpr uint64_t kMebi = uint64_t{1} << 20;
  constexpr uint64_t kGibi = uint64_t{1} << 30;
  if (bytes < kMebi) return std::to_string(bytes) + " bytes";
  const uint64_t unit = bytes < kGibi ? kMebi : kGibi;
  const uint64_t hundredths = bytes % unit * 100 / unit;
  return std::to_string(bytes / unit) + (hundredths < 10 ? ".0" : ".") +
         std::to_string(hundredths) + (unit == kMebi ? " MiB" : " GiB");
}

}  // namespace

uint64_t MemoryLimit::ofThisMachine() {
  constexpr uint64_t kPercent = 60;
  const uint64_t machine = platform::machineMemory();
  return machine == UINT64_MAX ? machine : machine / 100 * kPercent;
}

void MemoryLimit::requireBudget(uint64_t budget, const char* unit,
                                const std::function<uint64_t(uint64_t)>& bytes_of) const {
  const uint64_t bytes = bytes_of(budget);
  if (bytes <= memory_limit_bytes) return;
  uint64_t fits = 0;
  for (uint64_t above = budget; above - fits > 1;) {
    const uint64_t middle = fits + (above - fits) / 2;
    (bytes_of(middle) <= memory_limit_bytes ? fits : above) = middle;
  }
  fail(ErrorCode::kMemoryLimit, "this budget of " + std::to_string(budget) + " " + unit +
                                    " would need up to " + bytesText(bytes) +
                                    "; the memory limit is " + bytesText(memory_limit_bytes) +
                                    ", and at most " + std::to_string(fits) + " " + unit + " fit");
}

void MemoryLimit::requireMemory(uint64_t bytes, const char* what) const {
  if (bytes > memory_limit_bytes) {
    fail(ErrorCode::kMemoryLimit, std::string(what) + " would need up to " + bytesText(bytes) +
                                      "; the memory limit is " + bytesText(memory_limit_bytes));
  }
}

void MemoryLimit::requirePictureMemory(uint64_t bytes, const std::string& what,
                                       uint64_t pair_bytes) const {
  const uint64_t machine = platform::machineMemory();
  if (bytes <= std::min(machine, memory_limit_bytes)) return;
  const std::string allowed = memory_limit_bytes <= machine
                                  ? "the memory limit is " + bytesText(memory_limit_bytes)
                                  : "this machine has " + bytesText(machine);
  fail(ErrorCode::kMemoryLimit, what + " would need up to " + bytesText(bytes) + ", " +
                                    bytesText(pair_bytes) + " of it for pairs of splat and tile; " +
                                    allowed);
}

}  // namespace stipple
