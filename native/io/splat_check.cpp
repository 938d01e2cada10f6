#include "io/splat_check.h"

#include <atomic>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

void requireValidSplats(const SplatCloud& cloud, const std::string& path) {
  constexpr size_t kGrain = 8192;
  std::atomic<bool> valid{true};
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    if (!rowsAreValid(cloud, begin, end)) valid.store(false, std::memory_order_relaxed);
  });
  if (valid.load(std::memory_order_relaxed)) return;
  try {
    validate(cloud, path.c_str());
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, error.what());
  }
}

}  // namespace stipple
