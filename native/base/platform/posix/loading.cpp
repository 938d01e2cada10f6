#include "base/platform/loading.h"

#include <dlfcn.h>
#ifdef __APPLE__
#include <mach-o/dyld.h>
#endif

#include <cstdint>
#include <string>
#include <system_error>

namespace stipple::platform {

namespace fs = std::filesystem;

namespace {

fs::path ownProgram(std::error_code& error) {
#ifdef __APPLE__
  error.clear();
  uint32_t length = 0;
  _NSGetExecutablePath(nullptr, &length);  // which says how long it is
  std::string name(length, '\0');
  if (_NSGetExecutablePath(name.data(), &length) != 0) return fs::path();
  return name.c_str();
#else
  return fs::read_symlink("/proc/self/exe", error);
#endif
}

}  // namespace

fs::path ownFile() {
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&ownFile), &info) == 0 || !info.dli_fname) {
    return fs::path();
  }
  std::error_code error;
  // A program knows itself by the name that it was called by, which may be relative or in PATH.
  const fs::path file = std::string(info.dli_fname).find('/') == std::string::npos
                            ? ownProgram(error)
                            : fs::absolute(info.dli_fname, error);
  return fs::weakly_canonical(file, error);
}

std::string libraryFile(const std::string& name) {
#ifdef __APPLE__
  return "lib" + name + ".dylib";
#else
  return "lib" + name + ".so";
#endif
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
