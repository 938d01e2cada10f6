#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "io/bytes/input_file.h"
#include "io/splats/ply/ply_header.h"

namespace stipple {

/// One scalar property inside a packed row.
struct PlyColumn {
  size_t offset = 0;  ///< bytes from the start of the row
  PlyType type = PlyType::kFloat32;
  bool swap = false;  ///< bytes are in the other order than this machine's
};

/// How the scalar properties of an element lie in a packed row; lists take no room.
struct PlyRowLayout {
  size_t stride = 0;
  std::vector<PlyColumn> columns;  ///< as PlyElement::properties; a list's entry is not used
};

/// Rows read in order, from elements of any kind (text, lists), into packed rows. Binary elements
/// without lists need none of this: their rows lie packed in the file, from `offset` on.
class PlyRowReader {
 public:
  PlyRowReader(const InputFile& file, const PlyHeader& header);
  PlyRowLayout layout(const PlyElement& element) const;
  /// Goes past all rows of an element.
  void skip(const PlyElement& element);
  /// Reads `count` rows of the element into rows [count * layout.stride].
  void read(const PlyElement& element, const PlyRowLayout& layout, size_t count, char* rows);
  /// Where the next byte to read lies in the file.
  uint64_t offset() const { return window_offset_ + position_; }

 private:
  void readBinaryRow(const PlyElement& element, const PlyRowLayout& layout, char* row);
  void readTextRow(const PlyElement& element, const PlyRowLayout& layout, char* row);
  const char* take(size_t count);
  void skipBytes(uint64_t count);
  bool nextLine();

  const InputFile& file_;
  PlyEncoding encoding_;
  std::vector<char> window_;
  uint64_t window_offset_ = 0;
  size_t position_ = 0;
  uint64_t row_index_ = 0;
  const char* line_begin_ = nullptr;
  const char* line_end_ = nullptr;
};

/// Copies one column of packed rows into an array of float32.
/// In: rows [count * stride]; out: out[i * out_stride], i < count.
void extractPlyColumn(const char* rows, size_t stride, size_t count, const PlyColumn& column,
                      float* out, size_t out_stride);

}  // namespace stipple
