#include "base/own_library.h"

#include <dlfcn.h>

#include <filesystem>
#include <system_error>

namespace stipple {

namespace {

namespace fs = std::filesystem;

/// The folder of the file that holds this code: libstipple.so, or a program that it is linked into.
fs::path ownFolder() {
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&openOwnLibrary), &info) == 0 || !info.dli_fname) {
    return fs::path();
  }
  std::error_code error;
  // A program knows itself by the name that it was called by, which may be relative or in PATH.
  const fs::path file = std::string(info.dli_fname).find('/') == std::string::npos
                            ? fs::read_symlink("/proc/self/exe", error)
                            : fs::absolute(info.dli_fname, error);
  return fs::weakly_canonical(file, error).parent_path();
}

fs::path findLibrary(const char* file_name) {
  const fs::path folder = ownFolder();
  std::error_code ignored;
  for (const char* place : {".", "../lib", "../../lib"}) {
    const fs::path candidate = folder / place / file_name;
    if (fs::exists(candidate, ignored)) return candidate.lexically_normal();
  }
  return folder / file_name;
}

}  // namespace

void* openOwnLibrary(const char* file_name, std::string& path, std::string& why) {
  path = findLibrary(file_name).string();
  void* library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library != nullptr) return library;
  const char* reason = ::dlerror();
  why = reason != nullptr ? reason : "the loader gives no reason";
  return nullptr;
}

void* findInLibrary(void* library, const char* function) {
  return ::dlsym(library, function);
}

void closeOwnLibrary(void* library) {
  ::dlclose(library);
}

}  // namespace stipple
