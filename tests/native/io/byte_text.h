#pragma once

#include <bit>
#include <cstdint>
#include <string>

namespace stipple {

/// Bytes of a file put together by hand, little-endian, independent of the writers.
struct ByteText {
  std::string bytes;

  ByteText& u8(unsigned value) {
    bytes.push_back(static_cast<char>(static_cast<uint8_t>(value)));
    return *this;
  }
  ByteText& number(uint64_t value, int size) {
    for (int i = 0; i < size; ++i) u8(static_cast<unsigned>(value >> (8 * i) & 255));
    return *this;
  }
  ByteText& u16(uint64_t value) { return number(value, 2); }
  ByteText& u24(uint64_t value) { return number(value, 3); }
  ByteText& u32(uint64_t value) { return number(value, 4); }
  ByteText& u64(uint64_t value) { return number(value, 8); }
  ByteText& f32(float value) { return u32(std::bit_cast<uint32_t>(value)); }
  ByteText& text(const std::string& more) {
    bytes += more;
    return *this;
  }
  ByteText& zeros(size_t count) {
    bytes.append(count, '\0');
    return *this;
  }
};

/// A gzip file of one block that is stored as it is.
inline std::string storedGzip(const std::string& plain) {
  uint32_t crc = 0xffffffffu;
  for (const char c : plain) {
    crc ^= static_cast<uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ ((crc & 1) != 0 ? 0xedb88320u : 0u);
  }
  ByteText file;
  file.text("\x1f\x8b\x08").zeros(6).u8(255);
  file.u8(1).u16(plain.size()).u16(~plain.size()).text(plain);
  file.u32(~crc).u32(plain.size());
  return file.bytes;
}

/// A Zstandard frame of one raw block.
inline std::string storedZstd(const std::string& plain) {
  ByteText file;
  // One segment, content size of 4 bytes; the block is the last, of type raw.
  file.u32(0xfd2fb528u).u8(0xa0).u32(plain.size()).u24(plain.size() << 3 | 1).text(plain);
  return file.bytes;
}

}  // namespace stipple
