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

/// The same of an object with objects and lists inside: names are the way to a value, with points
/// ("parts.0.steps"). In: name, what messages call the text. Errors: kFormat.
std::vector<std::pair<std::string, FlatJsonValue>> readNestedJson(const std::string& text,
                                                                  const std::string& name);

}  // namespace stipple
