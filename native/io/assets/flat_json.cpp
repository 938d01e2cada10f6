#include "io/assets/flat_json.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/bytes/json_text.h"

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

FlatJsonValue valueOf(const std::string& name, const Json& value) {
  if (value.is_number_unsigned()) return value.get<uint64_t>();
  if (value.is_number()) return value.get<double>();
  if (value.is_boolean()) return uint64_t{value.get<bool>()};
  if (value.is_string()) return value.get<std::string>();
  fail(ErrorCode::kFormat, "'" + name + "' of a JSON object is neither a number nor a text");
}

}  // namespace

std::vector<std::pair<std::string, FlatJsonValue>> readFlatJson(const std::string& text) {
  const Json json = parseOrderedJson(text, "a text of settings");
  if (!json.is_object()) fail(ErrorCode::kFormat, "a JSON object is expected");
  std::vector<std::pair<std::string, FlatJsonValue>> entries;
  for (const auto& [name, value] : json.items()) entries.emplace_back(name, valueOf(name, value));
  return entries;
}

}  // namespace stipple
