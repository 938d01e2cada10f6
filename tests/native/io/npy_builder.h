#pragma once

#include <bit>
#include <string>
#include <vector>

#include "byte_text.h"

namespace stipple {

/// A .npy file with this dictionary as its header, padded to 64 bytes as NumPy does, and these
/// bytes.
inline std::string npyFile(const std::string& header, const std::string& values,
                           unsigned version = 1) {
  ByteText file;
  file.text("\x93NUMPY").u8(version).u8(0);
  const size_t begin = version == 1 ? 10 : 12;
  std::string padded = header;
  while ((begin + padded.size() + 1) % 64 != 0) padded += ' ';
  padded += '\n';
  (version == 1 ? file.u16(padded.size()) : file.u32(padded.size())).text(padded).text(values);
  return file.bytes;
}

inline std::string npyHeader(const std::string& type, bool is_fortran, const std::string& shape) {
  return "{'descr': '" + type + "', 'fortran_order': " + (is_fortran ? "True" : "False") +
         ", 'shape': " + shape + ", }";
}

inline std::string doubles(const std::vector<double>& values) {
  ByteText bytes;
  for (const double value : values) bytes.u64(std::bit_cast<uint64_t>(value));
  return bytes.bytes;
}

inline std::string floats(const std::vector<float>& values) {
  ByteText bytes;
  for (const float value : values) bytes.f32(value);
  return bytes.bytes;
}

/// A row of poses_bounds.npy: a camera at (x, 0, 4) that looks along -z with y up, as LLFF has it.
inline std::vector<double> poseBoundsRow(double x, double height, double width, double focal) {
  // Columns: down (0, -1, 0), right (1, 0, 0), backwards (0, 0, 1), place, size and focal length.
  return {0, 1, 0, x, height, -1, 0, 0, 0, width, 0, 0, 1, 4, focal, 1, 9};
}

/// The file of `count` cameras side by side.
inline std::string poseBoundsFile(size_t count, double height, double width, double focal) {
  std::vector<double> values;
  for (size_t i = 0; i < count; ++i) {
    const std::vector<double> row = poseBoundsRow(static_cast<double>(i), height, width, focal);
    values.insert(values.end(), row.begin(), row.end());
  }
  return npyFile(npyHeader("<f8", false, "(" + std::to_string(count) + ", 17)"), doubles(values));
}

}  // namespace stipple
