#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <string>

namespace stipple {

/// A file that appears under its name only when it is whole: bytes go to a temporary name in the
/// same folder, `commit` flushes and renames, the destructor removes what was not committed.
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
  bool committed_ = false;
};

/// A file that a library makes whole: `write` gets the temporary name, in whose place messages have
/// the path. Errors: those of OutputFile and of `write`.
void writeByLibrary(const std::string& path, const std::function<void(const char*)>& write);

}  // namespace stipple
