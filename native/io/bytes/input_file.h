#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace stipple {

/// A regular file that is open for reading at any offset, from any thread. Plain reads but for
/// map(): a file that shrinks while it is read gives an error and not a signal.
/// Errors: kIo with the path and the system's reason.
class InputFile {
 public:
  explicit InputFile(const std::string& path);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  const std::string& path() const { return path_; }
  uint64_t size() const { return size_; }
  /// Reads exactly `count` bytes from `offset`; a range that leaves the file is kFormat.
  void readAt(uint64_t offset, void* bytes, size_t count) const;
  /// The whole file in memory, read as it is used, for as long as the pointer lives, which may be
  /// longer than this object: for files too large to read whole. A file that somebody shortens
  /// meanwhile ends the process with a signal; all that is small is read by readAt(). Errors: kIo.
  std::shared_ptr<const uint8_t> map() const;

 private:
  std::string path_;
  uint64_t size_ = 0;
  int descriptor_ = -1;
};

/// The whole file as a string. In: limit, bytes; larger files are refused with kFormat.
std::string readTextFile(const std::string& path, uint64_t limit);

/// Extension of a path in lower case with its dot (".ply"), or empty.
std::string lowerExtension(const std::string& path);

}  // namespace stipple
