#include "base/platform/windows/system_name.h"

#include <windows.h>

#include <algorithm>
#include <cerrno>
#include <cwchar>
#include <filesystem>

namespace stipple::platform {

namespace {

/// Folders may have 248 letters and files 260; a name of 8.3 letters is kept free for both.
constexpr size_t kShortLength = 235;

bool beginsWith(const std::wstring& text, const wchar_t* begin) {
  return text.compare(0, std::wcslen(begin), begin) == 0;
}

}  // namespace

std::wstring systemName(const wchar_t* path) {
  std::wstring name = path;
  std::replace(name.begin(), name.end(), L'/', L'\\');
  // A relative path is as long as the folder that it starts from makes it.
  if (name.empty() || beginsWith(name, L"\\\\?\\") || beginsWith(name, L"\\\\.\\")) return name;
  const DWORD length = ::GetFullPathNameW(name.c_str(), 0, nullptr, nullptr);
  if (length <= kShortLength) return name;
  std::wstring whole(length, L'\0');
  whole.resize(::GetFullPathNameW(name.c_str(), length, whole.data(), nullptr));
  if (beginsWith(whole, L"\\\\")) return L"\\\\?\\UNC\\" + whole.substr(2);
  return L"\\\\?\\" + whole;
}

std::wstring systemName(const std::string& path) {
  return systemName(std::filesystem::path(path).c_str());
}

std::string utf8Of(const wchar_t* text) {
  const int length = ::WideCharToMultiByte(CP_UTF8, 0, text, -1, nullptr, 0, nullptr, nullptr);
  if (length <= 1) return {};
  std::string utf8(static_cast<size_t>(length), '\0');
  ::WideCharToMultiByte(CP_UTF8, 0, text, -1, utf8.data(), length, nullptr, nullptr);
  utf8.pop_back();
  return utf8;
}

void setErrnoFromSystem() {
  switch (::GetLastError()) {
    case ERROR_FILE_NOT_FOUND:
    case ERROR_PATH_NOT_FOUND:
    case ERROR_INVALID_DRIVE:
    case ERROR_INVALID_NAME:
    case ERROR_BAD_NETPATH:
    case ERROR_BAD_NET_NAME:
    case ERROR_BAD_PATHNAME:
    case ERROR_DIRECTORY:
      errno = ENOENT;
      break;
    case ERROR_FILE_EXISTS:
    case ERROR_ALREADY_EXISTS:
      errno = EEXIST;
      break;
    case ERROR_ACCESS_DENIED:
    case ERROR_SHARING_VIOLATION:
    case ERROR_LOCK_VIOLATION:
    case ERROR_USER_MAPPED_FILE:
      errno = EACCES;
      break;
    case ERROR_WRITE_PROTECT:
      errno = EROFS;
      break;
    case ERROR_DISK_FULL:
    case ERROR_HANDLE_DISK_FULL:
      errno = ENOSPC;
      break;
    case ERROR_NOT_ENOUGH_MEMORY:
    case ERROR_OUTOFMEMORY:
    case ERROR_COMMITMENT_LIMIT:
      errno = ENOMEM;
      break;
    case ERROR_TOO_MANY_OPEN_FILES:
      errno = EMFILE;
      break;
    case ERROR_FILENAME_EXCED_RANGE:
      errno = ENAMETOOLONG;
      break;
    default:
      errno = EIO;
  }
}

}  // namespace stipple::platform
