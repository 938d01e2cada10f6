#include "base/platform/loading.h"

#include <dlfcn.h>

#include <system_error>

namespace stipple::platform {

namespace fs = std::filesystem;

fs::path ownFile() {
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&ownFile), &info) == 0 || !info.dli_fname) {
    return fs::path();
  }
  std::error_code error;
  // A program knows itself by the name that it was called by, which may be relative or in PATH.
  const fs::path file = std::string(info.dli_fname).find('/') == std::string::npos
                            ? fs::read_symlink("/proc/self/exe", error)
                            : fs::absolute(info.dli_fname, error);
  return fs::weakly_canonical(file, error);
}

std::string libraryFile(const std::string& name) {
  return "lib" + name + ".so";
}

void* openLibrary(const std::string& path, std::string& why) {
  void* library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library != nullptr) return library;
  const char* reason = ::dlerror();
  why = reason != nullptr ? reason : "the loader gives no reason";
  return nullptr;
}

void* functionOf(void* library, const char* function) {
  return ::dlsym(library, function);
}

void closeLibrary(void* library) {
  ::dlclose(library);
}

}  // namespace stipple::platform
