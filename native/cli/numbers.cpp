#include "cli/numbers.h"

#include <algorithm>
#include <string>

#include "cli/library.h"

namespace stipple::cli {

namespace {

constexpr int64_t kMost = int64_t{1} << 40;

}  // namespace

uint64_t counted(int64_t value, const char* name, int64_t first) {
  if (value < first || value > kMost) {
    throw Failure(std::string(name) + " is " + std::to_string(value) + "; " +
                  std::to_string(first) + " or more is allowed");
  }
  return static_cast<uint64_t>(value);
}

uint32_t counted32(int64_t value, const char* name, int64_t first) {
  return static_cast<uint32_t>(std::min<uint64_t>(counted(value, name, first), UINT32_MAX));
}

uint64_t bytesOfMebibytes(double mebibytes) {
  return static_cast<uint64_t>(std::clamp(mebibytes, 0.0, 0x1p40) * 0x1p20);
}

}  // namespace stipple::cli
