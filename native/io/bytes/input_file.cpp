#include "io/bytes/input_file.h"

#include <cctype>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include "base/error.h"
#include "base/platform/files.h"

namespace stipple {

namespace {

std::string reason(int error) {
  return std::generic_category().message(error);
}

}  // namespace

InputFile::InputFile(const std::string& path) : path_(path) {
  descriptor_ = platform::openForReading(path);
  if (descriptor_ < 0) fail(ErrorCode::kIo, path + " cannot be opened: " + reason(errno));
  platform::PathStatus status;
  const int failed = platform::statusOfOpen(descriptor_, status) ? 0 : errno;
  if (failed != 0 || status.kind != platform::PathKind::kFile) {
    platform::closeFile(descriptor_);
    const bool is_folder = status.kind == platform::PathKind::kFolder;
    fail(ErrorCode::kIo, path + " cannot be read: " +
                             (failed != 0 ? reason(failed)
                              : is_folder ? std::string("it is a folder, not a file")
                                          : std::string("it is not a regular file")));
  }
  size_ = status.bytes;
}

InputFile::~InputFile() {
  platform::closeFile(descriptor_);
}

void InputFile::readAt(uint64_t offset, void* bytes, size_t count) const {
  if (offset > size_ || count > size_ - offset) {
    fail(ErrorCode::kFormat, path_ + " is truncated: bytes " + std::to_string(offset) + " to " +
                                 std::to_string(offset + count) + " are needed, it holds " +
                                 std::to_string(size_));
  }
  auto* target = static_cast<char*>(bytes);
  while (count > 0) {
    const int64_t got = platform::readSome(descriptor_, offset, target, count);
    if (got < 0) fail(ErrorCode::kIo, path_ + " cannot be read: " + reason(errno));
    if (got == 0) {
      fail(ErrorCode::kIo, path_ + " became shorter while it was read: byte " +
                               std::to_string(offset) + " is gone");
    }
    target += got;
    offset += static_cast<uint64_t>(got);
    count -= static_cast<size_t>(got);
  }
}

std::shared_ptr<const uint8_t> InputFile::map() const {
  const auto length = static_cast<size_t>(size_);
  if (length == 0) fail(ErrorCode::kIo, path_ + " cannot be mapped: it is empty");
  std::shared_ptr<const uint8_t> memory = platform::mapFile(descriptor_, length);
  if (memory == nullptr) fail(ErrorCode::kIo, path_ + " cannot be mapped: " + reason(errno));
  return memory;
}

std::string readTextFile(const std::string& path, uint64_t limit) {
  const InputFile file(path);
  if (file.size() > limit) {
    fail(ErrorCode::kFormat, path + " holds " + std::to_string(file.size()) + " bytes; at most " +
                                 std::to_string(limit) + " are allowed");
  }
  std::string text(static_cast<size_t>(file.size()), '\0');
  file.readAt(0, text.data(), text.size());
  return text;
}

std::string lowerExtension(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

}  // namespace stipple
