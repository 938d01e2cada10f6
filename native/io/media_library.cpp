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
extern "C" const StipplePackingTable* stipple_packing_table(uint32_t version);

const StippleMediaTable* openMedia() {
  return stipple_media_table(kMediaTableVersion);
}

const StipplePackingTable* openPacking() {
  return stipple_packing_table(kPackingTableVersion);
}
#else
/// Opens the library `name` and asks it for the table of this version.
template <typename Function>
auto openTable(const char* name, const char* purpose, uint32_t version) {
  const auto failUnavailable = [&](const std::string& why) {
    fail(ErrorCode::kUnavailable,
         platform::libraryFile(name) + ", which " + purpose + ", cannot be loaded: " + why);
  };
  std::string path, why;
  void* library = openOwnLibrary(name, path, why);
  if (library == nullptr) failUnavailable(why);
  const auto function =
      reinterpret_cast<Function>(findInLibrary(library, (std::string(name) + "_table").c_str()));
  const auto* table = function != nullptr ? function(version) : nullptr;
  if (table == nullptr) {
    closeOwnLibrary(library);
    failUnavailable(path + " belongs to another version; version " + std::to_string(version) +
                    " of its table is needed");
  }
  return table;
}

const StippleMediaTable* openMedia() {
  return openTable<StippleMediaTableFunction>(
      "stipple_media", "reads and writes images, meshes and volumes", kMediaTableVersion);
}

const StipplePackingTable* openPacking() {
  return openTable<StipplePackingTableFunction>("stipple_packing", "packs and unpacks splats",
                                                kPackingTableVersion);
}
#endif

/// The table of a library that is opened at the first use; where that fails, the next use tries
/// again.
template <typename Table>
const Table& openedOnce(const Table* (*open)()) {
  static std::mutex mutex;
  static const Table* table = nullptr;
  const std::lock_guard<std::mutex> lock(mutex);
  if (table == nullptr) table = open();
  return *table;
}

}  // namespace

const StippleMediaTable& mediaTable() {
  return openedOnce(openMedia);
}

const StipplePackingTable& packingTable() {
  return openedOnce(openPacking);
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
