#include "io/bytes/output_file.h"

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include "base/error.h"
#include "base/platform/files.h"
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
  const std::string name = temporaryFileName(platform::processNumber(), counter.fetch_add(1));
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
  platform::PathStatus status;
  const bool exists = platform::statusOf(target.string(), status);
  // Renaming over a device or a pipe would replace it.
  if (status.kind == platform::PathKind::kFolder) failWriting(path, "it is a folder");
  if (status.kind == platform::PathKind::kOther) failWriting(path, "it is not a regular file");
  // A rename asks only the folder for permission; a file that is read-only stays as it is.
  if (exists && !platform::isWritable(target.string())) failWriting(path, reason(errno));
  const unsigned permissions = exists ? status.permissions : 0666;
  sweepTemporaryFiles(target.parent_path());
  int descriptor = -1;
  do {
    temporary_path_ = temporaryName(target);
    descriptor = platform::createFile(temporary_path_, permissions);
  } while (descriptor < 0 && errno == EEXIST);
  if (descriptor < 0) failWriting(path, reason(errno));
  lock_ = platform::lockFile(descriptor);
  file_ = platform::streamOf(descriptor);
  if (file_ == nullptr) {
    const int error = errno;
    platform::closeFile(descriptor);
    if (lock_ >= 0) platform::closeFile(lock_);
    platform::removeFile(temporary_path_);
    failWriting(path, reason(error));
  }
}

OutputFile::~OutputFile() {
  if (file_ != nullptr) std::fclose(file_);
  if (!committed_) platform::removeFile(temporary_path_);
  if (lock_ >= 0) platform::closeFile(lock_);
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
  const int descriptor = platform::descriptorOf(file_);
  const auto* source = static_cast<const char*>(bytes);
  while (count > 0) {
    const int64_t put = platform::writeSome(descriptor, offset, source, count);
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
  if (!platform::syncFile(temporary_path_)) failWriting(path_, reason(errno));
  const std::string target = outputTarget(path_);
  if (!platform::replaceFile(temporary_path_, target)) failWriting(path_, reason(errno));
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
