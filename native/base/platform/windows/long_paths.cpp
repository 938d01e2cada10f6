// What libstdc++ asks the C library and Windows of files, for std::filesystem and for streams that
// are opened by a path: here names may have any length and any letters. Those of the C library end
// at 260 letters, and its functions of folders and of status refuse the sign that lifts this.
//
// libstdc++ is linked in, and calls an imported function through a pointer `__imp_…` that the
// linker finds where it is defined first: native/package/windows_parts.cmake asks for those of this
// file.
#include <dirent.h>
#include <sys/stat.h>
#include <wchar.h>
#include <windows.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "base/platform/files.h"
#include "base/platform/windows/system_name.h"

namespace {

using stipple::platform::PathKind;
using stipple::platform::PathStatus;
using stipple::platform::setErrnoFromSystem;
using stipple::platform::systemName;

constexpr int64_t kSecond = 1000000000;

template <typename Function>
Function* original(const wchar_t* library, const char* name) {
  return reinterpret_cast<Function*>(
      reinterpret_cast<void*>(::GetProcAddress(::GetModuleHandleW(library), name)));
}

int statPath(const wchar_t* path, struct _stat64* out) {
  PathStatus status;
  if (!stipple::platform::statusOf(stipple::platform::utf8Of(path), status)) return -1;
  *out = {};
  out->st_mode = status.kind == PathKind::kFolder ? S_IFDIR | 0777
                 : status.kind == PathKind::kFile ? S_IFREG | 0666
                                                  : S_IFCHR | 0666;
  out->st_nlink = 1;
  out->st_size = static_cast<int64_t>(status.bytes);
  out->st_mtime = status.modified / kSecond;
  return 0;
}

int makeFolder(const wchar_t* path) {
  if (::CreateDirectoryW(systemName(path).c_str(), nullptr) != 0) return 0;
  setErrnoFromSystem();
  return -1;
}

FILE* openStream(const wchar_t* path, const wchar_t* mode) {
  static auto* const open = original<FILE*(const wchar_t*, const wchar_t*)>(L"msvcrt", "_wfopen");
  return open(systemName(path).c_str(), mode);
}

BOOL WINAPI removeFile(const wchar_t* path) {
  static auto* const remove = original<BOOL WINAPI(const wchar_t*)>(L"kernel32", "DeleteFileW");
  return remove(systemName(path).c_str());
}

BOOL WINAPI removeFolder(const wchar_t* path) {
  static auto* const remove =
      original<BOOL WINAPI(const wchar_t*)>(L"kernel32", "RemoveDirectoryW");
  return remove(systemName(path).c_str());
}

/// A folder that is being read. Others see the entry that a pointer to it is given of.
struct Listing {
  HANDLE search;
  WIN32_FIND_DATAW found;
  bool is_first = true;
  _wdirent entry{};
};

}  // namespace

extern "C" {

int (*__imp__wstat64)(const wchar_t*, struct _stat64*) = statPath;
int (*__imp__wmkdir)(const wchar_t*) = makeFolder;
FILE* (*__imp__wfopen)(const wchar_t*, const wchar_t*) = openStream;
BOOL(WINAPI* __imp_DeleteFileW)(const wchar_t*) = removeFile;
BOOL(WINAPI* __imp_RemoveDirectoryW)(const wchar_t*) = removeFolder;

_WDIR* _wopendir(const wchar_t* path) {
  std::wstring pattern = systemName(path);
  if (pattern.empty()) pattern = L".";
  if (pattern.back() != L'\\') pattern += L'\\';
  // With the star the name may have become a long one.
  pattern = systemName((pattern + L"*").c_str());
  auto* listing = new Listing;
  listing->search = ::FindFirstFileW(pattern.c_str(), &listing->found);
  if (listing->search != INVALID_HANDLE_VALUE) return reinterpret_cast<_WDIR*>(listing);
  setErrnoFromSystem();
  delete listing;
  return nullptr;
}

_wdirent* _wreaddir(_WDIR* folder) {
  auto* listing = reinterpret_cast<Listing*>(folder);
  if (!listing->is_first && ::FindNextFileW(listing->search, &listing->found) == 0) {
    if (::GetLastError() != ERROR_NO_MORE_FILES) setErrnoFromSystem();
    return nullptr;
  }
  listing->is_first = false;
  static_assert(sizeof(listing->entry.d_name) >= sizeof(listing->found.cFileName));
  std::memcpy(listing->entry.d_name, listing->found.cFileName, sizeof(listing->found.cFileName));
  listing->entry.d_namlen = static_cast<unsigned short>(::wcslen(listing->found.cFileName));
  return &listing->entry;
}

int _wclosedir(_WDIR* folder) {
  auto* listing = reinterpret_cast<Listing*>(folder);
  ::FindClose(listing->search);
  delete listing;
  return 0;
}

}  // extern "C"
