#pragma once

#include <stipple/stipple.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <string>

#include "base/error.h"

namespace stipple::api {

/// Keeps the message for stipple_last_error_message of this thread.
void setLastError(const char* message) noexcept;

/// The status and message of the exception that is being handled.
StippleStatus statusOfCurrentException() noexcept;

/// Runs `body` at the boundary: no exception leaves, the message is kept for this thread.
template <typename Body>
StippleStatus guarded(Body&& body) noexcept {
  try {
    setLastError("");
    body();
    return STIPPLE_OK;
  } catch (...) {
    return statusOfCurrentException();
  }
}

/// Refuses NULL. In: the name of the argument in the header.
template <typename T>
T& require(T* pointer, const char* name) {
  if (!pointer) {
    fail(ErrorCode::kInvalidArgument, std::string(name) + " is NULL; it must be given");
  }
  return *pointer;
}

[[noreturn]] inline void failStructSize(const char* name, size_t seen, size_t allowed) {
  fail(ErrorCode::kInvalidArgument, std::string(name) + "->struct_size is " + std::to_string(seen) +
                                        "; set it to sizeof(*" + name + "), here " +
                                        std::to_string(allowed));
}

/// A struct of the caller, completed with `defaults` where its struct_size ends early: the caller
/// may be older (shorter struct) or newer (longer; the unknown end is not read). NULL: defaults.
template <typename T>
T completed(const T* given, const T& defaults, const char* name) {
  T result = defaults;
  if (given) {
    const size_t size = given->struct_size;
    if (size < sizeof(uint32_t)) failStructSize(name, size, sizeof(T));
    std::memcpy(&result, given, std::min(size, sizeof(T)));
  }
  result.struct_size = sizeof(T);
  return result;
}

/// A struct of the caller without defaults: every field must be there.
template <typename T>
T complete(const T* given, const char* name) {
  const size_t size = require(given, name).struct_size;
  if (size < sizeof(T)) failStructSize(name, size, sizeof(T));
  return *given;
}

/// A struct of the caller whose first `needed` bytes must be there; the rest is 0 where it ends
/// early.
template <typename T>
T completeUpTo(const T* given, size_t needed, const char* name) {
  const size_t size = require(given, name).struct_size;
  if (size < needed) failStructSize(name, size, sizeof(T));
  T result = {};
  std::memcpy(&result, given, std::min(size, sizeof(T)));
  return result;
}

/// Fills a struct of the caller, as far as its struct_size goes.
template <typename T>
void deliver(T* out, T value, const char* name) {
  const uint32_t size = require(out, name).struct_size;
  if (size < sizeof(uint32_t)) failStructSize(name, size, sizeof(T));
  value.struct_size = size;
  std::memcpy(out, &value, std::min<size_t>(size, sizeof(T)));
}

/// Structs [count] of the caller, as far apart as the first one's struct_size says: older and newer
/// callers have shorter and longer ones.
template <typename T>
class StructArray {
 public:
  StructArray(const T* first, uint64_t count, const char* name) : first_(first), name_(name) {
    if (count == 0) return;
    step_ = require(first, name).struct_size;
    if (step_ % alignof(T) != 0) failStructSize(nameOf(0).c_str(), step_, sizeof(T));
  }

  std::string nameOf(uint64_t i) const { return name_ + "[" + std::to_string(i) + "]"; }

  /// Errors: kInvalidArgument where it has another size than the first.
  const T* at(uint64_t i) const {
    const auto* bytes = reinterpret_cast<const std::byte*>(first_) + i * step_;
    const auto* entry = reinterpret_cast<const T*>(bytes);
    if (entry->struct_size != step_) {
      failStructSize(nameOf(i).c_str(), entry->struct_size, sizeof(T));
    }
    return entry;
  }

 private:
  const T* first_;
  std::string name_;
  size_t step_ = 0;
};

/// Refuses counts of rows of three numbers that no array can hold. Returns: how many numbers.
inline size_t requireTriples(uint64_t rows, const char* name) {
  constexpr uint64_t kMost = UINT32_MAX;
  if (rows > kMost) {
    fail(ErrorCode::kInvalidArgument, std::string(name) + " is " + std::to_string(rows) +
                                          "; at most " + std::to_string(kMost) + " are allowed");
  }
  return 3 * static_cast<size_t>(rows);
}

/// Refuses buffers that are too small. In: what is counted, "floats".
inline void requireCapacity(uint64_t needed, uint64_t capacity, const char* what) {
  if (capacity >= needed) return;
  fail(ErrorCode::kBufferTooSmall, "capacity is " + std::to_string(capacity) + " " + what + "; " +
                                       std::to_string(needed) + " are needed");
}

/// Refuses enum values outside 0..last.
template <typename Enum>
Enum enumValue(uint32_t value, uint32_t last, const char* name) {
  if (value > last) {
    fail(ErrorCode::kInvalidArgument, std::string(name) + " is " + std::to_string(value) +
                                          "; 0 to " + std::to_string(last) + " is allowed");
  }
  return static_cast<Enum>(value);
}

}  // namespace stipple::api
