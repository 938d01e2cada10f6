#include "base/platform/files.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace stipple::platform {

namespace {

PathStatus statusFrom(const struct stat& from) {
  PathStatus status;
  status.kind = S_ISREG(from.st_mode)   ? PathKind::kFile
                : S_ISDIR(from.st_mode) ? PathKind::kFolder
                                        : PathKind::kOther;
  status.bytes = static_cast<uint64_t>(from.st_size);
#ifdef __APPLE__
  const timespec& modified = from.st_mtimespec;
#else
  const timespec& modified = from.st_mtim;
#endif
  status.modified = int64_t{modified.tv_sec} * 1000000000 + modified.tv_nsec;
  status.permissions = from.st_mode & 0777;
  return status;
}

}  // namespace

bool statusOf(const std::string& path, PathStatus& status) {
  status = {};
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return false;
  status = statusFrom(found);
  return true;
}

bool statusOfOpen(int descriptor, PathStatus& status) {
  status = {};
  struct stat found {};
  if (::fstat(descriptor, &found) != 0) return false;
  status = statusFrom(found);
  return true;
}

bool isWritable(const std::string& path) {
  return ::access(path.c_str(), W_OK) == 0;
}

int openForReading(const std::string& path) {
  // Non-blocking, so that opening a pipe without a writer returns.
  return ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
}

int createFile(const std::string& path, unsigned permissions) {
  return ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC,
                static_cast<mode_t>(permissions));
}

void closeFile(int descriptor) {
  ::close(descriptor);
}

std::FILE* streamOf(int descriptor) {
  return ::fdopen(descriptor, "wb");
}

int descriptorOf(std::FILE* stream) {
  return ::fileno(stream);
}

int64_t readSome(int descriptor, uint64_t offset, void* bytes, size_t count) {
  ssize_t got = 0;
  do {
    got = ::pread(descriptor, bytes, count, static_cast<off_t>(offset));
  } while (got < 0 && errno == EINTR);
  return got;
}

int64_t writeSome(int descriptor, uint64_t offset, const void* bytes, size_t count) {
  ssize_t put = 0;
  do {
    put = ::pwrite(descriptor, bytes, count, static_cast<off_t>(offset));
  } while (put < 0 && errno == EINTR);
  return put;
}

std::shared_ptr<const uint8_t> mapFile(int descriptor, size_t length) {
  void* memory = ::mmap(nullptr, length, PROT_READ, MAP_PRIVATE, descriptor, 0);
  if (memory == MAP_FAILED) return nullptr;
  return {static_cast<const uint8_t*>(memory),
          [memory, length](const uint8_t*) { ::munmap(memory, length); }};
}

namespace {

int syncDescriptor(int descriptor) {
#ifdef F_FULLFSYNC
  // On macOS fsync() gives the bytes to the device, which may keep them in its own memory; not
  // every file system knows the whole way.
  if (::fcntl(descriptor, F_FULLFSYNC) == 0) return 0;
#endif
  return ::fsync(descriptor);
}

}  // namespace

bool syncFile(const std::string& path) {
  // A new descriptor does: fsync concerns the file and not the handle.
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const int sync_error = syncDescriptor(descriptor) != 0 ? errno : 0;
  const int close_error = ::close(descriptor) != 0 ? errno : 0;
  errno = sync_error != 0 ? sync_error : close_error;
  return sync_error == 0 && close_error == 0;
}

bool replaceFile(const std::string& from, const std::string& to) {
  return ::rename(from.c_str(), to.c_str()) == 0;
}

bool removeFile(const std::string& path) {
  return ::unlink(path.c_str()) == 0;
}

long processNumber() {
  return ::getpid();
}

bool mayLive(long process) {
  return ::kill(static_cast<pid_t>(process), 0) == 0 || errno != ESRCH;
}

int lockFile(int descriptor) {
  // A lock belongs to what both descriptors share: it lasts until the second is closed.
  const int lock = ::fcntl(descriptor, F_DUPFD_CLOEXEC, 0);
  if (lock >= 0) ::flock(lock, LOCK_EX | LOCK_NB);
  return lock;
}

void removeUnlocked(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return;
  struct stat status {};
  if (::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) &&
      ::flock(descriptor, LOCK_EX | LOCK_NB) == 0) {
    ::unlink(path.c_str());
  }
  ::close(descriptor);
}

}  // namespace stipple::platform
