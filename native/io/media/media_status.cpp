#include "io/media/media_status.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <new>

#include "base/error.h"

namespace stipple::media {

void report(StippleMediaStatus* status, int code, const std::string& message) {
  status->code = code;
  // One sentence: libraries separate their messages by line ends.
  std::string line = message;
  while (!line.empty() && (line.back() == '\n' || line.back() == ' ')) line.pop_back();
  std::replace(line.begin(), line.end(), '\n', ' ');
  const size_t length = std::min(line.size(), sizeof(status->message) - 1);
  std::memcpy(status->message, line.data(), length);
  status->message[length] = '\0';
}

void reportCurrentException(const char* path, StippleMediaStatus* status) {
  try {
    throw;
  } catch (const Error& error) {
    report(status, static_cast<int>(error.code()), error.what());
  } catch (const std::bad_alloc&) {
    report(status, static_cast<int>(ErrorCode::kOutOfMemory),
           std::string(path) + ": there is not enough memory");
  } catch (const std::exception& error) {
    report(status, static_cast<int>(ErrorCode::kFormat), std::string(path) + ": " + error.what());
  } catch (...) {
    report(status, static_cast<int>(ErrorCode::kInternal),
           std::string(path) + ": a library failed without a reason");
  }
}

void* allocate(const StippleMediaSink& sink, uint32_t array, size_t bytes) {
  void* target = sink.allocate(sink.user, array, bytes);
  if (target == nullptr && bytes > 0) throw std::bad_alloc();
  return target;
}

void giveBytes(const StippleMediaSink& sink, uint32_t array, const void* data, size_t bytes) {
  void* target = allocate(sink, array, bytes);
  if (bytes > 0) std::memcpy(target, data, bytes);
}

}  // namespace stipple::media
