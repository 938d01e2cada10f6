#include "io/bytes/output_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include "base/error.h"
#include "io/bytes/temporary_files.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void failWriting(const std::string& path, const std::string& why) {
  fail(ErrorCode::kIo, path + " cannot be written: " + why);
}

std::string reason(int error) {
  return std::generic_category().message(error);
}

/// More than any system follows.
constexpr int kMaxLinks = 40;

std::string temporaryName(const fs::path& target) {
  static std::atomic<unsigned> counter{0};
  const std::string name = temporaryFileName(::getpid(), counter.fetch_add(1));
  // Same folder, because only there a rename is atomic; same extension, because some libraries
  // choose the format by it. Short, so that no file name becomes longer than the system allows.
  return (target.parent_path() / (name + target.extension().string())).string();
}

}  // namespace

std::string outputTarget(const std::string& path) {
  if (path.empty()) fail(ErrorCode::kIo, "the path of the file to write is empty");
  fs::path target = path;
  std::error_code error;
  for (int links = 0; fs::is_symlink(target, error); ++links) {
    if (links == kMaxLinks) failWriting(path, reason(ELOOP));
    const fs::path next = fs::read_symlink(target, error);
    if (error) failWriting(path, error.message());
    target = next.is_absolute() ? next : target.parent_path() / next;
  }
  return target.string();
}

OutputFile::OutputFile(const std::string& path) : path_(path) {
  const fs::path target = outputTarget(path);
  struct stat status {};
  const bool exists = ::stat(target.c_str(), &status) == 0;
  // Renaming over a device or a pipe would replace it.
  if (exists && S_ISDIR(status.st_mode)) failWriting(path, "it is a folder");
  if (exists && !S_ISREG(status.st_mode)) failWriting(path, "it is not a regular file");
  // A rename asks only the folder for permission; a file that is read-only stays as it is.
  if (exists && ::access(target.c_str(), W_OK) != 0) failWriting(path, reason(errno));
  const mode_t mode = exists ? status.st_mode & 0777 : 0666;
  sweepTemporaryFiles(target.parent_path());
  int descriptor = -1;
  do {
    temporary_path_ = temporaryName(target);
    descriptor = ::open(temporary_path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  } while (descriptor < 0 && errno == EEXIST);
  if (descriptor < 0) failWriting(path, reason(errno));
  lock_ = lockTemporaryFile(descriptor);
  file_ = ::fdopen(descriptor, "wb");
  if (file_ == nullptr) {
    const int error = errno;
    ::close(descriptor);
    if (lock_ >= 0) ::close(lock_);
    ::unlink(temporary_path_.c_str());
    failWriting(path, reason(error));
  }
}

OutputFile::~OutputFile() {
  if (file_ != nullptr) std::fclose(file_);
  if (!committed_) ::unlink(temporary_path_.c_str());
  if (lock_ >= 0) ::close(lock_);
}

void OutputFile::write(const void* bytes, size_t count) {
  if (file_ == nullptr) {
    fail(ErrorCode::kInternal, path_ + " is written after its handle was given away");
  }
  if (count > 0 && std::fwrite(bytes, 1, count, file_) != count) {
    failWriting(path_, reason(errno));
  }
}

void OutputFile::writeAt(uint64_t offset, const void* bytes, size_t count) {
  if (file_ == nullptr) {
    fail(ErrorCode::kInternal, path_ + " is written after its handle was given away");
  }
  const int descriptor = ::fileno(file_);
  const auto* source = static_cast<const char*>(bytes);
  while (count > 0) {
    const ssize_t put = ::pwrite(descriptor, source, count, static_cast<off_t>(offset));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) failWriting(path_, reason(put < 0 ? errno : ENOSPC));
    source += put;
    offset += static_cast<uint64_t>(put);
    count -= static_cast<size_t>(put);
  }
}

void OutputFile::handOver() {
  if (file_ == nullptr) return;
  std::FILE* file = file_;
  file_ = nullptr;
  if (std::fclose(file) != 0) failWriting(path_, reason(errno));
}

void OutputFile::commit() {
  if (committed_) return;
  handOver();
  // A new descriptor serves both cases: fsync concerns the file and not the handle.
  const int descriptor = ::open(temporary_path_.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) failWriting(path_, reason(errno));
  const int sync_error = ::fsync(descriptor) != 0 ? errno : 0;
  const int close_error = ::close(descriptor) != 0 ? errno : 0;
  if (sync_error != 0) failWriting(path_, reason(sync_error));
  if (close_error != 0) failWriting(path_, reason(close_error));
  const std::string target = outputTarget(path_);
  if (::rename(temporary_path_.c_str(), target.c_str()) != 0) failWriting(path_, reason(errno));
  committed_ = true;
}

void writeByLibrary(const std::string& path, const std::function<void(const char*)>& write) {
  OutputFile file(path);
  file.handOver();
  const std::string& temporary = file.temporaryPath();
  try {
    write(temporary.c_str());
  } catch (const Error& error) {
    std::string message = error.what();
    for (size_t at = 0; (at = message.find(temporary, at)) != message.npos; at += path.size()) {
      message.replace(at, temporary.size(), path);
    }
    fail(error.code(), message);
  }
  file.commit();
}

}  // namespace stipple
