#include "base/platform/loading.h"

#include <windows.h>

#include <system_error>

#include "base/platform/windows/system_name.h"

namespace stipple::platform {

namespace fs = std::filesystem;

namespace {

/// The system's sentence for its last error, without its line end.
std::string lastReason() {
  std::string text = std::system_category().message(static_cast<int>(::GetLastError()));
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  return text;
}

}  // namespace

fs::path ownFile() {
  HMODULE module = nullptr;
  if (::GetModuleHandleExW(
          GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT,
          reinterpret_cast<const wchar_t*>(&ownFile), &module) == 0) {
    return fs::path();
  }
  // The length of a path is not told, only that it was cut.
  for (size_t size = MAX_PATH; size <= size_t{1} << 16; size *= 2) {
    std::wstring name(size, L'\0');
    const DWORD length = ::GetModuleFileNameW(module, name.data(), static_cast<DWORD>(size));
    if (length < size) return fs::path(name.substr(0, length));
  }
  return fs::path();
}

std::string libraryFile(const std::string& name) {
  return name + ".dll";
}

void* openLibrary(const std::string& path, std::string& why) {
  // What the library needs is looked for beside it, and not in the folder that somebody works in.
  HMODULE library =
      ::LoadLibraryExW(systemName(path).c_str(), nullptr, LOAD_WITH_ALTERED_SEARCH_PATH);
  if (library == nullptr) why = lastReason();
  return library;
}

void* functionOf(void* library, const char* function) {
  return reinterpret_cast<void*>(::GetProcAddress(static_cast<HMODULE>(library), function));
}

void closeLibrary(void* library) {
  ::FreeLibrary(static_cast<HMODULE>(library));
}

}  // namespace stipple::platform
