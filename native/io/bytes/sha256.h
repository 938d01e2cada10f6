#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "base/progress.h"

namespace stipple {

/// SHA-256 (FIPS 180-4) of bytes that are added piece by piece.
class Sha256 {
 public:
  void add(const void* bytes, size_t count);
  /// 64 hexadecimal digits of all that was added. Nothing may be added afterwards.
  std::string finish();

 private:
  static constexpr size_t kBlock = 64;

  void addBlock(const uint8_t* bytes);

  std::array<uint32_t, 8> state_ = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                    0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<uint8_t, kBlock> rest_ = {};  ///< of an incomplete block
  uint64_t count_ = 0;
};

/// The hash of a file's content. A file that this process has hashed before, and has the same path,
/// size and time, is not read again. In: progress, advanced from 0 to 1 with `stage`, or null.
/// Errors: kIo; kCancelled. Threads: any number of files at a time.
std::string sha256OfFile(const std::string& path, Progress* progress = nullptr,
                         const char* stage = "Checking files");

}  // namespace stipple
