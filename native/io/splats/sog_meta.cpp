// Based on: PlayCanvas, The SOG Format, version 2 (developer.playcanvas.com), and version 1 as
// splat-transform 3.2 reads it.
#include "io/splats/sog_meta.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/number_text.h"
#include "io/bytes/json_text.h"
#include "io/splats/ply/ply_file.h"

namespace stipple {

namespace {

using Json = nlohmann::json;

/// An object of the JSON with its place in it, so that messages can name the key.
class Section {
 public:
  Section(const std::string& file, std::string key, const Json& json)
      : file_(file), key_(std::move(key)), json_(json) {
    if (!json_.is_object()) failHere("is not a JSON object");
  }

  Section section(const char* key) const { return Section(file_, path(key), at(key)); }
  bool has(const char* key) const {
    const auto found = json_.find(key);
    return found != json_.end() && !found->is_null();
  }

  double number(const char* key) const { return numberOf(at(key), path(key)); }

  uint64_t wholeNumber(const char* key) const { return wholeNumberOf(at(key), path(key)); }

  std::vector<double> numbers(const char* key, size_t count) const {
    const Json& list = array(key, count);
    std::vector<double> values;
    for (const Json& value : list) values.push_back(numberOf(value, path(key)));
    return values;
  }

  /// 256 numbers. Early writers left out the first, whose logarithm they took of 0; PlayCanvas
  /// continues the list below its second, and so does this.
  std::vector<double> codebook() const {
    const Json& list = array("codebook", 256);
    std::vector<double> values(256);
    for (size_t i = list[0].is_null() ? 1 : 0; i < 256; ++i) {
      values[i] = numberOf(list[i], path("codebook"));
    }
    if (list[0].is_null()) values[0] = values[1] + (values[1] - values[255]) / 255.0;
    return values;
  }

  std::string text(const char* key) const {
    if (!at(key).is_string()) fail(ErrorCode::kFormat, where(path(key)) + "is not a text");
    return at(key).get<std::string>();
  }

  /// Names of files in the same folder, and nothing else.
  std::vector<std::string> files(size_t count) const {
    std::vector<std::string> names;
    for (const Json& value : array("files", count)) {
      const std::string name = value.is_string() ? value.get<std::string>() : "";
      if (name.empty() || name == "." || name == ".." ||
          name.find_first_of(std::string("/\\:\0", 4)) != name.npos) {
        fail(ErrorCode::kFormat, where(path("files")) + "names '" + name.substr(0, 100) +
                                     "'; the plain name of a file beside it is needed");
      }
      names.push_back(name);
    }
    return names;
  }

  /// The first of a list of whole numbers.
  uint64_t firstWholeNumber(const char* key) const {
    const Json& list = at(key);
    if (!list.is_array() || list.empty()) {
      fail(ErrorCode::kFormat, where(path(key)) + "is not a list of whole numbers");
    }
    return wholeNumberOf(list[0], path(key));
  }

 private:
  std::string path(const char* key) const { return key_.empty() ? key : key_ + "." + key; }
  std::string where(const std::string& key) const { return file_ + ": '" + key + "' "; }

  [[noreturn]] void failHere(const std::string& what) const {
    fail(ErrorCode::kFormat, (key_.empty() ? file_ + " " : where(key_)) + what);
  }

  const Json& at(const char* key) const {
    if (!has(key)) fail(ErrorCode::kFormat, file_ + " has no '" + path(key) + "'");
    return json_[key];
  }

  const Json& array(const char* key, size_t count) const {
    const Json& list = at(key);
    if (!list.is_array() || list.size() != count) {
      fail(ErrorCode::kFormat, where(path(key)) + "is " +
                                   (list.is_array() ? "a list of " + std::to_string(list.size())
                                                    : std::string("no list")) +
                                   "; a list of " + std::to_string(count) + " is needed");
    }
    return list;
  }

  double numberOf(const Json& value, const std::string& key) const {
    if (!value.is_number() || !std::isfinite(value.get<double>())) {
      fail(ErrorCode::kFormat, where(key) + "is not a finite number");
    }
    return value.get<double>();
  }

  uint64_t wholeNumberOf(const Json& value, const std::string& key) const {
    if (!value.is_number_unsigned()) {
      fail(ErrorCode::kFormat,
           where(key) + "is " + value.dump().substr(0, 60) + "; a whole number is needed");
    }
    return value.get<uint64_t>();
  }

  const std::string& file_;
  std::string key_;
  const Json& json_;
};

class MetaReader {
 public:
  MetaReader(const std::string& name, const Json& json) : name_(name), root_(name, "", json) {}

  SogMeta read() {
    const bool first = !root_.has("version");
    if (!first && root_.wholeNumber("version") != 2) {
      fail(ErrorCode::kUnsupported, name_ + " has SOG version " +
                                        std::to_string(root_.wholeNumber("version")) +
                                        "; versions 1 and 2 are supported");
    }
    meta_.count =
        first ? root_.section("means").firstWholeNumber("shape") : root_.wholeNumber("count");
    readOwnKeys();
    readMeans();
    first ? readFirstVersion() : readSecondVersion();
    return meta_;
  }

 private:
  void readOwnKeys() {
    if (root_.has(kSogColourSpaceKey)) {
      const std::string space = root_.text(kSogColourSpaceKey);
      if (space != kColourSpaceDisplay && space != kColourSpaceLinear) {
        fail(ErrorCode::kUnsupported, name_ + " has the colour space '" + space.substr(0, 60) +
                                          "'; " + kColourSpaceDisplay + " and " +
                                          kColourSpaceLinear + " are known");
      }
      if (space == kColourSpaceLinear) meta_.colour_space = ColourSpace::kLinear;
    }
    if (root_.has(kSogFrameKey)) {
      const std::string text = root_.text(kSogFrameKey);
      const std::optional<Frame> frame = frameFromName(text);
      if (!frame || *frame == Frame::kUnknown) {
        fail(ErrorCode::kUnsupported, name_ + " has the frame '" + text.substr(0, 60) +
                                          "'; three letters such as RDF, RUB or RFU are known");
      }
      meta_.frame = *frame;
    }
  }

  void readMeans() {
    const Section means = root_.section("means");
    const std::vector<double> mins = means.numbers("mins", 3);
    const std::vector<double> maxs = means.numbers("maxs", 3);
    // ln(1 + the largest float32): positions beyond it do not exist.
    constexpr double kLargestLog = 88.72283905206835;
    for (size_t axis = 0; axis < 3; ++axis) {
      for (const double value : {mins[axis], maxs[axis]}) {
        if (!(std::abs(value) <= kLargestLog)) {
          fail(ErrorCode::kFormat, name_ + ": 'means' has a bound of " + numberText(value) +
                                       "; it is a logarithm, at most 88.7228 is allowed");
        }
      }
      meta_.means_min[axis] = mins[axis];
      meta_.means_max[axis] = maxs[axis];
    }
    const std::vector<std::string> files = means.files(2);
    meta_.means_low = files[0];
    meta_.means_high = files[1];
    meta_.scales_file = root_.section("scales").files(1)[0];
    meta_.rotations_file = root_.section("quats").files(1)[0];
    meta_.colours_file = root_.section("sh0").files(1)[0];
  }

  /// exp of logarithms, which must stay in the range of float32.
  SogMeta::Table exponentials(const SogMeta::Table& logarithms) const {
    SogMeta::Table table;
    for (size_t i = 0; i < 256; ++i) {
      const double value = std::exp(static_cast<double>(logarithms[i]));
      if (!(value <= static_cast<double>(std::numeric_limits<float>::max()))) {
        fail(ErrorCode::kFormat, name_ + ": 'scales' holds " +
                                     numberText(static_cast<double>(logarithms[i])) +
                                     "; it is a logarithm, at most 88.7228 is allowed");
      }
      table[i] = static_cast<float>(value);
    }
    return table;
  }

  SogMeta::Table codebook(const Section& section, const std::string& key) const {
    const std::vector<double> values = section.codebook();
    SogMeta::Table table;
    for (size_t i = 0; i < 256; ++i) table[i] = narrowed(values[i], key);
    return table;
  }

  /// 256 even steps from low to high.
  SogMeta::Table steps(double low, double high, const std::string& key) const {
    SogMeta::Table table;
    for (size_t i = 0; i < 256; ++i) {
      table[i] = narrowed(low + (high - low) * (static_cast<double>(i) / 255.0), key);
    }
    return table;
  }

  float narrowed(double value, const std::string& key) const {
    if (!(std::abs(value) <= static_cast<double>(std::numeric_limits<float>::max()))) {
      fail(ErrorCode::kFormat,
           name_ + ": '" + key + "' holds " + numberText(value) + ", which is no float32 number");
    }
    return static_cast<float>(value);
  }

  void readSecondVersion() {
    if (root_.has("model")) {
      const std::string model = root_.text("model");
      if (model == "antialiased") meta_.antialias = Antialias::kMip;
      meta_.flat = model == "2dgs";
      if (model != "antialiased" && model != "2dgs" && model != "default") {
        fail(ErrorCode::kUnsupported, name_ + ": 'model' is '" + model.substr(0, 60) +
                                          "'; default, antialiased and 2dgs are supported");
      }
    }
    meta_.scales.fill(exponentials(codebook(root_.section("scales"), "scales.codebook")));
    meta_.colours.fill(codebook(root_.section("sh0"), "sh0.codebook"));
    for (size_t i = 0; i < 256; ++i) meta_.opacities[i] = static_cast<float>(double(i) / 255.0);
    if (!root_.has("shN")) return;
    const Section harmonics = root_.section("shN");
    meta_.palette_count = harmonics.wholeNumber("count");
    if (harmonics.has("bands")) {
      const uint64_t bands = harmonics.wholeNumber("bands");
      if (bands > 3) {
        fail(ErrorCode::kFormat,
             name_ + ": 'shN.bands' is " + std::to_string(bands) + "; 0 to 3 is allowed");
      }
      if (bands == 0) return;
      meta_.bands = static_cast<int>(bands);
    }
    meta_.harmonics = codebook(harmonics, "shN.codebook");
    takeHarmonicsFiles(harmonics);
  }

  void readFirstVersion() {
    const Section scales = root_.section("scales");
    const std::vector<double> low = scales.numbers("mins", 3);
    const std::vector<double> high = scales.numbers("maxs", 3);
    for (size_t axis = 0; axis < 3; ++axis) {
      meta_.scales[axis] = exponentials(steps(low[axis], high[axis], "scales"));
    }
    const Section colours = root_.section("sh0");
    const std::vector<double> darkest = colours.numbers("mins", 4);
    const std::vector<double> brightest = colours.numbers("maxs", 4);
    for (size_t c = 0; c < 3; ++c) {
      meta_.colours[c] = steps(darkest[c], brightest[c], "sh0");
    }
    const SogMeta::Table logits = steps(darkest[3], brightest[3], "sh0");
    for (size_t i = 0; i < 256; ++i) {
      meta_.opacities[i] =
          static_cast<float>(1.0 / (1.0 + std::exp(-static_cast<double>(logits[i]))));
    }
    if (!root_.has("shN")) return;
    const Section harmonics = root_.section("shN");
    meta_.palette_count = std::numeric_limits<uint64_t>::max();
    meta_.harmonics = steps(harmonics.number("mins"), harmonics.number("maxs"), "shN");
    takeHarmonicsFiles(harmonics);
  }

  void takeHarmonicsFiles(const Section& harmonics) {
    const std::vector<std::string> files = harmonics.files(2);
    meta_.centroids_file = files[0];
    meta_.labels_file = files[1];
  }

  const std::string& name_;
  Section root_;
  SogMeta meta_;
};

}  // namespace

SogMeta parseSogMeta(const std::string& text, const std::string& name) {
  const Json json = parseJson(text, name);
  return MetaReader(name, json).read();
}

}  // namespace stipple
