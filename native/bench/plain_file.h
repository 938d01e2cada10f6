#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "data/clouds/splat_cloud.h"

namespace stipple::bench {

// What any program that reads or writes these bytes has to do, as a floor for readers and writers.

/// Bytes from operator new, which nobody has zeroed before.
class PlainBytes {
 public:
  explicit PlainBytes(size_t size)
      : bytes_(std::make_unique_for_overwrite<char[]>(size)), size_(size) {}
  size_t size() const { return size_; }
  char* data() { return bytes_.get(); }
  const char* data() const { return bytes_.get(); }
  const char& operator[](size_t i) const { return bytes_[i]; }

 private:
  std::unique_ptr<char[]> bytes_;
  size_t size_;
};

/// The whole file by one fread.
PlainBytes readPlainly(const std::string& path);

/// One fwrite under a temporary name in the same folder, fsync and a rename, as our writers promise
/// that a failure leaves the old file.
void writePlainly(const std::string& path, const PlainBytes& bytes);

/// Copies all arrays to fresh memory, on one thread.
void copyArrays(const SplatCloud& cloud);

}  // namespace stipple::bench
