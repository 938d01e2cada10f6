#include "io/media_library.h"

#include <mutex>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/own_library.h"
#include "base/platform/loading.h"

namespace stipple {

namespace {

#ifdef STIPPLE_MEDIA_INSIDE
/// A package's library holds the calls itself.
extern "C" const StippleMediaTable* stipple_media_table(uint32_t version);

const StippleMediaTable* openLibrary() {
  return stipple_media_table(kMediaTableVersion);
}
#else
constexpr char kName[] = "stipple_media";
constexpr char kTableFunction[] = "stipple_media_table";

[[noreturn]] void failUnavailable(const std::string& why) {
  fail(ErrorCode::kUnavailable, platform::libraryFile(kName) +
                                    ", which reads and writes images, meshes, volumes and packed "
                                    "splats, cannot be loaded: " +
                                    why);
}

const StippleMediaTable* openLibrary() {
  std::string path, why;
  void* library = openOwnLibrary(kName, path, why);
  if (library == nullptr) failUnavailable(why);
  const auto function =
      reinterpret_cast<StippleMediaTableFunction>(findInLibrary(library, kTableFunction));
  const StippleMediaTable* table = function != nullptr ? function(kMediaTableVersion) : nullptr;
  if (table == nullptr) {
    closeOwnLibrary(library);
    failUnavailable(path + " belongs to another version; version " +
                    std::to_string(kMediaTableVersion) + " of its table is needed");
  }
  return table;
}
#endif

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
