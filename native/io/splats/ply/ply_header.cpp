#include "io/splats/ply/ply_header.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include "base/error.h"

namespace stipple {

namespace {

// A header of a splat file holds about 1.5 KB; a megabyte leaves room for long comments.
constexpr size_t kMaxHeaderBytes = size_t{1} << 20;

std::optional<PlyType> typeFromName(const std::string& name) {
  static const std::pair<const char*, PlyType> kNames[] = {
      {"char", PlyType::kInt8},      {"int8", PlyType::kInt8},
      {"uchar", PlyType::kUint8},    {"uint8", PlyType::kUint8},
      {"short", PlyType::kInt16},    {"int16", PlyType::kInt16},
      {"ushort", PlyType::kUint16},  {"uint16", PlyType::kUint16},
      {"int", PlyType::kInt32},      {"int32", PlyType::kInt32},
      {"uint", PlyType::kUint32},    {"uint32", PlyType::kUint32},
      {"half", PlyType::kFloat16},   {"float16", PlyType::kFloat16},
      {"float", PlyType::kFloat32},  {"float32", PlyType::kFloat32},
      {"double", PlyType::kFloat64}, {"float64", PlyType::kFloat64}};
  for (const auto& [known, type] : kNames) {
    if (name == known) return type;
  }
  return std::nullopt;
}

/// What a message may show of a file's own text: printable, short.
std::string inQuotes(std::string_view text) {
  std::string shown = "'";
  for (const char c : text.substr(0, 60)) shown += c >= 32 && c < 127 ? c : '?';
  return shown + (text.size() > 60 ? "...'" : "'");
}

class HeaderParser {
 public:
  explicit HeaderParser(const InputFile& file) : file_(file) {
    text_.resize(static_cast<size_t>(std::min<uint64_t>(file.size(), kMaxHeaderBytes)));
    file.readAt(0, text_.data(), text_.size());
  }

  PlyHeader parse() {
    if (file_.size() == 0) failHere("the file is empty; a PLY file starts with 'ply'");
    if (text_.rfind("ply\n", 0) != 0 && text_.rfind("ply\r\n", 0) != 0) {
      failHere("it starts with " + inQuotes(std::string_view(text_).substr(0, 8)) +
               "; a PLY file starts with a line 'ply'");
    }
    nextLine();
    bool has_format = false;
    for (;;) {
      const std::string line = nextLine();
      std::istringstream words(line);
      std::string keyword;
      words >> keyword;
      if (keyword == "end_header") break;
      if (keyword.empty() || keyword == "obj_info") continue;
      if (keyword == "comment") {
        header_.comments.push_back(line.size() > 8 ? line.substr(8) : std::string());
      } else if (keyword == "format") {
        parseFormat(words, line);
        has_format = true;
      } else if (keyword == "element") {
        parseElement(words, line);
      } else if (keyword == "property") {
        parseProperty(words, line);
      } else {
        failHere("line " + lineName() + " is " + inQuotes(line) +
                 "; format, comment, element, property or end_header is expected");
      }
    }
    if (!has_format) failHere("the header has no line 'format'");
    header_.data_offset = position_;
    return std::move(header_);
  }

 private:
  [[noreturn]] void failHere(const std::string& what) const {
    fail(ErrorCode::kFormat, file_.path() + " is not a valid PLY file: " + what);
  }

  std::string lineName() const { return std::to_string(line_); }

  std::string nextLine() {
    const size_t end = text_.find('\n', position_);
    if (end == std::string::npos) {
      failHere(text_.size() < kMaxHeaderBytes
                   ? "it ends in its header (after line " + lineName() + ", without end_header)"
                   : "its header is longer than " + std::to_string(kMaxHeaderBytes) + " bytes");
    }
    std::string line = text_.substr(position_, end - position_);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    position_ = end + 1;
    ++line_;
    return line;
  }

  void parseFormat(std::istringstream& words, const std::string& line) {
    std::string encoding;
    words >> encoding;
    if (encoding == "ascii") {
      header_.encoding = PlyEncoding::kAscii;
    } else if (encoding == "binary_little_endian") {
      header_.encoding = PlyEncoding::kLittleEndian;
    } else if (encoding == "binary_big_endian") {
      header_.encoding = PlyEncoding::kBigEndian;
    } else {
      failHere("line " + lineName() + " is " + inQuotes(line) +
               "; ascii, binary_little_endian or binary_big_endian is expected");
    }
  }

  void parseElement(std::istringstream& words, const std::string& line) {
    PlyElement element;
    std::string count;
    words >> element.name >> count;
    const char* end = count.data() + count.size();
    const auto [stop, error] = std::from_chars(count.data(), end, element.count);
    if (error != std::errc() || stop != end || count.empty()) {
      failHere("line " + lineName() + " is " + inQuotes(line) +
               "; 'element NAME COUNT' with a whole number is expected");
    }
    header_.elements.push_back(std::move(element));
  }

  void parseProperty(std::istringstream& words, const std::string& line) {
    if (header_.elements.empty()) failHere("a property stands before the first element");
    PlyProperty property;
    std::string type_name;
    words >> type_name;
    property.is_list = type_name == "list";
    std::optional<PlyType> count_type = PlyType::kUint8;
    if (property.is_list) {
      std::string count_name;
      words >> count_name >> type_name;
      count_type = typeFromName(count_name);
    }
    const std::optional<PlyType> type = typeFromName(type_name);
    words >> property.name;
    const bool whole_count =
        count_type && *count_type <= PlyType::kUint32;  // a list's length is a whole number
    if (!type || !whole_count || property.name.empty()) {
      failHere("line " + lineName() + " is " + inQuotes(line) +
               "; 'property TYPE NAME' or 'property list TYPE TYPE NAME' is expected");
    }
    property.type = *type;
    property.count_type = *count_type;
    for (const PlyProperty& other : header_.elements.back().properties) {
      if (other.name == property.name) {
        failHere("property " + inQuotes(property.name) + " stands twice");
      }
    }
    header_.elements.back().properties.push_back(std::move(property));
  }

  const InputFile& file_;
  std::string text_;
  size_t position_ = 0;
  size_t line_ = 0;
  PlyHeader header_;
};

/// A lying count is refused before anything is allocated for it.
void requireRoom(const InputFile& file, const PlyHeader& header) {
  const bool ascii = header.encoding == PlyEncoding::kAscii;
  uint64_t room = file.size() - header.data_offset;
  for (const PlyElement& element : header.elements) {
    // As text a value needs a digit and a separator; the very last separator may be missing.
    const uint64_t row = ascii ? element.properties.size() * 2 : element.leastRowBytes();
    if (row == 0) continue;
    const uint64_t possible = (room + (ascii ? 1 : 0)) / row;
    if (element.count > possible) {
      fail(ErrorCode::kFormat, file.path() + " claims " + std::to_string(element.count) + " of '" +
                                   element.name + "', but its " + std::to_string(room) +
                                   " bytes of data have room for at most " +
                                   std::to_string(possible));
    }
    room -= std::min(room, element.count * row);
  }
}

}  // namespace

size_t plyTypeSize(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
    case PlyType::kFloat16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 0;
}

bool PlyElement::hasList() const {
  return std::any_of(properties.begin(), properties.end(),
                     [](const PlyProperty& property) { return property.is_list; });
}

size_t PlyElement::leastRowBytes() const {
  size_t bytes = 0;
  for (const PlyProperty& property : properties) {
    bytes += plyTypeSize(property.is_list ? property.count_type : property.type);
  }
  return bytes;
}

PlyHeader readPlyHeader(const InputFile& file) {
  PlyHeader header = HeaderParser(file).parse();
  requireRoom(file, header);
  return header;
}

}  // namespace stipple
