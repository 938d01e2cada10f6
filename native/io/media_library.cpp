#include "io/media_library.h"

#include <dlfcn.h>

#include <filesystem>
#include <mutex>
#include <string>
#include <utility>

#include "base/error.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr char kFileName[] = "libstipple_media.so";
constexpr char kTableFunction[] = "stipple_media_table";

/// The folder of the file that holds this code: libstipple.so, or a program that it is linked into.
fs::path ownFolder() {
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&mediaTable), &info) == 0 || !info.dli_fname) {
    return fs::path();
  }
  std::error_code error;
  // A program knows itself by the name that it was called by, which may be relative or in PATH.
  const fs::path file = std::string(info.dli_fname).find('/') == std::string::npos
                            ? fs::read_symlink("/proc/self/exe", error)
                            : fs::absolute(info.dli_fname, error);
  return fs::weakly_canonical(file, error).parent_path();
}

fs::path findLibrary() {
  const fs::path folder = ownFolder();
  std::error_code ignored;
  for (const char* place : {".", "../lib", "../../lib"}) {
    const fs::path candidate = folder / place / kFileName;
    if (fs::exists(candidate, ignored)) return candidate.lexically_normal();
  }
  return folder / kFileName;
}

[[noreturn]] void failUnavailable(const std::string& why) {
  fail(ErrorCode::kUnavailable, std::string(kFileName) +
                                    ", which reads and writes images, meshes, volumes and packed "
                                    "splats, cannot be loaded: " +
                                    why);
}

const StippleMediaTable* openLibrary() {
  const fs::path file = findLibrary();
  void* library = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    const char* why = ::dlerror();
    failUnavailable(why != nullptr ? why : "the loader gives no reason");
  }
  const auto function =
      reinterpret_cast<StippleMediaTableFunction>(::dlsym(library, kTableFunction));
  const StippleMediaTable* table = function != nullptr ? function(kMediaTableVersion) : nullptr;
  if (table == nullptr) {
    ::dlclose(library);
    failUnavailable(file.string() + " belongs to another version; version " +
                    std::to_string(kMediaTableVersion) + " of its table is needed");
  }
  return table;
}

}  // namespace

const StippleMediaTable& mediaTable() {
  static std::mutex mutex;
  static const StippleMediaTable* table = nullptr;
  const std::lock_guard<std::mutex> lock(mutex);
  if (table == nullptr) table = openLibrary();
  return *table;
}

void callMedia(const std::function<void(StippleMediaStatus*)>& call) {
  StippleMediaStatus status{};
  call(&status);
  if (status.code != 0) fail(static_cast<ErrorCode>(status.code), status.message);
}

MediaSink::MediaSink(Allocate allocate) : allocate_(std::move(allocate)) {
  sink_.user = this;
  sink_.allocate = [](void* user, uint32_t array, uint64_t bytes) -> void* {
    try {
      return static_cast<MediaSink*>(user)->allocate_(array, bytes);
    } catch (...) {
      return nullptr;
    }
  };
}

}  // namespace stipple
