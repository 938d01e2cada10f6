// libFuzzer target: one reader of splat files, named by STIPPLE_FUZZ_FORMAT. Whatever the bytes
// are, reading gives a valid cloud or an Error; anything else (a crash, a sanitizer's report, an
// exception of another kind, minutes, gigabytes) is found.
#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "base/error.h"
#include "io/splat_format.h"

namespace {

const stipple::SplatFormat& format() {
  for (const stipple::SplatFormat& known : stipple::splatFormats()) {
    if (std::strcmp(known.name, STIPPLE_FUZZ_FORMAT) == 0) return known;
  }
  std::abort();
}

/// A file in memory, made again for each input.
std::string fileOf(const uint8_t* bytes, size_t size) {
  static const int kFile = ::memfd_create("fuzz", 0);
  if (::ftruncate(kFile, 0) != 0 || ::pwrite(kFile, bytes, size, 0) != static_cast<ssize_t>(size)) {
    std::abort();
  }
  return "/proc/self/fd/" + std::to_string(kFile);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
  static const stipple::SplatFormat& kFormat = format();
  const std::string path = fileOf(bytes, size);
  try {
    stipple::validate(kFormat.read(path, nullptr), "cloud");
  } catch (const stipple::Error& error) {
    // A reader that lets a wrong cloud through is a fault; a file that is refused is not.
    if (error.code() == stipple::ErrorCode::kInvalidArgument ||
        error.code() == stipple::ErrorCode::kUnavailable ||
        error.code() == stipple::ErrorCode::kInternal) {
      std::abort();
    }
  }
  return 0;
}
