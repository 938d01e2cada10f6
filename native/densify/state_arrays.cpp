#include "densify/state_arrays.h"

#include <cmath>

namespace stipple {

std::vector<float> stateSums(const TensorTable& table, const std::string& name) {
  std::vector<float> sums = stateArray<float>(table, name);
  for (const float sum : sums) {
    if (std::isfinite(sum) && sum >= 0) continue;  // comparing NaN would trap
    fail(ErrorCode::kFormat, "the strategy's state has " + std::to_string(sum) + " among " + name +
                                 "; 0 and more is allowed");
  }
  return sums;
}

void requireAsMany(size_t count, const std::string& name, size_t other_count,
                   const std::string& other_name) {
  if (count == other_count) return;
  fail(ErrorCode::kFormat, "the strategy's state has " + std::to_string(count) + " " + name +
                               " and " + std::to_string(other_count) + " " + other_name +
                               "; as many are needed");
}

}  // namespace stipple
