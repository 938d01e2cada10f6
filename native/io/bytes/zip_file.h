#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "io/bytes/input_file.h"
#include "io/bytes/output_file.h"

namespace stipple {

/// A zip archive that is open for reading, entry by entry, from any thread. Entries are stored or
/// deflated; names that leave the archive ('..', absolute), encryption and archives above 4 GiB are
/// refused when it is opened.
/// Errors: kFormat with the archive, the entry and the offset; kUnsupported.
class ZipReader {
 public:
  explicit ZipReader(const InputFile& file);

  bool has(const std::string& name) const { return entries_.count(name) != 0; }
  /// The entry that lies before all others. Errors: kFormat where there is none.
  const std::string& firstName() const;
  /// Bytes of an entry in the archive. Errors: kFormat where it is missing.
  uint64_t storedBytes(const std::string& name) const;
  /// One whole entry, its checksum compared. In: limit, bytes; a larger entry is kFormat before
  /// anything is allocated.
  std::vector<uint8_t> read(const std::string& name, uint64_t limit) const;

 private:
  struct Entry {
    bool deflated = false;
    uint32_t checksum = 0;
    uint64_t stored_bytes = 0;
    uint64_t whole_bytes = 0;
    uint64_t header = 0;  ///< offset of the entry's own header
  };

  [[noreturn]] void failHere(const std::string& what) const;
  const Entry& find(const std::string& name) const;
  void readDirectory();

  const InputFile& file_;
  uint64_t directory_ = 0;  ///< offset; entries lie before it
  std::map<std::string, Entry> entries_;
};

/// Writes a zip archive of stored entries, for data that is compressed already. The same entries
/// give the same bytes: no dates.
class ZipWriter {
 public:
  /// In: alignment, of the entries' bytes in the file.
  explicit ZipWriter(OutputFile& file, uint64_t alignment = 1)
      : file_(file), alignment_(alignment) {}
  void add(const std::string& name, const std::vector<uint8_t>& bytes);
  /// Writes the directory; the file is whole then.
  void finish();

 private:
  OutputFile& file_;
  uint64_t alignment_;
  uint64_t offset_ = 0;
  uint32_t count_ = 0;
  std::string directory_;
};

}  // namespace stipple
