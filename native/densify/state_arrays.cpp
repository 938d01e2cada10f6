#include "densify/state_arrays.h"

namespace stipple {

void requireAsMany(size_t count, const std::string& name, size_t other_count,
                   const std::string& other_name) {
  if (count == other_count) return;
  fail(ErrorCode::kFormat, "the strategy's state has " + std::to_string(count) + " " + name +
                               " and " + std::to_string(other_count) + " " + other_name +
                               "; as many are needed");
}

}  // namespace stipple
