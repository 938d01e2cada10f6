#include "io/splats/splat_check.h"

#include <algorithm>

#include "base/error.h"
#include "io/bytes/limits.h"

namespace stipple {

RowCheck::RowCheck(const SplatCloud& cloud, const char* what) : cloud_(cloud), what_(what) {
  validateSizes(cloud, what);
}

bool RowCheck::look(size_t begin, size_t end) {
  if (rowsAreValid(cloud_, begin, end)) return true;
  doubt();
  return false;
}

void RowCheck::require() const {
  if (valid_.load(std::memory_order_relaxed)) return;
  validate(cloud_, what_);
  fail(ErrorCode::kInternal, std::string(what_) + " was doubted without a reason");
}

void requireAllowedSplats(uint64_t count, int sh_degree, uint64_t file_bytes,
                          const std::string& name) {
  // No file has as many; the product of what a damaged one claims may not fit.
  const uint64_t counted = std::min(count, uint64_t{1} << 48);
  requireAllowed(cloudBytes(counted, sh_degree), kSplatAllowance, file_bytes, name,
                 "the " + std::to_string(count) + " splats that it claims");
}

void requireValidSplats(const SplatCloud& cloud, const std::string& path) {
  try {
    validate(cloud, path.c_str());
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, error.what());
  }
}

}  // namespace stipple
