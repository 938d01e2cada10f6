#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace stipple {

/// Whole numbers that are not negative, other numbers, and texts; true and false are 1 and 0.
using FlatJsonValue = std::variant<uint64_t, double, std::string>;

/// The names and values of a JSON object without objects or lists inside, in their order.
/// Errors: kFormat.
std::vector<std::pair<std::string, FlatJsonValue>> readFlatJson(const std::string& text);

}  // namespace stipple
