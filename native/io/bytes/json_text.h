#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "base/error.h"

namespace stipple {

/// How large a JSON text is as values. Of a text that is not valid, what comes before its first
/// fault is counted exactly.
struct JsonSize {
  size_t depth = 0;      ///< arrays and objects inside each other
  uint64_t values = 0;   ///< all, keys among them
  uint64_t objects = 0;  ///< of them
};

/// Counts without making a value. Cost: O(text), no memory.
JsonSize sizeOfJson(std::string_view text);

/// Refuses a text that is nested deeper than kMaxJsonDepth or holds more than kMaxJsonValues, for a
/// library that parses it. In: name, what messages call the text. Errors: `code`.
void requireSmallJson(std::string_view text, const std::string& name,
                      ErrorCode code = ErrorCode::kFormat);

/// Parses a JSON text of a size that requireSmallJson() accepts. Nothing else of the project calls
/// the parser: values of any depth would overflow the stack where they are copied or printed.
/// In: name, what messages call the text. Errors: `code`.
nlohmann::json parseJson(std::string_view text, const std::string& name,
                         ErrorCode code = ErrorCode::kFormat);
/// ... whose objects keep the order of their keys.
nlohmann::ordered_json parseOrderedJson(std::string_view text, const std::string& name,
                                        ErrorCode code = ErrorCode::kFormat);

}  // namespace stipple
