#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <vector>

#include "base/error.h"
#include "base/number_reading.h"
#include "fit/fit_option_table.h"

namespace stipple {

namespace {

struct ByteUnit {
  const char* name;
  uint64_t bytes;
};
constexpr std::array<ByteUnit, 3> kByteUnits = {
    {{"GiB", uint64_t{1} << 30}, {"MiB", uint64_t{1} << 20}, {"KiB", uint64_t{1} << 10}}};
/// Whole numbers from here on do not fit into 64 bits.
constexpr double kBeyondCounts = 0x1p64;

std::vector<std::string> wordsOf(const FitOption& option) {
  std::vector<std::string> words(1);
  for (const char* c = option.choices; *c; ++c) {
    if (*c == ',') {
      words.emplace_back();
    } else {
      words.back() += *c;
    }
  }
  return words;
}

std::string numberText(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.10g", value);
  return text;
}

std::string bytesText(uint64_t bytes) {
  for (const ByteUnit& unit : kByteUnits) {
    if (bytes > 0 && bytes % unit.bytes == 0) return std::to_string(bytes / unit.bytes) + unit.name;
  }
  return std::to_string(bytes);
}

template <typename T>
std::optional<T> parsed(std::string_view text) {
  T value = {};
  const auto [end, error] = readNumber(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// "1.5GiB", or bytes as they are.
std::optional<uint64_t> parsedBytes(std::string_view text, double unit) {
  for (const ByteUnit& known : kByteUnits) {
    if (!text.ends_with(known.name)) continue;
    unit = static_cast<double>(known.bytes);
    text.remove_suffix(3);
    while (text.ends_with(' ')) text.remove_suffix(1);
    break;
  }
  if (unit == 1) return parsed<uint64_t>(text);
  const std::optional<double> amount = parsed<double>(text);
  if (!amount || !(*amount >= 0 && *amount * unit < kBeyondCounts)) return std::nullopt;
  return static_cast<uint64_t>(*amount * unit);
}

std::optional<uint64_t> parsedChoice(const FitOption& option, std::string_view text) {
  const std::vector<std::string> words = wordsOf(option);
  for (size_t i = 0; i < words.size(); ++i) {
    if (text == words[i]) return i;
  }
  return parsed<uint64_t>(text);
}

[[noreturn]] void failRange(const std::string& name, const std::string& value,
                            const std::string& allowed) {
  fail(ErrorCode::kInvalidArgument, name + " is " + value + "; " + allowed + " is allowed");
}

}  // namespace

std::string fitValueText(const FitOption& option, const FitValue& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  if (const auto* number = std::get_if<double>(&value)) return numberText(*number);
  const uint64_t count = std::get<uint64_t>(value);
  if (option.kind == FitOptionKind::kBytes) return bytesText(count);
  if (option.kind == FitOptionKind::kChoice) {
    const std::vector<std::string> words = wordsOf(option);
    if (count < words.size()) return words[count];
  }
  return std::to_string(count);
}

const char* defaultFitText(size_t index) {
  static const std::vector<std::string> kTexts = [] {
    const FitOptions defaults = defaultFitOptions();
    std::vector<std::string> texts;
    for (const FitOption& option : fitOptionTable()) {
      texts.push_back(fitValueText(option, option.member.get(defaults)));
    }
    return texts;
  }();
  return kTexts[index].c_str();
}

std::string fitRangeText(const FitOption& option) {
  if (option.kind == FitOptionKind::kText) return "any text";
  if (option.kind == FitOptionKind::kSwitch) return "0 or 1";
  if (option.kind == FitOptionKind::kChoice) {
    const std::vector<std::string> words = wordsOf(option);
    std::string text;
    for (size_t i = 0; i < words.size(); ++i) {
      if (i > 0) text += i + 1 < words.size() ? ", " : " or ";
      text += words[i] + " (" + std::to_string(i) + ")";
    }
    return text;
  }
  if (std::isinf(option.maximum)) return numberText(option.minimum) + " or more";
  return numberText(option.minimum) + " to " + numberText(option.maximum);
}

void requireInRange(const FitOption& option, const FitValue& value, const std::string& name) {
  if (std::holds_alternative<std::string>(value)) return;
  const auto* number = std::get_if<double>(&value);
  const double seen = number ? *number : static_cast<double>(std::get<uint64_t>(value));
  if (std::isfinite(seen) && seen >= option.minimum && seen <= option.maximum) return;
  failRange(name, fitValueText(option, value), fitRangeText(option));
}

FitValue fitValueFrom(const FitOption& option, std::string_view text, const std::string& name,
                      double unit) {
  if (option.kind == FitOptionKind::kText) return std::string(text);
  std::optional<FitValue> value;
  if (option.kind == FitOptionKind::kNumber) {
    if (const auto number = parsed<double>(text)) value = *number;
  } else {
    const bool is_choice = option.kind == FitOptionKind::kChoice;
    const bool is_bytes = option.kind == FitOptionKind::kBytes;
    const auto count = is_choice  ? parsedChoice(option, text)
                       : is_bytes ? parsedBytes(text, unit)
                                  : parsed<uint64_t>(text);
    if (count) value = *count;
  }
  if (!value) failRange(name, text.empty() ? "empty" : std::string(text), fitRangeText(option));
  requireInRange(option, *value, name);
  return *value;
}

}  // namespace stipple
