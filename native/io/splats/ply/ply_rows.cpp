#include "io/splats/ply/ply_rows.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/number_reading.h"
#include "math/half_float.h"

namespace stipple {

namespace {

constexpr size_t kWindowBytes = size_t{1} << 20;
// A line of a splat file holds about 800 characters; this bounds what a file without line ends
// costs.
constexpr size_t kMaxLineBytes = size_t{1} << 26;

template <typename T>
T swapBytes(T value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  std::reverse(bytes, bytes + sizeof(T));
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

template <typename T>
T load(const char* bytes, bool swap) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return swap ? swapBytes(value) : value;
}

struct Half {
  uint16_t bits;
};

float asFloat(Half value) {
  return halfToFloat(value.bits);
}
float asFloat(double value) {
  // Outside the range of float the conversion is undefined; infinity is refused later, by name.
  if (std::abs(value) > static_cast<double>(std::numeric_limits<float>::max())) {
    return std::copysign(std::numeric_limits<float>::infinity(), value > 0 ? 1.0f : -1.0f);
  }
  return static_cast<float>(value);
}
template <typename T>
float asFloat(T value) {
  return static_cast<float>(value);
}

template <typename T>
void extract(const char* rows, size_t stride, size_t count, bool swap, float* out,
             size_t out_stride) {
  if (swap) {
    for (size_t i = 0; i < count; ++i) {
      out[i * out_stride] = asFloat(load<T>(rows + i * stride, true));
    }
  } else {
    for (size_t i = 0; i < count; ++i) {
      out[i * out_stride] = asFloat(load<T>(rows + i * stride, false));
    }
  }
}

/// The length of a list; negative lengths are -1.
int64_t loadCount(const char* bytes, PlyType type, bool swap) {
  switch (type) {
    case PlyType::kInt8:
      return std::max<int64_t>(-1, load<int8_t>(bytes, swap));
    case PlyType::kUint8:
      return load<uint8_t>(bytes, swap);
    case PlyType::kInt16:
      return std::max<int64_t>(-1, load<int16_t>(bytes, swap));
    case PlyType::kUint16:
      return load<uint16_t>(bytes, swap);
    case PlyType::kInt32:
      return std::max<int64_t>(-1, load<int32_t>(bytes, swap));
    default:
      return load<uint32_t>(bytes, swap);
  }
}

/// Next word of a line, or an empty range.
std::pair<const char*, const char*> nextWord(const char*& cursor, const char* end) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (cursor != end && blank(*cursor)) ++cursor;
  const char* begin = cursor;
  while (cursor != end && !blank(*cursor)) ++cursor;
  return {begin, cursor};
}

bool isBlank(const char* begin, const char* end) {
  const auto [word, stop] = nextWord(begin, end);
  return word == stop;
}

bool parseNumber(const char* begin, const char* end, double* value) {
  if (begin != end && *begin == '+') ++begin;
  const auto [stop, error] = readNumber(begin, end, *value);
  if (error == std::errc::result_out_of_range && stop == end) {
    // from_chars does not tell overflow from underflow; strtod does.
    *value = std::strtod(std::string(begin, end).c_str(), nullptr);
    return true;
  }
  return error == std::errc() && stop == end && begin != end;
}

}  // namespace

PlyRowReader::PlyRowReader(const InputFile& file, const PlyHeader& header)
    : file_(file), encoding_(header.encoding), window_offset_(header.data_offset) {}

PlyRowLayout PlyRowReader::layout(const PlyElement& element) const {
  PlyRowLayout layout;
  const bool ascii = encoding_ == PlyEncoding::kAscii;
  const bool file_is_little = encoding_ != PlyEncoding::kBigEndian;
  const bool machine_is_little = std::endian::native == std::endian::little;
  for (const PlyProperty& property : element.properties) {
    PlyColumn column;
    column.offset = layout.stride;
    column.type = ascii ? PlyType::kFloat64 : property.type;
    column.swap = !ascii && file_is_little != machine_is_little;
    layout.columns.push_back(column);
    if (!property.is_list) layout.stride += plyTypeSize(column.type);
  }
  return layout;
}

void PlyRowReader::skip(const PlyElement& element) {
  if (element.properties.empty()) return;
  const PlyRowLayout rows = layout(element);
  if (encoding_ != PlyEncoding::kAscii && !element.hasList()) {
    skipBytes(element.count * rows.stride);
    return;
  }
  std::vector<char> row(rows.stride);
  for (uint64_t i = 0; i < element.count; ++i) read(element, rows, 1, row.data());
  row_index_ = 0;
}

void PlyRowReader::read(const PlyElement& element, const PlyRowLayout& layout, size_t count,
                        char* rows) {
  for (size_t i = 0; i < count; ++i, ++row_index_) {
    if (encoding_ == PlyEncoding::kAscii) {
      readTextRow(element, layout, rows + i * layout.stride);
    } else {
      readBinaryRow(element, layout, rows + i * layout.stride);
    }
  }
}

void PlyRowReader::readBinaryRow(const PlyElement& element, const PlyRowLayout& layout, char* row) {
  for (size_t p = 0; p < element.properties.size(); ++p) {
    const PlyProperty& property = element.properties[p];
    if (!property.is_list) {
      const size_t bytes = plyTypeSize(property.type);
      std::memcpy(row + layout.columns[p].offset, take(bytes), bytes);
      continue;
    }
    const int64_t length = loadCount(take(plyTypeSize(property.count_type)), property.count_type,
                                     layout.columns[p].swap);
    const uint64_t bytes =
        static_cast<uint64_t>(std::max<int64_t>(length, 0)) * plyTypeSize(property.type);
    if (length < 0 || bytes > file_.size() - offset()) {
      fail(ErrorCode::kFormat, file_.path() + " is damaged: list '" + property.name + "' of " +
                                   element.name + " " + std::to_string(row_index_) + " claims " +
                                   std::to_string(length) + " values; " +
                                   std::to_string(file_.size() - offset()) + " bytes are left");
    }
    skipBytes(bytes);
  }
}

void PlyRowReader::readTextRow(const PlyElement& element, const PlyRowLayout& layout, char* row) {
  do {
    if (!nextLine()) {
      fail(ErrorCode::kFormat, file_.path() + " is truncated: it ends before " + element.name +
                                   " " + std::to_string(row_index_) + " of " +
                                   std::to_string(element.count));
    }
  } while (isBlank(line_begin_, line_end_));
  const char* cursor = line_begin_;
  const auto number = [&](const PlyProperty& property) {
    const auto [begin, end] = nextWord(cursor, line_end_);
    double value = 0;
    if (begin == end || !parseNumber(begin, end, &value)) {
      const std::string word = std::string(begin, end).substr(0, 40);
      fail(ErrorCode::kFormat, file_.path() + ": " + element.name + " " +
                                   std::to_string(row_index_) + " has the value '" + word +
                                   "' for property '" + property.name + "'; a number is expected");
    }
    return value;
  };
  for (size_t p = 0; p < element.properties.size(); ++p) {
    const PlyProperty& property = element.properties[p];
    const double value = number(property);
    if (property.is_list) {
      // Each value needs a character at least, which bounds the loop by the line.
      for (double k = 0; k < value; ++k) number(property);
    } else {
      std::memcpy(row + layout.columns[p].offset, &value, sizeof(value));
    }
  }
}

const char* PlyRowReader::take(size_t count) {
  if (window_.size() - position_ < count) {
    window_offset_ += position_;
    const uint64_t left = file_.size() - window_offset_;
    const size_t bytes =
        static_cast<size_t>(std::min<uint64_t>(left, std::max(kWindowBytes, count)));
    if (bytes < count) {
      fail(ErrorCode::kFormat, file_.path() + " is truncated: row " + std::to_string(row_index_) +
                                   " needs " + std::to_string(count) + " more bytes, " +
                                   std::to_string(bytes) + " are left");
    }
    window_.resize(bytes);
    position_ = 0;
    file_.readAt(window_offset_, window_.data(), bytes);
  }
  const char* bytes = window_.data() + position_;
  position_ += count;
  return bytes;
}

void PlyRowReader::skipBytes(uint64_t count) {
  if (count <= window_.size() - position_) {
    position_ += static_cast<size_t>(count);
    return;
  }
  window_offset_ += position_ + count;
  window_.clear();
  position_ = 0;
}

bool PlyRowReader::nextLine() {
  size_t searched = position_;
  for (;;) {
    const auto begin = window_.begin() + static_cast<std::ptrdiff_t>(searched);
    const auto found = std::find(begin, window_.end(), '\n');
    const uint64_t window_end = window_offset_ + window_.size();
    if (found != window_.end() || window_end == file_.size()) {
      const auto stop = static_cast<size_t>(found - window_.begin());
      if (found == window_.end() && position_ == window_.size()) return false;
      line_begin_ = window_.data() + position_;
      line_end_ = window_.data() + stop;
      position_ = found == window_.end() ? stop : stop + 1;
      return true;
    }
    // Keep the unfinished line, append the next window.
    window_.erase(window_.begin(), window_.begin() + static_cast<std::ptrdiff_t>(position_));
    window_offset_ += position_;
    position_ = 0;
    searched = window_.size();
    if (searched > kMaxLineBytes) {
      fail(ErrorCode::kFormat, file_.path() + " is damaged: a line is longer than " +
                                   std::to_string(kMaxLineBytes) + " bytes");
    }
    const size_t more = static_cast<size_t>(
        std::min<uint64_t>(file_.size() - window_offset_ - searched, kWindowBytes));
    window_.resize(searched + more);
    file_.readAt(window_offset_ + searched, window_.data() + searched, more);
  }
}

void extractPlyColumn(const char* rows, size_t stride, size_t count, const PlyColumn& column,
                      float* out, size_t out_stride) {
  const char* first = rows + column.offset;
  switch (column.type) {
    case PlyType::kInt8:
      return extract<int8_t>(first, stride, count, column.swap, out, out_stride);
    case PlyType::kUint8:
      return extract<uint8_t>(first, stride, count, column.swap, out, out_stride);
    case PlyType::kInt16:
      return extract<int16_t>(first, stride, count, column.swap, out, out_stride);
    case PlyType::kUint16:
      return extract<uint16_t>(first, stride, count, column.swap, out, out_stride);
    case PlyType::kInt32:
      return extract<int32_t>(first, stride, count, column.swap, out, out_stride);
    case PlyType::kUint32:
      return extract<uint32_t>(first, stride, count, column.swap, out, out_stride);
    case PlyType::kFloat16:
      return extract<Half>(first, stride, count, column.swap, out, out_stride);
    case PlyType::kFloat32:
      return extract<float>(first, stride, count, column.swap, out, out_stride);
    case PlyType::kFloat64:
      return extract<double>(first, stride, count, column.swap, out, out_stride);
  }
}

}  // namespace stipple
