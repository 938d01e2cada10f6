#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stipple {

/// Numbers of a .npy file, the last index fastest whatever the order of the file.
struct NpyArray {
  std::vector<uint64_t> shape;  ///< empty: one number
  std::vector<double> values;
};

/// Reads an array of little-endian floats (`<f8`, `<f4`), in rows or in Fortran's order, of the
/// versions 1 to 3 of the format. Objects (pickles) and other types are refused. Errors: kIo;
/// kFormat for a file that is no such array, whose header is damaged, or whose shape is not of its
/// size; kUnsupported for other types, with their name.
NpyArray readNpyArray(const std::string& path);

}  // namespace stipple
