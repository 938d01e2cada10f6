#include "base/number_text.h"

#include <charconv>

namespace stipple {

std::string numberText(double value, int digits) {
  // A sign, 17 digits, a point, up to four zeros in front or an exponent of five characters.
  char text[32];
  const auto written =
      std::to_chars(text, text + sizeof(text), value, std::chars_format::general, digits);
  return std::string(text, written.ptr);
}

std::string sizeText(uint64_t width, uint64_t height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

}  // namespace stipple
