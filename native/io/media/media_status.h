#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/media_table.h"

namespace stipple::media {

/// Turns what `work` throws into a status; an exception of another library is a fault of the file,
/// and its text follows the path.
void report(StippleMediaStatus* status, int code, const std::string& message);
void reportCurrentException(const char* path, StippleMediaStatus* status);
template <typename Work>
void guard(const char* path, StippleMediaStatus* status, const Work& work) {
  status->code = 0;
  status->message[0] = '\0';
  try {
    work();
  } catch (...) {
    reportCurrentException(path, status);
  }
}

/// Hands an array to the caller. Errors: kOutOfMemory.
void giveBytes(const StippleMediaSink& sink, uint32_t array, const void* data, size_t bytes);
template <typename T>
void give(const StippleMediaSink& sink, uint32_t array, const std::vector<T>& values) {
  giveBytes(sink, array, values.data(), values.size() * sizeof(T));
}
/// Room for `bytes` bytes at the caller's. Errors: kOutOfMemory.
void* allocate(const StippleMediaSink& sink, uint32_t array, size_t bytes);

}  // namespace stipple::media
