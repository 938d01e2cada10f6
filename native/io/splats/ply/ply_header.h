#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/bytes/input_file.h"

namespace stipple {

enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };

enum class PlyType {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kFloat16,
  kFloat32,
  kFloat64
};

size_t plyTypeSize(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;  ///< of the value, or of a list's elements
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  ///< lists only
};

struct PlyElement {
  std::string name;
  uint64_t count = 0;
  std::vector<PlyProperty> properties;

  bool hasList() const;
  /// Bytes of one row in a binary file, lists taken as empty: the least that a row can occupy.
  size_t leastRowBytes() const;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kLittleEndian;
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  ///< without the word "comment"
  uint64_t data_offset = 0;           ///< first byte after the line end_header
};

/// Reads the header and refuses counts that the rest of the file cannot hold.
/// Errors: kFormat with the line and what was expected.
PlyHeader readPlyHeader(const InputFile& file);

}  // namespace stipple
