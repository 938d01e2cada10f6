#include "base/platform/files.h"

#include <fcntl.h>
#include <io.h>
#include <windows.h>

#include <algorithm>
#include <cerrno>

#include "base/platform/windows/system_name.h"

namespace stipple::platform {

namespace {

/// Others may read, write, rename and remove what is open here, as on other systems.
constexpr DWORD kShareAll = FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE;
/// Without it a folder cannot be opened, nor told from a file that may not be read.
constexpr DWORD kFoldersToo = FILE_FLAG_BACKUP_SEMANTICS;
/// Windows takes 32 bits of a count.
constexpr size_t kMostAtOnce = size_t{1} << 30;
/// A byte far behind the end of any file: on Windows a lock forbids what it covers to all others.
constexpr DWORD kLockPlace = 0x7fffffff;

/// Windows counts steps of 100 nanoseconds from the year 1601; 64 bits of nanoseconds reach from
/// 1970 to 2262.
constexpr int64_t kEpochSteps = 116444736000000000;

HANDLE handleOf(int descriptor) {
  return reinterpret_cast<HANDLE>(::_get_osfhandle(descriptor));
}

int64_t number64(DWORD high, DWORD low) {
  return static_cast<int64_t>(static_cast<uint64_t>(high) << 32 | low);
}

bool statusOfHandle(HANDLE handle, PathStatus& status) {
  BY_HANDLE_FILE_INFORMATION found{};
  if (::GetFileType(handle) != FILE_TYPE_DISK) {
    status.kind = PathKind::kOther;
    return true;
  }
  if (::GetFileInformationByHandle(handle, &found) == 0) {
    setErrnoFromSystem();
    return false;
  }
  const bool is_folder = (found.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY) != 0;
  status.kind = is_folder ? PathKind::kFolder : PathKind::kFile;
  status.bytes = static_cast<uint64_t>(number64(found.nFileSizeHigh, found.nFileSizeLow));
  const int64_t steps =
      number64(found.ftLastWriteTime.dwHighDateTime, found.ftLastWriteTime.dwLowDateTime);
  status.modified = (steps - kEpochSteps) * 100;
  status.permissions = 0666;
  return true;
}

/// Null and errno where it cannot be opened.
HANDLE open(const std::string& path, DWORD access, DWORD creation, DWORD flags) {
  const HANDLE handle = ::CreateFileW(systemName(path).c_str(), access, kShareAll, nullptr,
                                      creation, FILE_ATTRIBUTE_NORMAL | flags, nullptr);
  if (handle != INVALID_HANDLE_VALUE) return handle;
  setErrnoFromSystem();
  return nullptr;
}

int descriptorFor(HANDLE handle, int flags) {
  if (handle == nullptr) return -1;
  const int descriptor =
      ::_open_osfhandle(reinterpret_cast<intptr_t>(handle), flags | _O_BINARY | _O_NOINHERIT);
  if (descriptor < 0) ::CloseHandle(handle);
  return descriptor;
}

OVERLAPPED placeAt(uint64_t offset) {
  OVERLAPPED place{};
  place.Offset = static_cast<DWORD>(offset);
  place.OffsetHigh = static_cast<DWORD>(offset >> 32);
  return place;
}

bool lock(HANDLE handle) {
  OVERLAPPED place{};
  place.OffsetHigh = kLockPlace;
  return ::LockFileEx(handle, LOCKFILE_EXCLUSIVE_LOCK | LOCKFILE_FAIL_IMMEDIATELY, 0, 1, 0,
                      &place) != 0;
}

}  // namespace

bool statusOf(const std::string& path, PathStatus& status) {
  status = {};
  const HANDLE handle = open(path, FILE_READ_ATTRIBUTES, OPEN_EXISTING, kFoldersToo);
  if (handle == nullptr) return false;
  const bool is_known = statusOfHandle(handle, status);
  ::CloseHandle(handle);
  return is_known;
}

bool statusOfOpen(int descriptor, PathStatus& status) {
  status = {};
  return statusOfHandle(handleOf(descriptor), status);
}

bool isWritable(const std::string& path) {
  const DWORD attributes = ::GetFileAttributesW(systemName(path).c_str());
  if (attributes == INVALID_FILE_ATTRIBUTES) {
    setErrnoFromSystem();
    return false;
  }
  // The sign says of a folder only that its icon is another one.
  if ((attributes & FILE_ATTRIBUTE_DIRECTORY) != 0 || (attributes & FILE_ATTRIBUTE_READONLY) == 0) {
    return true;
  }
  errno = EACCES;
  return false;
}

int openForReading(const std::string& path) {
  return descriptorFor(open(path, GENERIC_READ, OPEN_EXISTING, kFoldersToo), _O_RDONLY);
}

int createFile(const std::string& path, unsigned) {
  return descriptorFor(open(path, GENERIC_WRITE, CREATE_NEW, 0), _O_WRONLY);
}

void closeFile(int descriptor) {
  ::_close(descriptor);
}

std::FILE* streamOf(int descriptor) {
  return ::_fdopen(descriptor, "wb");
}

int descriptorOf(std::FILE* stream) {
  return ::_fileno(stream);
}

int64_t readSome(int descriptor, uint64_t offset, void* bytes, size_t count) {
  OVERLAPPED place = placeAt(offset);
  DWORD got = 0;
  const auto asked = static_cast<DWORD>(std::min(count, kMostAtOnce));
  if (::ReadFile(handleOf(descriptor), bytes, asked, &got, &place) != 0) return got;
  if (::GetLastError() == ERROR_HANDLE_EOF) return 0;
  setErrnoFromSystem();
  return -1;
}

int64_t writeSome(int descriptor, uint64_t offset, const void* bytes, size_t count) {
  OVERLAPPED place = placeAt(offset);
  DWORD put = 0;
  const auto asked = static_cast<DWORD>(std::min(count, kMostAtOnce));
  if (::WriteFile(handleOf(descriptor), bytes, asked, &put, &place) != 0) return put;
  setErrnoFromSystem();
  return -1;
}

std::shared_ptr<const uint8_t> mapFile(int descriptor, size_t length) {
  const HANDLE mapping =
      ::CreateFileMappingW(handleOf(descriptor), nullptr, PAGE_READONLY,
                           static_cast<DWORD>(length >> 32), static_cast<DWORD>(length), nullptr);
  void* memory =
      mapping == nullptr ? nullptr : ::MapViewOfFile(mapping, FILE_MAP_READ, 0, 0, length);
  if (memory == nullptr) setErrnoFromSystem();
  if (mapping != nullptr) ::CloseHandle(mapping);  // the view keeps what it needs
  if (memory == nullptr) return nullptr;
  return {static_cast<const uint8_t*>(memory),
          [memory](const uint8_t*) { ::UnmapViewOfFile(memory); }};
}

bool syncFile(const std::string& path) {
  const HANDLE handle = open(path, GENERIC_WRITE, OPEN_EXISTING, 0);
  if (handle == nullptr) return false;
  const bool is_done = ::FlushFileBuffers(handle) != 0;
  if (!is_done) setErrnoFromSystem();
  ::CloseHandle(handle);
  return is_done;
}

bool replaceFile(const std::string& from, const std::string& to) {
  const std::wstring source = systemName(from), target = systemName(to);
  constexpr DWORD kReplace = MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH;
  if (::MoveFileExW(source.c_str(), target.c_str(), kReplace) != 0) return true;
  setErrnoFromSystem();
  // A file that is open cannot be replaced on systems before Windows 10, but what is open here can
  // be renamed: it gets a name that nobody looks at, and is gone when it is closed. For a moment
  // there is neither.
  const std::wstring aside = source + L".old";
  if (errno != EACCES || ::MoveFileExW(target.c_str(), aside.c_str(), 0) == 0) return false;
  if (::MoveFileExW(source.c_str(), target.c_str(), kReplace) != 0) {
    ::DeleteFileW(aside.c_str());
    return true;
  }
  setErrnoFromSystem();
  ::MoveFileExW(aside.c_str(), target.c_str(), 0);
  return false;
}

bool removeFile(const std::string& path) {
  if (::DeleteFileW(systemName(path).c_str()) != 0) return true;
  setErrnoFromSystem();
  return false;
}

long processNumber() {
  return static_cast<long>(::GetCurrentProcessId());
}

bool mayLive(long process) {
  const HANDLE handle =
      ::OpenProcess(SYNCHRONIZE, FALSE, static_cast<DWORD>(static_cast<unsigned long>(process)));
  if (handle == nullptr) return ::GetLastError() != ERROR_INVALID_PARAMETER;
  const bool has_ended = ::WaitForSingleObject(handle, 0) == WAIT_OBJECT_0;
  ::CloseHandle(handle);
  return !has_ended;
}

int lockFile(int descriptor) {
  HANDLE second = nullptr;
  const HANDLE own = ::GetCurrentProcess();
  if (::DuplicateHandle(own, handleOf(descriptor), own, &second, 0, FALSE, DUPLICATE_SAME_ACCESS) ==
      0) {
    return -1;
  }
  lock(second);
  return descriptorFor(second, _O_WRONLY);
}

void removeUnlocked(const std::string& path) {
  const HANDLE handle = open(path, GENERIC_READ, OPEN_EXISTING, FILE_FLAG_OPEN_REPARSE_POINT);
  if (handle == nullptr) return;
  PathStatus status;
  if (statusOfHandle(handle, status) && status.kind == PathKind::kFile && lock(handle)) {
    removeFile(path);
  }
  ::CloseHandle(handle);
}

}  // namespace stipple::platform
