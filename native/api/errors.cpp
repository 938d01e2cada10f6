#include <cstdio>
#include <stdexcept>

#include "api/guard.h"

namespace stipple::api {

namespace {

/// Fixed storage: keeping a message must not be able to throw.
thread_local char g_message[1024] = "";

}  // namespace

void setLastError(const char* message) noexcept {
  std::snprintf(g_message, sizeof(g_message), "%s", message);
}

StippleStatus statusOfCurrentException() noexcept {
  try {
    throw;
  } catch (const Error& error) {
    setLastError(error.what());
    return static_cast<StippleStatus>(error.code());
  } catch (const std::bad_alloc&) {
    setLastError("out of memory; fewer splats, a smaller image or larger voxels need less");
    return STIPPLE_ERROR_OUT_OF_MEMORY;
  } catch (const std::length_error&) {
    setLastError("out of memory; the sizes asked for are larger than any machine's memory");
    return STIPPLE_ERROR_OUT_OF_MEMORY;
  } catch (const std::exception& error) {
    setLastError(error.what());
    return STIPPLE_ERROR_INTERNAL;
  } catch (...) {
    setLastError("unknown internal error");
    return STIPPLE_ERROR_INTERNAL;
  }
}

}  // namespace stipple::api

extern "C" {

uint32_t stipple_abi_version(void) {
  return STIPPLE_ABI_VERSION;
}

const char* stipple_version_string(void) {
  return STIPPLE_VERSION;
}

const char* stipple_last_error_message(void) {
  return stipple::api::g_message;
}

const char* stipple_status_name(StippleStatus status) {
  switch (status) {
    case STIPPLE_OK:
      return "STIPPLE_OK";
    case STIPPLE_ERROR_INVALID_ARGUMENT:
      return "STIPPLE_ERROR_INVALID_ARGUMENT";
    case STIPPLE_ERROR_OUT_OF_MEMORY:
      return "STIPPLE_ERROR_OUT_OF_MEMORY";
    case STIPPLE_ERROR_MEMORY_LIMIT:
      return "STIPPLE_ERROR_MEMORY_LIMIT";
    case STIPPLE_ERROR_IO:
      return "STIPPLE_ERROR_IO";
    case STIPPLE_ERROR_FORMAT:
      return "STIPPLE_ERROR_FORMAT";
    case STIPPLE_ERROR_UNSUPPORTED:
      return "STIPPLE_ERROR_UNSUPPORTED";
    case STIPPLE_ERROR_UNAVAILABLE:
      return "STIPPLE_ERROR_UNAVAILABLE";
    case STIPPLE_ERROR_CANCELLED:
      return "STIPPLE_ERROR_CANCELLED";
    case STIPPLE_ERROR_BUFFER_TOO_SMALL:
      return "STIPPLE_ERROR_BUFFER_TOO_SMALL";
    case STIPPLE_ERROR_INTERNAL:
      return "STIPPLE_ERROR_INTERNAL";
  }
  return "unknown status";
}

}  // extern "C"
