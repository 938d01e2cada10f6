#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/number_reading.h"
#include "io/bytes/input_file.h"

namespace stipple {

/// Bytes of a file one after the other, through a buffer; every read says what it is for.
class ColmapBytes {
 public:
  explicit ColmapBytes(const std::string& path) : file_(path) {}

  const std::string& path() const { return file_.path(); }
  uint64_t offset() const { return offset_; }
  uint64_t left() const { return file_.size() - offset_; }

  template <typename T>
  T take(const char* what) {
    T value;
    require(sizeof(T), what);
    if (offset_ < buffer_start_ || offset_ + sizeof(T) > buffer_start_ + buffer_.size()) refill();
    std::memcpy(&value, buffer_.data() + (offset_ - buffer_start_), sizeof(T));
    offset_ += sizeof(T);
    return value;
  }

  void skip(uint64_t bytes, const char* what) {
    require(bytes, what);
    offset_ += bytes;
  }

  void require(uint64_t bytes, const char* what) const {
    if (bytes > left()) {
      fail(ErrorCode::kFormat, path() + " ends at byte " + std::to_string(file_.size()) + ": " +
                                   what + " from byte " + std::to_string(offset_) + " needs " +
                                   std::to_string(bytes) + " bytes");
    }
  }

 private:
  void refill() {
    buffer_.resize(static_cast<size_t>(std::min<uint64_t>(left(), 1 << 16)));
    buffer_start_ = offset_;
    file_.readAt(offset_, buffer_.data(), buffer_.size());
  }

  InputFile file_;
  uint64_t offset_ = 0;
  uint64_t buffer_start_ = 0;
  std::vector<char> buffer_;
};

/// Lines of a text file, and the words of the current one. The file goes through a buffer: lists of
/// the points of ten thousand pictures take gigabytes.
class ColmapLines {
 public:
  explicit ColmapLines(const std::string& path) : file_(path) {}

  /// Goes to the next line; with `content`, past comments and empty ones. False at the end.
  /// Errors: kFormat for a line above 1 GiB.
  bool next(bool content);

  bool atEnd() const { return line_.empty(); }
  std::string_view rest() const { return line_; }
  std::string_view word();

  template <typename T>
  T number(const char* what) {
    const std::string_view text = word();
    T value{};
    const auto [end, error] = readNumber(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) {
      failHere(std::string("has '") + std::string(text.substr(0, 40)) + "' as " + what +
               "; a number is needed");
    }
    return value;
  }

  [[noreturn]] void failHere(const std::string& what) const;

 private:
  void skipSpaces() { line_.remove_prefix(std::min(line_.find_first_not_of(" \t"), line_.size())); }

  InputFile file_;
  uint64_t read_ = 0;    ///< bytes of the file that have come into the window
  std::string window_;   ///< from the current line on
  size_t position_ = 0;  ///< of the next line, in the window
  size_t number_ = 0;
  std::string_view line_;
};

}  // namespace stipple
