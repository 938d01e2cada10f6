#pragma once

#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include "base/error.h"
#include "data/tensor_table.h"

namespace stipple {

/// Numbers of a strategy's state. Errors: kFormat where there are none of that name and type.
template <class T>
std::vector<T> stateArray(const TensorTable& table, const std::string& name) {
  const auto found = table.find(name);
  if (found == table.end() || !std::holds_alternative<std::vector<T>>(found->second.values)) {
    fail(ErrorCode::kFormat, "the strategy's state has no '" + name + "'");
  }
  return std::get<std::vector<T>>(found->second.values);
}

/// The same for sums of lengths and weights: errors also where one is negative or not finite.
template <class T>
std::vector<T> stateSums(const TensorTable& table, const std::string& name) {
  std::vector<T> sums = stateArray<T>(table, name);
  for (const T sum : sums) {
    if (std::isfinite(sum) && sum >= 0) continue;  // comparing NaN would trap
    fail(ErrorCode::kFormat, "the strategy's state has " + std::to_string(sum) + " among " + name +
                                 "; 0 and more is allowed");
  }
  return sums;
}

/// Errors: kFormat where one is of another number of splats than the other.
void requireAsMany(size_t count, const std::string& name, size_t other_count,
                   const std::string& other_name);

}  // namespace stipple
