#include "io/splats/splat_check.h"

#include "base/error.h"

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

void requireValidSplats(const SplatCloud& cloud, const std::string& path) {
  try {
    validate(cloud, path.c_str());
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, error.what());
  }
}

}  // namespace stipple
