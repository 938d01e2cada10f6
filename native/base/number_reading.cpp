#include "base/number_reading.h"

#include <array>
#include <clocale>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <string>
#include <string_view>

namespace stipple {

namespace {

bool isDigit(char c) {
  return c >= '0' && c <= '9';
}

bool isLetter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

bool beginsWith(const char* at, const char* end, std::string_view word) {
  if (static_cast<size_t>(end - at) < word.size()) return false;
  for (size_t k = 0; k < word.size(); ++k) {
    if ((at[k] | 0x20) != word[k]) return false;
  }
  return true;
}

/// What stands in a text, as far as it belongs to a number.
struct Decimal {
  const char* end = nullptr;  ///< behind the number; null where there is none
  uint64_t digits = 0;        ///< the first 19 without the point
  int64_t exponent = 0;       ///< of ten, by which they are multiplied
  bool is_exact = true;       ///< `digits` are all
};

constexpr int kMostDigits = 19;
constexpr int64_t kLargestExponent = 1'000'000;

Decimal scan(const char* at, const char* end) {
  Decimal decimal;
  int kept = 0;
  bool is_number = false;
  bool is_behind_point = false;
  for (; at != end && (isDigit(*at) || (*at == '.' && !is_behind_point)); ++at) {
    if (*at == '.') {
      is_behind_point = true;
      continue;
    }
    is_number = true;
    if (kept < kMostDigits) {
      decimal.digits = decimal.digits * 10 + static_cast<uint64_t>(*at - '0');
      if (decimal.digits != 0) ++kept;
      decimal.exponent -= is_behind_point;
    } else {
      decimal.is_exact &= *at == '0';
      decimal.exponent += !is_behind_point;
    }
  }
  if (!is_number) return decimal;
  decimal.end = at;
  if (at == end || (*at | 0x20) != 'e') return decimal;
  ++at;
  const bool is_negative = at != end && *at == '-';
  if (at != end && (*at == '-' || *at == '+')) ++at;
  if (at == end || !isDigit(*at)) return decimal;
  int64_t exponent = 0;
  for (; at != end && isDigit(*at); ++at) {
    if (exponent < kLargestExponent) exponent = exponent * 10 + (*at - '0');
  }
  decimal.exponent += is_negative ? -exponent : exponent;
  decimal.end = at;
  return decimal;
}

void convert(const char* text, float& value) {
  value = std::strtof(text, nullptr);
}
void convert(const char* text, double& value) {
  value = std::strtod(text, nullptr);
}

/// Powers of ten that a type holds exactly: the product of one with an exact number is rounded
/// once.
constexpr std::array<double, 23> kPowers = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                            1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                            1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
template <typename Number>
constexpr int64_t kExactPower = std::is_same_v<Number, float> ? 10 : 22;

template <typename Number>
bool convertExactly(const Decimal& decimal, Number& value) {
  constexpr uint64_t kExactDigits = uint64_t{1} << std::numeric_limits<Number>::digits;
  if (!decimal.is_exact || decimal.digits > kExactDigits ||
      std::abs(decimal.exponent) > kExactPower<Number>) {
    return false;
  }
  const auto power = static_cast<Number>(kPowers[static_cast<size_t>(std::abs(decimal.exponent))]);
  const auto digits = static_cast<Number>(decimal.digits);
  value = decimal.exponent < 0 ? digits / power : digits * power;
  return true;
}

/// "inf", "infinity", "nan" and "nan(what)". Returns: the end, null where none of them stands
/// there.
template <typename Number>
const char* readName(const char* at, const char* end, Number& value) {
  if (beginsWith(at, end, "inf")) {
    value = std::numeric_limits<Number>::infinity();
    return at + (beginsWith(at, end, "infinity") ? 8 : 3);
  }
  if (!beginsWith(at, end, "nan")) return nullptr;
  value = std::numeric_limits<Number>::quiet_NaN();
  at += 3;
  if (at == end || *at != '(') return at;
  const char* inner = at + 1;
  while (inner != end && (isDigit(*inner) || isLetter(*inner) || *inner == '_')) ++inner;
  return inner != end && *inner == ')' ? inner + 1 : at;
}

template <typename Number>
std::from_chars_result read(const char* begin, const char* end, Number& value) {
  const bool is_negative = begin != end && *begin == '-';
  const char* start = begin + is_negative;
  Number found = 0;
  const char* stop = readName(start, end, found);
  if (stop == nullptr) {
    const Decimal decimal = scan(start, end);
    if (decimal.end == nullptr) return {begin, std::errc::invalid_argument};
    stop = decimal.end;
    if (!convertExactly(decimal, found)) {
      std::string text(start, stop);
      const size_t point = text.find('.');
      if (point != std::string::npos) text.replace(point, 1, std::localeconv()->decimal_point);
      convert(text.c_str(), found);
      if (std::isinf(found) || (found == 0 && decimal.digits != 0)) {
        return {stop, std::errc::result_out_of_range};
      }
    }
  }
  value = is_negative ? -found : found;
  return {stop, std::errc()};
}

}  // namespace

std::from_chars_result readByParts(const char* begin, const char* end, float& value) {
  return read(begin, end, value);
}

std::from_chars_result readByParts(const char* begin, const char* end, double& value) {
  return read(begin, end, value);
}

}  // namespace stipple
