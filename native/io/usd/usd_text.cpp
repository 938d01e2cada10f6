// Based on: Pixar, OpenUSD documentation, "The USDA file format", version 1.0.
#include "io/usd/usd_text.h"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <utility>

#include "base/error.h"
#include "base/number_reading.h"

namespace stipple {

namespace {

constexpr std::string_view kHead = "#usda 1.";
constexpr int kMaxDepth = 200;  ///< of prims and dictionaries in each other
constexpr size_t kMatrixSide = 4;

enum class Kind { kNumber, kMatrix, kWord, kOther };

struct Type {
  Kind kind = Kind::kOther;
  size_t width = 1;  ///< numbers of an element
};

/// What the values of a type look like. In: its name without brackets.
Type typeOf(std::string_view name) {
  if (name == "token" || name == "string" || name == "bool") return {Kind::kWord, 1};
  if (name == "matrix4d") return {Kind::kMatrix, kMatrixSide * kMatrixSide};
  for (const std::string_view number : {"float", "double", "half", "int", "uint", "int64"}) {
    if (name == number) return {Kind::kNumber, 1};
  }
  if (name == "quatf" || name == "quatd" || name == "quath") return {Kind::kNumber, 4};
  for (const std::string_view tuple :
       {"float", "double", "half", "int", "point", "vector", "normal", "color", "texCoord"}) {
    if (!name.starts_with(tuple) || name.size() == tuple.size()) continue;
    const std::string_view rest = name.substr(tuple.size());
    const bool has_letter =
        rest.size() == 2 && (rest[1] == 'f' || rest[1] == 'd' || rest[1] == 'h');
    if (rest[0] >= '2' && rest[0] <= '4' && (rest.size() == 1 || has_letter)) {
      return {Kind::kNumber, static_cast<size_t>(rest[0] - '0')};
    }
  }
  return {};
}

bool isOneOf(std::string_view word, std::initializer_list<std::string_view> words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

class Parser {
 public:
  Parser(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  UsdLayer layer() {
    if (!text_.starts_with(kHead)) failHere("'#usda 1.0' at the beginning");
    UsdLayer layer;
    if (next() == '(') layerMetadata(layer);
    while (next() != '\0') {
      const std::string word = takeWord("def, over or class");
      if (word == "reorder") {
        takeWord("a name");
        skipAssigned();
      } else {
        addPrim(layer.root, word, 0);
      }
    }
    return layer;
  }

 private:
  [[noreturn]] void failHere(const std::string& expected) const {
    const auto here = text_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, text_.size()));
    const auto line = std::count(text_.begin(), here, '\n') + 1;
    std::string seen(text_.substr(std::min(at_, text_.size()), 20));
    seen = seen.substr(0, seen.find('\n'));
    for (char& letter : seen) {
      if (static_cast<unsigned char>(letter) < 32 || letter == 127) letter = '?';
    }
    std::string message = name_;
    message.append(" is not a valid USD layer of text: line ").append(std::to_string(line));
    if (at_ >= text_.size()) {
      message += " has its end where ";
    } else {
      message.append(" has '").append(seen).append("' where ");
    }
    fail(ErrorCode::kFormat, message.append(expected).append(" is expected"));
  }

  /// The next character that is neither blank nor comment, which stays; 0 at the end.
  char next() {
    while (at_ < text_.size()) {
      const char letter = text_[at_];
      if (letter == '#' || text_.substr(at_, 2) == "//") {
        at_ = std::min(text_.find('\n', at_), text_.size());
      } else if (text_.substr(at_, 2) == "/*") {
        const size_t end = text_.find("*/", at_ + 2);
        at_ = end == text_.npos ? text_.size() : end + 2;
      } else if (letter == ' ' || letter == '\t' || letter == '\n' || letter == '\r' ||
                 letter == ';') {
        ++at_;
      } else {
        return letter;
      }
    }
    return '\0';
  }

  bool take(char letter) {
    if (next() != letter) return false;
    ++at_;
    return true;
  }

  void require(char letter) {
    if (!take(letter)) failHere(std::string("'").append(1, letter).append(1, '\''));
  }

  static bool isOfWord(char letter) {
    const auto byte = static_cast<unsigned char>(letter);
    return std::isalnum(byte) != 0 || byte >= 128 || letter == '_' || letter == ':' ||
           letter == '.';
  }

  std::string takeWord(const char* expected) {
    next();
    const size_t begin = at_;
    while (at_ < text_.size() && isOfWord(text_[at_])) ++at_;
    if (at_ == begin) failHere(expected);
    return std::string(text_.substr(begin, at_ - begin));
  }

  template <typename Number>
  Number takeNumber() {
    next();
    Number value = 0;
    const char* begin = text_.data() + at_;
    const auto [end, error] = readNumber(begin, text_.data() + text_.size(), value);
    if (error == std::errc::result_out_of_range) failHere("a number that fits its type");
    if (error != std::errc()) failHere("a number");
    at_ += static_cast<size_t>(end - begin);
    return value;
  }

  std::string takeString() {
    const char quote = next();
    if (quote != '"' && quote != '\'') failHere("a string");
    const std::string three(3, quote);
    const bool is_long = text_.substr(at_, 3) == three;
    const std::string end = is_long ? three : three.substr(0, 1);
    at_ += end.size();
    std::string content;
    while (text_.substr(at_, end.size()) != end) {
      if (at_ >= text_.size() || (!is_long && text_[at_] == '\n')) failHere("the end of a string");
      if (text_[at_] == '\\' && at_ + 1 < text_.size()) ++at_;
      content.push_back(text_[at_++]);
    }
    at_ += end.size();
    return content;
  }

  /// What stands between @ and @, or @@@ and @@@.
  std::string takeAsset() {
    const std::string mark = text_.substr(at_, 3) == "@@@" ? "@@@" : "@";
    at_ += mark.size();
    const size_t end = text_.find(mark, at_);
    if (end == text_.npos) failHere("the end of an asset path");
    std::string path(text_.substr(at_, end - at_));
    at_ = end + mark.size();
    return path;
  }

  std::string takePath() {
    require('<');
    const size_t end = text_.find('>', at_);
    if (end == text_.npos) failHere("the end of a path");
    std::string path(text_.substr(at_, end - at_));
    at_ = end + 1;
    return path;
  }

  /// One value of any type, with all that it holds.
  void skipValue() {
    size_t depth = 0;
    do {
      const char letter = next();
      if (letter == '"' || letter == '\'') {
        takeString();
      } else if (letter == '@') {
        takeAsset();
      } else if (letter == '<') {
        takePath();
      } else if (letter == '(' || letter == '[' || letter == '{') {
        ++depth;
        ++at_;
      } else if (letter == ')' || letter == ']' || letter == '}') {
        if (depth == 0) failHere("a value");
        --depth;
        ++at_;
      } else if (letter == '\0') {
        failHere("a value");
      } else if (isOfWord(letter) || letter == '-' || letter == '+') {
        while (at_ < text_.size() &&
               (isOfWord(text_[at_]) || text_[at_] == '-' || text_[at_] == '+')) {
          ++at_;
        }
      } else if (depth > 0) {
        ++at_;
      } else {
        failHere("a value");
      }
    } while (depth > 0);
  }

  void skipAssigned() {
    require('=');
    skipValue();
  }

  /// The numbers of one element, in as many brackets as its type has. In: put, called for each.
  template <typename Number, typename Put>
  void takeElement(const Type& type, const Put& put) {
    if (type.width == 1) return put(takeNumber<Number>());
    const size_t rows = type.kind == Kind::kMatrix ? kMatrixSide : 1;
    if (rows > 1) require('(');
    for (size_t row = 0; row < rows; ++row) {
      if (row > 0) require(',');
      require('(');
      for (size_t i = 0; i < type.width / rows; ++i) {
        if (i > 0) require(',');
        put(takeNumber<Number>());
      }
      require(')');
    }
    if (rows > 1) require(')');
  }

  std::string takeWordValue() {
    const char letter = next();
    return letter == '"' || letter == '\'' ? takeString() : takeWord("a word");
  }

  /// Elements between [ and ], with commas, of which one may be the last.
  template <typename Take>
  void takeList(const Take& take_one) {
    require('[');
    while (!take(']')) {
      take_one();
      if (!take(',') && next() != ']') failHere("',' or ']'");
    }
  }

  UsdValue takeValue(const Type& type, bool is_array) {
    UsdValue value;
    if (type.kind == Kind::kOther) {
      skipValue();
    } else if (type.kind == Kind::kWord) {
      const auto one = [&] { value.words.push_back(takeWordValue()); };
      is_array ? takeList(one) : one();
    } else if (is_array) {
      takeList(
          [&] { takeElement<float>(type, [&](float number) { value.floats.push_back(number); }); });
    } else {
      takeElement<double>(type, [&](double number) { value.numbers.push_back(number); });
    }
    return value;
  }

  /// "None", which takes a value away.
  bool takeNone() {
    next();
    if (text_.substr(at_, 4) != "None" || (at_ + 4 < text_.size() && isOfWord(text_[at_ + 4]))) {
      return false;
    }
    at_ += 4;
    return true;
  }

  void takeSamples(const Type& type, bool is_array, UsdAttribute& attribute) {
    require('{');
    while (!take('}')) {
      const double time = takeNumber<double>();
      require(':');
      if (!takeNone()) attribute.samples[time] = takeValue(type, is_array);
      if (!take(',') && next() != '}') failHere("',' or '}'");
    }
  }

  /// An attribute or a relationship. In: its first word.
  void addProperty(UsdPrim& prim, std::string word) {
    while (isOneOf(word, {"custom", "uniform", "varying", "config", "prepend", "append", "delete",
                          "add", "reorder"})) {
      word = takeWord("a type");
    }
    const bool is_array = word != "rel" && take('[');
    if (is_array) require(']');
    const std::string name = takeWord("the name of a property");
    const size_t dot = name.find('.');
    const std::string_view part = dot == name.npos ? "" : std::string_view(name).substr(dot + 1);
    if (word == "rel" || (dot != name.npos && part != "timeSamples")) {
      if (next() == '=') skipAssigned();
    } else {
      const Type type = typeOf(word);
      UsdAttribute& attribute = prim.attributes[name.substr(0, dot)];
      attribute.type = word + (is_array ? "[]" : "");
      if (take('=')) {
        if (part == "timeSamples") {
          takeSamples(type, is_array, attribute);
        } else if (!takeNone()) {
          attribute.value = takeValue(type, is_array);
        }
      }
    }
    if (next() == '(') skipValue();
  }

  UsdArc takeArc() {
    UsdArc arc;
    if (next() == '@') arc.layer = takeAsset();
    if (next() == '<') arc.prim = takePath();
    if (arc.layer.empty() && arc.prim.empty()) failHere("a reference");
    if (next() == '(') skipValue();  // a shift in time
    return arc;
  }

  void takeArcs(std::vector<UsdArc>& arcs) {
    require('=');
    if (takeNone()) return;
    if (next() == '[') {
      takeList([&] { arcs.push_back(takeArc()); });
    } else {
      arcs.push_back(takeArc());
    }
  }

  /// Strings of a dictionary and of those in it.
  void takeDictionary(const std::string& prefix, std::map<std::string, std::string>& custom,
                      int depth) {
    if (depth > kMaxDepth) failHere("at most 200 dictionaries in each other");
    require('{');
    while (!take('}')) {
      const std::string type = takeWord("a type");
      if (take('[')) require(']');
      const char letter = next();
      const std::string key =
          prefix + (letter == '"' || letter == '\'' ? takeString() : takeWord("a key"));
      require('=');
      if (type == "dictionary") {
        takeDictionary(key + ":", custom, depth + 1);
      } else if ((type == "string" || type == "token") && (next() == '"' || next() == '\'')) {
        custom[key] = takeString();
      } else {
        skipValue();
      }
    }
  }

  /// What stands in the brackets behind a prim's name.
  void primMetadata(UsdPrim& prim) {
    require('(');
    while (!take(')')) {
      if (next() == '"' || next() == '\'') {
        takeString();
        continue;
      }
      std::string word = takeWord("a key");
      const bool is_deleted = word == "delete";
      if (isOneOf(word, {"prepend", "append", "delete", "add", "reorder"})) {
        word = takeWord("a key");
      }
      if (isOneOf(word, {"references", "payload", "inherits", "specializes"}) && !is_deleted) {
        takeArcs(prim.arcs);
      } else if (word == "customData") {
        require('=');
        takeDictionary("", prim.custom, 0);
      } else if (word == "active") {
        require('=');
        const std::string value = takeWord("true or false");
        prim.is_active = value == "true" || value == "1";
      } else if (word == "references" || word == "payload") {
        std::vector<UsdArc> passed_over;
        takeArcs(passed_over);
      } else {
        skipAssigned();
      }
    }
  }

  void layerMetadata(UsdLayer& layer) {
    require('(');
    while (!take(')')) {
      if (next() == '"' || next() == '\'') {
        takeString();
        continue;
      }
      const std::string word = takeWord("a key");
      if (isOneOf(word, {"prepend", "append", "delete", "add", "reorder"})) continue;
      require('=');
      if (word == "upAxis") {
        layer.up_axis = takeString();
      } else if (word == "defaultPrim") {
        layer.default_prim = takeString();
      } else if (word == "metersPerUnit") {
        layer.metres_per_unit = takeNumber<double>();
      } else if (word == "timeCodesPerSecond") {
        layer.time_codes_per_second = takeNumber<double>();
      } else if (word == "framesPerSecond") {
        layer.frames_per_second = takeNumber<double>();
      } else if (word == "subLayers") {
        takeList([&] {
          if (next() != '@') failHere("the path of a layer");
          layer.sublayers.push_back(takeAsset());
          if (next() == '(') skipValue();
        });
      } else {
        skipValue();
      }
    }
  }

  void skipVariants() {
    takeString();
    require('=');
    require('{');
    while (!take('}')) {
      takeString();
      if (next() == '(') skipValue();
      if (next() != '{') failHere("'{'");
      skipValue();
    }
  }

  /// In: its specifier, which has been read.
  void addPrim(UsdPrim& parent, const std::string& specifier, int depth) {
    if (!isOneOf(specifier, {"def", "over", "class"})) failHere("def, over or class");
    if (depth > kMaxDepth) failHere("at most 200 prims in each other");
    auto prim = std::make_unique<UsdPrim>();
    prim->is_defined = specifier == "def";
    prim->is_class = specifier == "class";
    if (next() != '"' && next() != '\'') prim->type = takeWord("a type");
    prim->name = takeString();
    if (next() == '(') primMetadata(*prim);
    require('{');
    while (!take('}')) {
      const std::string word = takeWord("a property or a prim");
      if (isOneOf(word, {"def", "over", "class"})) {
        addPrim(*prim, word, depth + 1);
      } else if (word == "variantSet") {
        skipVariants();
      } else if (word == "reorder") {
        takeWord("a name");
        skipAssigned();
      } else {
        addProperty(*prim, word);
      }
    }
    parent.children.push_back(std::move(prim));
  }

  std::string_view text_;
  const std::string& name_;
  size_t at_ = 0;
};

}  // namespace

const UsdValue* UsdAttribute::at(std::optional<double> time) const {
  if (value && (!time || samples.empty())) return &*value;
  if (samples.empty()) return nullptr;
  auto found = samples.begin();
  if (time) {
    const auto after = samples.upper_bound(*time);
    if (after != samples.begin()) found = std::prev(after);
  }
  return &found->second;
}

const UsdPrim* UsdPrim::child(std::string_view of_name) const {
  const auto found = std::find_if(children.begin(), children.end(),
                                  [&](const auto& one) { return one->name == of_name; });
  return found == children.end() ? nullptr : found->get();
}

UsdLayer parseUsdText(std::string_view text, const std::string& name) {
  return Parser(text, name).layer();
}

}  // namespace stipple
