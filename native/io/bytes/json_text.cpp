#include "io/bytes/json_text.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "io/bytes/limits.h"

namespace stipple {

namespace {

template <typename Json>
Json parsed(std::string_view text, const std::string& name, ErrorCode code) {
  requireSmallJson(text, name, code);
  try {
    return Json::parse(text);
  } catch (const typename Json::exception& error) {
    fail(code, name + " is not valid JSON: " + error.what());
  }
}

/// The end of a string whose first quotation mark is before `at`.
size_t endOfString(std::string_view text, size_t at) {
  for (; at < text.size() && text[at] != '"'; ++at) {
    if (text[at] == '\\') ++at;
  }
  return at;
}

}  // namespace

JsonSize sizeOfJson(std::string_view text) {
  JsonSize size;
  size_t depth = 0;
  bool in_word = false;  // of a number, true, false or null
  for (size_t i = 0; i < text.size(); ++i) {
    const char letter = text[i];
    bool is_word = false;
    switch (letter) {
      case '"':
        i = endOfString(text, i + 1);
        ++size.values;
        break;
      case '{':
        ++size.objects;
        [[fallthrough]];
      case '[':
        size.depth = std::max(size.depth, ++depth);
        ++size.values;
        break;
      case '}':
      case ']':
        if (depth > 0) --depth;
        break;
      case ',':
      case ':':
      case ' ':
      case '\n':
      case '\r':
      case '\t':
        break;
      default:
        is_word = true;
        if (!in_word) ++size.values;
    }
    in_word = is_word;
  }
  return size;
}

void requireSmallJson(std::string_view text, const std::string& name, ErrorCode code) {
  const JsonSize size = sizeOfJson(text);
  if (size.depth > kMaxJsonDepth) {
    fail(code, name + " is JSON nested " + std::to_string(size.depth) + " deep; at most " +
                   std::to_string(kMaxJsonDepth) + " is allowed");
  }
  if (size.values > kMaxJsonValues) {
    fail(code, name + " is JSON of " + std::to_string(size.values) + " values; at most " +
                   std::to_string(kMaxJsonValues) + " are allowed");
  }
}

nlohmann::json parseJson(std::string_view text, const std::string& name, ErrorCode code) {
  return parsed<nlohmann::json>(text, name, code);
}

nlohmann::ordered_json parseOrderedJson(std::string_view text, const std::string& name,
                                        ErrorCode code) {
  return parsed<nlohmann::ordered_json>(text, name, code);
}

}  // namespace stipple
