// Based on: the description of the .npy format in NumPy's documentation (numpy.lib.format).
#include "io/bytes/npy_array.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <string_view>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/little_endian.h"

namespace stipple {

namespace {

constexpr std::string_view kMagic("\x93NUMPY", 6);
/// Magic, version and the longest length of a header.
constexpr uint64_t kMostHeadBytes = 12;
/// NumPy refuses longer headers too, unless it is told that the file is trusted (10,000
/// characters).
constexpr uint64_t kMostHeaderBytes = 65536;
constexpr size_t kMostDimensions = 8;

/// What the dictionary of the header says.
struct Header {
  std::string type;
  bool is_fortran = false;
  std::vector<uint64_t> shape;
};

/// Reads the dictionary, a small part of Python: {'descr': '<f8', 'fortran_order': False,
/// 'shape': (20, 17), }.
class HeaderReader {
 public:
  HeaderReader(const std::string& path, std::string_view text) : path_(path), text_(text) {}

  Header read() {
    Header header;
    bool has_type = false, has_order = false, has_shape = false;
    expect('{');
    while (!take('}')) {
      const std::string key = quoted();
      expect(':');
      if (key == "descr" && !has_type) {
        has_type = true;
        header.type = type();
      } else if (key == "fortran_order" && !has_order) {
        has_order = true;
        header.is_fortran = truth();
      } else if (key == "shape" && !has_shape) {
        has_shape = true;
        header.shape = shape();
      } else {
        refuse("names '" + key.substr(0, 40) +
               "'; descr, fortran_order and shape, each once, are needed");
      }
      if (!take(',')) {
        expect('}');
        break;
      }
    }
    skipSpace();
    if (at_ != text_.size()) refuse("goes on after its end");
    if (!has_type || !has_order || !has_shape) {
      refuse("lacks one of descr, fortran_order and shape");
    }
    return header;
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const {
    fail(ErrorCode::kFormat, path_ + " is a damaged .npy file: its header " + what);
  }

  void skipSpace() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
  }

  bool take(char wanted) {
    skipSpace();
    if (at_ == text_.size() || text_[at_] != wanted) return false;
    ++at_;
    return true;
  }

  void expect(char wanted) {
    if (take(wanted)) return;
    refuse(std::string("has no '") + wanted + "' at byte " + std::to_string(at_));
  }

  bool takeWord(std::string_view word) {
    skipSpace();
    if (text_.substr(at_, word.size()) != word) return false;
    at_ += word.size();
    return true;
  }

  std::string quoted() {
    skipSpace();
    const char quote = at_ < text_.size() ? text_[at_] : '\0';
    if (quote != '\'' && quote != '"') {
      refuse("has no text at byte " + std::to_string(at_));
    }
    const size_t end = text_.find(quote, at_ + 1);
    if (end == std::string_view::npos) refuse("has a text without an end");
    const std::string text(text_.substr(at_ + 1, end - at_ - 1));
    at_ = end + 1;
    return text;
  }

  std::string type() {
    skipSpace();
    // Of structured arrays: a list of fields.
    if (at_ < text_.size() && text_[at_] == '[') {
      fail(ErrorCode::kUnsupported, path_ + " holds records; floats (<f8 or <f4) are needed");
    }
    return quoted();
  }

  bool truth() {
    if (takeWord("True")) return true;
    if (takeWord("False")) return false;
    refuse("has a fortran_order that is neither True nor False");
  }

  uint64_t count() {
    skipSpace();
    const size_t begin = at_;
    uint64_t value = 0;
    while (at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9') {
      const auto digit = static_cast<uint64_t>(text_[at_] - '0');
      if (value > (std::numeric_limits<uint64_t>::max() - digit) / 10) {
        refuse("has a shape beyond all measure");
      }
      value = value * 10 + digit;
      ++at_;
    }
    if (begin == at_) refuse("has a shape that is not of whole numbers");
    return value;
  }

  std::vector<uint64_t> shape() {
    std::vector<uint64_t> shape;
    expect('(');
    while (!take(')')) {
      if (shape.size() == kMostDimensions) {
        refuse("has more than " + std::to_string(kMostDimensions) + " dimensions");
      }
      shape.push_back(count());
      if (!take(',')) {
        expect(')');
        break;
      }
    }
    return shape;
  }

  const std::string& path_;
  std::string_view text_;
  size_t at_ = 0;
};

std::string shapeText(const std::vector<uint64_t>& shape) {
  std::string text;
  for (const uint64_t side : shape) text += (text.empty() ? "" : " x ") + std::to_string(side);
  return text.empty() ? "one number" : text;
}

/// Numbers of the shape, where they take as many bytes as there are.
uint64_t requireSize(const std::string& path, const Header& header, uint64_t number_bytes,
                     uint64_t bytes) {
  bool is_empty = false;
  for (const uint64_t side : header.shape) is_empty = is_empty || side == 0;
  uint64_t count = is_empty ? 0 : 1;
  bool is_too_large = false;
  for (const uint64_t side : header.shape) {
    if (is_empty || is_too_large) break;
    is_too_large = side > bytes / number_bytes / count;
    count *= is_too_large ? 1 : side;
  }
  if (!is_too_large && count * number_bytes == bytes) return count;
  fail(ErrorCode::kFormat, path + " is a damaged .npy file: its header says " +
                               shapeText(header.shape) + " of " + std::to_string(number_bytes) +
                               " bytes each, and " + std::to_string(bytes) + " bytes follow it");
}

/// Values of Fortran's order, in which the first index is fastest, by rows.
std::vector<double> byRows(const std::vector<double>& values, const std::vector<uint64_t>& shape) {
  std::vector<double> rows(values.size());
  std::vector<uint64_t> index(shape.size(), 0);
  for (double& value : rows) {
    uint64_t from = 0;
    for (size_t d = shape.size(); d-- > 0;) from = from * shape[d] + index[d];
    value = values[from];
    for (size_t d = shape.size(); d-- > 0;) {
      if (++index[d] < shape[d]) break;
      index[d] = 0;
    }
  }
  return rows;
}

}  // namespace

NpyArray readNpyArray(const std::string& path) {
  const InputFile file(path);
  uint8_t head[kMostHeadBytes] = {};
  const uint64_t head_bytes = std::min<uint64_t>(file.size(), kMostHeadBytes);
  file.readAt(0, head, static_cast<size_t>(head_bytes));
  if (head_bytes < 10 || std::memcmp(head, kMagic.data(), kMagic.size()) != 0) {
    fail(ErrorCode::kFormat, path + " is not a .npy file: it does not begin as one");
  }
  const uint8_t version = head[6];
  if (version < 1 || version > 3) {
    fail(ErrorCode::kUnsupported, path + " is of version " + std::to_string(version) +
                                      " of the .npy format; 1 to 3 are read");
  }
  const uint64_t begin = version == 1 ? 10 : 12;
  const uint64_t length =
      version == 1 ? loadLittleEndian<uint16_t>(head + 8) : loadLittleEndian<uint32_t>(head + 8);
  if (begin > file.size() || length > file.size() - begin || length > kMostHeaderBytes) {
    fail(ErrorCode::kFormat, path + " is a damaged .npy file: its header is said to have " +
                                 std::to_string(length) + " bytes; the file has " +
                                 std::to_string(file.size()) + ", and " +
                                 std::to_string(kMostHeaderBytes) + " are allowed");
  }
  std::string text(static_cast<size_t>(length), '\0');
  file.readAt(begin, text.data(), text.size());
  const Header header = HeaderReader(path, text).read();
  const bool is_double = header.type == "<f8";
  if (!is_double && header.type != "<f4") {
    fail(ErrorCode::kUnsupported, path + " holds numbers of the type '" +
                                      header.type.substr(0, 40) + "'; <f8 and <f4 are read");
  }
  const uint64_t number_bytes = is_double ? 8 : 4;
  const uint64_t count = requireSize(path, header, number_bytes, file.size() - begin - length);
  std::vector<uint8_t> bytes(static_cast<size_t>(count * number_bytes));
  file.readAt(begin + length, bytes.data(), bytes.size());
  NpyArray array;
  array.values.resize(static_cast<size_t>(count));
  for (size_t i = 0; i < array.values.size(); ++i) {
    const uint8_t* at = &bytes[i * number_bytes];
    array.values[i] = is_double ? std::bit_cast<double>(loadLittleEndian<uint64_t>(at))
                                : static_cast<double>(loadFloat(at));
  }
  if (header.is_fortran) array.values = byRows(array.values, header.shape);
  array.shape = header.shape;
  return array;
}

}  // namespace stipple
