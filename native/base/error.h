#pragma once

#include <stdexcept>
#include <string>

namespace stipple {

/// What went wrong, in the words of the C header (the values are the same as StippleStatus).
enum class ErrorCode : int {
  kInvalidArgument = 1,
  kOutOfMemory = 2,
  kMemoryLimit = 3,
  kIo = 4,
  kFormat = 5,
  kUnsupported = 6,
  kUnavailable = 7,
  kCancelled = 8,
  kBufferTooSmall = 9,
  kInternal = 10,
};

/// The one exception of the library. The message is one sentence for a user: what, which argument,
/// the value seen and the value allowed.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

/// Throws Error{code, message}.
[[noreturn]] void fail(ErrorCode code, const std::string& message);

/// Refuses a value that is not finite. In: `what` names the argument in the message.
void requireFinite(double value, const char* what);

/// Refuses arrays that hold NaN or infinity; the message names the first bad element.
/// In: values [count]; `stride` values make one element (3 for positions).
void requireFinite(const float* values, size_t count, size_t stride, const char* what);

}  // namespace stipple
