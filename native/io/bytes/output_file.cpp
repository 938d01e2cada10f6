#include "io/bytes/output_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include "base/error.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void failWriting(const std::string& path, const std::string& why) {
  fail(ErrorCode::kIo, path + " cannot be written: " + why);
}

std::string reason(int error) {
  return std::generic_category().message(error);
}

/// Where the bytes finally belong: a link is followed, so that it stays a link.
fs::path resolved(const std::string& path) {
  if (path.empty()) fail(ErrorCode::kIo, "the path of the file to write is empty");
  std::error_code ignored;
  if (fs::is_symlink(path, ignored)) {
    const fs::path target = fs::weakly_canonical(path, ignored);
    if (!ignored) return target;
  }
  return path;
}

/// Same folder, because only there a rename is atomic; same ending, because some libraries choose
/// the format by it. Short, so that no file name becomes longer than the system allows.
std::string temporaryName(const fs::path& target) {
  static std::atomic<unsigned> counter{0};
  const std::string name = ".stipple-" + std::to_string(::getpid()) + "-" +
                           std::to_string(counter.fetch_add(1)) + target.extension().string();
  return (target.parent_path() / name).string();
}

}  // namespace

OutputFile::OutputFile(const std::string& path) : path_(path) {
  const fs::path target = resolved(path);
  struct stat status {};
  const bool exists = ::stat(target.c_str(), &status) == 0;
  // Renaming over a device or a pipe would replace it.
  if (exists && S_ISDIR(status.st_mode)) failWriting(path, "it is a folder");
  if (exists && !S_ISREG(status.st_mode)) failWriting(path, "it is not a regular file");
  // A rename asks only the folder for permission; a file that is read-only stays as it is.
  if (exists && ::access(target.c_str(), W_OK) != 0) failWriting(path, reason(errno));
  const mode_t mode = exists ? status.st_mode & 0777 : 0666;
  int descriptor = -1;
  do {
    temporary_path_ = temporaryName(target);
    descriptor = ::open(temporary_path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  } while (descriptor < 0 && errno == EEXIST);
  if (descriptor < 0) failWriting(path, reason(errno));
  file_ = ::fdopen(descriptor, "wb");
  if (file_ == nullptr) {
    const int error = errno;
    ::close(descriptor);
    ::unlink(temporary_path_.c_str());
    failWriting(path, reason(error));
  }
}

OutputFile::~OutputFile() {
  if (file_ != nullptr) std::fclose(file_);
  if (!committed_) ::unlink(temporary_path_.c_str());
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
  const fs::path target = resolved(path_);
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
