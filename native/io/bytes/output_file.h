#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <string>

namespace stipple {

/// Where the bytes of an output finally belong: links are followed, also to a file that is not there
/// yet, so that they stay links. Errors: kIo for an empty path and for links that go in a circle.
std::string outputTarget(const std::string& path);

/// A file that appears under its name only when it is whole: bytes go to a temporary name in the
/// same folder, `commit` flushes and renames, the destructor removes what was not committed. What a
/// killed process left in the folder is removed when the next one begins to write there.
/// Errors: kIo with the path and the system's reason (folder missing, no permission, disk full).
class OutputFile {
 public:
  explicit OutputFile(const std::string& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  void write(const void* bytes, size_t count);
  /// Writes at a place of the file, from any thread, so that some encode while one writes. Not
  /// together with write().
  void writeAt(uint64_t offset, const void* bytes, size_t count);
  void commit();
  /// The temporary name, for libraries that open files themselves (then `adopt` before commit).
  const std::string& temporaryPath() const { return temporary_path_; }
  /// Closes our handle, so that a library can write temporaryPath() itself.
  void handOver();

 private:
  std::string path_;
  std::string temporary_path_;
  std::FILE* file_ = nullptr;
  int lock_ = -1;  ///< held as long as the temporary file has an owner
  bool committed_ = false;
};

/// A file that a library makes whole: `write` gets the temporary name, in whose place messages have
/// the path. Errors: those of OutputFile and of `write`.
void writeByLibrary(const std::string& path, const std::function<void(const char*)>& write);

}  // namespace stipple
