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

using Entries = std::vector<std::pair<std::string, FlatJsonValue>>;

void addValues(const std::string& way, const Json& json, Entries& entries) {
  const std::string inside = way.empty() ? "" : way + ".";
  if (json.is_object()) {
    for (const auto& [name, value] : json.items()) addValues(inside + name, value, entries);
  } else if (json.is_array()) {
    for (size_t i = 0; i < json.size(); ++i)
      addValues(inside + std::to_string(i), json[i], entries);
  } else {
    entries.emplace_back(way, valueOf(way, json));
  }
}

}  // namespace

Entries readNestedJson(const std::string& text, const std::string& name) {
  const Json json = parseOrderedJson(text, name);
  if (!json.is_object()) fail(ErrorCode::kFormat, name + ": a JSON object is expected");
  Entries entries;
  addValues("", json, entries);
  return entries;
}

Entries readFlatJson(const std::string& text) {
  const Json json = parseOrderedJson(text, "a text of settings");
  if (!json.is_object()) fail(ErrorCode::kFormat, "a JSON object is expected");
  Entries entries;
  for (const auto& [name, value] : json.items()) entries.emplace_back(name, valueOf(name, value));
  return entries;
}

}  // namespace stipple
