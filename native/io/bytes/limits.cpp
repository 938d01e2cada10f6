#include "io/bytes/limits.h"

#include <limits>

#include "base/error.h"

namespace stipple {

uint64_t Allowance::of(uint64_t file_bytes) const {
  constexpr uint64_t kMost = std::numeric_limits<uint64_t>::max();
  return file_bytes > (kMost - always) / per_byte ? kMost : always + per_byte * file_bytes;
}

void requireAllowed(uint64_t asked_bytes, const Allowance& allowance, uint64_t file_bytes,
                    const std::string& name, const std::string& what) {
  const uint64_t allowed = allowance.of(file_bytes);
  if (asked_bytes <= allowed) return;
  fail(ErrorCode::kFormat, name + ": " + what + " would take " + std::to_string(asked_bytes) +
                               " bytes of memory; at most " + std::to_string(allowed) +
                               " are allowed for a file of " + std::to_string(file_bytes) +
                               " bytes");
}

}  // namespace stipple
