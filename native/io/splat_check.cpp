#include "io/splat_check.h"

#include <atomic>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

void validateInParallel(const SplatCloud& cloud, const char* what) {
  constexpr size_t kGrain = 8192;
  validateSizes(cloud, what);
  std::atomic<bool> valid{true};
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    if (!rowsAreValid(cloud, begin, end)) valid.store(false, std::memory_order_relaxed);
  });
  // Once more in order, for the first splat that is wrong.
  if (!valid.load(std::memory_order_relaxed)) validate(cloud, what);
}

void requireValidSplats(const SplatCloud& cloud, const std::string& path) {
  try {
    validateInParallel(cloud, path.c_str());
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, error.what());
  }
}

}  // namespace stipple
