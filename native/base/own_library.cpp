#include "base/own_library.h"

#include <filesystem>
#include <system_error>

#include "base/platform/loading.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

fs::path findLibrary(const std::string& file_name) {
  const fs::path folder = platform::ownFile().parent_path();
  std::error_code ignored;
  for (const char* place : {".", "../lib", "../../lib"}) {
    const fs::path candidate = folder / place / file_name;
    if (fs::exists(candidate, ignored)) return candidate.lexically_normal();
  }
  return folder / file_name;
}

}  // namespace

void* openOwnLibrary(const char* name, std::string& path, std::string& why) {
  path = findLibrary(platform::libraryFile(name)).string();
  return platform::openLibrary(path, why);
}

void* findInLibrary(void* library, const char* function) {
  return platform::functionOf(library, function);
}

void closeOwnLibrary(void* library) {
  platform::closeLibrary(library);
}

}  // namespace stipple
