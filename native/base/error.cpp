#include "base/error.h"

#include <bit>
#include <cmath>
#include <cstdint>

namespace stipple {

void fail(ErrorCode code, const std::string& message) {
  // Names from damaged files may hold anything; a message is one line all the same.
  std::string line = message;
  for (char& letter : line) {
    if (static_cast<unsigned char>(letter) < 32 || letter == 127) letter = '?';
  }
  throw Error(code, line);
}

void requireFinite(double value, const char* what) {
  if (!std::isfinite(value)) {
    fail(ErrorCode::kInvalidArgument,
         std::string(what) + " is " + std::to_string(value) + "; it must be a finite number");
  }
}

void requireFinite(const float* values, size_t count, size_t stride, const char* what) {
  // First without branches, so that the compiler makes vector code: an exponent of all ones is an
  // infinity or NaN.
  uint32_t not_finite = 0;
  for (size_t i = 0; i < count; ++i) {
    not_finite |= (std::bit_cast<uint32_t>(values[i]) & 0x7f800000u) == 0x7f800000u ? 1u : 0u;
  }
  if (not_finite == 0) return;
  for (size_t i = 0; i < count; ++i) {
    if (!std::isfinite(values[i])) {
      fail(ErrorCode::kInvalidArgument, std::string(what) + " " + std::to_string(i / stride) +
                                            " holds " + std::to_string(values[i]) +
                                            "; every value must be a finite number");
    }
  }
}

}  // namespace stipple
