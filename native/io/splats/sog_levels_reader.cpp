// Based on: PlayCanvas, streamed SOG (lod-meta.json), as splat-transform 3.2 writes it.
#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/json_text.h"
#include "io/bytes/limits.h"
#include "io/splats/cloud_parts.h"
#include "io/splats/sog_file.h"
#include "io/splats/sog_level_names.h"
#include "io/splats/sog_levels.h"
#include "io/splats/splat_check.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr char kFinest[] = "0";

struct Range {
  uint64_t offset = 0;
  uint64_t count = 0;
};

class Reader {
 public:
  Reader(const std::string& path, Progress* progress) : path_(path), progress_(progress) {
    std::error_code ignored;
    if (fs::is_directory(path, ignored)) path_ = (fs::path(path) / kSogLevelsName).string();
  }

  SplatCloud read() {
    parse();
    std::vector<SplatCloud> parts;
    size_t done = 0;
    for (auto& [file, ranges] : ranges_) {
      parts.push_back(chosen(readScene(names_[file]), file, ranges));
      advance(progress_, static_cast<double>(++done) / static_cast<double>(ranges_.size() + 1),
              "Reading splats");
    }
    if (meta_.contains("environment") && !meta_["environment"].is_null()) {
      parts.push_back(readScene(nameOf(meta_["environment"], "environment")));
    }
    if (parts.empty()) failHere("names no splats of its finest level");
    for (const SplatCloud& part : parts) {
      if (part.colour_space != parts[0].colour_space || part.antialias != parts[0].antialias ||
          part.frame != parts[0].frame) {
        fail(ErrorCode::kUnsupported, path_ +
                                          " names files of several colour spaces, low-pass "
                                          "filters or frames; one of each is needed");
      }
    }
    return joined(parts);
  }

 private:
  [[noreturn]] void failHere(const std::string& what) const {
    fail(ErrorCode::kFormat, path_ + " " + what);
  }

  /// One file of the scene. Several may lead to the same images, whose bytes count once.
  SplatCloud readScene(const std::string& name) {
    const std::string path = filePath(name);
    uint64_t bytes = 0;
    SplatCloud cloud = readSogPart(path, bytes);
    const fs::path place = fs::weakly_canonical(path);
    stored_bytes_[place.filename() == kSogMetaName ? place.parent_path() : place] = bytes;
    cloud_bytes_ += cloudBytes(cloud.size(), cloud.sh_degree);
    uint64_t stored = 0;
    for (const auto& entry : stored_bytes_) stored += entry.second;
    requireAllowed(cloud_bytes_, kSplatAllowance, stored, path_, "the splats of its files");
    return cloud;
  }

  void parse() {
    meta_ = parseJson(readTextFile(path_, kMaxJsonBytes), path_);
    if (!meta_.is_object()) failHere("is not a JSON object");
    if (meta_.contains("version") && meta_["version"] != 1) {
      fail(ErrorCode::kUnsupported,
           path_ + ": 'version' is " + meta_["version"].dump().substr(0, 60) + "; 1 is supported");
    }
    if (!meta_.contains("filenames") || !meta_["filenames"].is_array()) {
      failHere("has no list 'filenames'");
    }
    for (const Json& name : meta_["filenames"]) names_.push_back(nameOf(name, "filenames"));
    std::vector<std::string> sorted = names_;
    std::sort(sorted.begin(), sorted.end());
    // Each is read once, so the file on the disk bounds what is made of it.
    if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end()) {
      failHere("names a file twice in 'filenames'");
    }
    if (!meta_.contains("tree")) failHere("has no 'tree'");
    walk(meta_["tree"]);
    checkCounts();
  }

  /// A file below the folder of lod-meta.json.
  std::string nameOf(const Json& json, const char* key) const {
    const std::string name = json.is_string() ? json.get<std::string>() : "";
    const fs::path path(name);
    bool inside = !name.empty() && path.is_relative() &&
                  name.find_first_of(std::string("\\:\0", 3)) == name.npos;
    for (const fs::path& part : path) inside = inside && part != "..";
    if (!inside) {
      failHere(std::string("has '") + name.substr(0, 100) + "' in '" + key +
               "'; names of files below it are needed, without '..'");
    }
    return name;
  }

  std::string filePath(const std::string& name) const {
    return (fs::path(path_).parent_path() / name).string();
  }

  uint64_t wholeNumber(const Json& object, const char* key) const {
    if (!object.is_object() || !object.contains(key) || !object[key].is_number_unsigned()) {
      failHere(std::string("has a chunk whose '") + key + "' is not a whole number");
    }
    return object[key].get<uint64_t>();
  }

  /// As deep as JSON may be nested.
  void walk(const Json& node) {
    if (!node.is_object()) failHere("has a 'tree' with a node that is not an object");
    if (node.contains("lods") && node["lods"].is_object() && node["lods"].contains(kFinest)) {
      const Json& chunk = node["lods"][kFinest];
      const uint64_t file = wholeNumber(chunk, "file");
      if (file >= names_.size()) {
        failHere("has a chunk of file " + std::to_string(file) + "; 'filenames' has " +
                 std::to_string(names_.size()));
      }
      ranges_[static_cast<size_t>(file)].push_back(
          {wholeNumber(chunk, "offset"), wholeNumber(chunk, "count")});
    }
    if (!node.contains("children")) return;
    if (!node["children"].is_array()) failHere("has a 'tree' whose 'children' are no list");
    for (const Json& child : node["children"]) walk(child);
  }

  void checkCounts() {
    uint64_t found = 0;
    for (auto& [file, ranges] : ranges_) {
      std::sort(ranges.begin(), ranges.end(),
                [](const Range& a, const Range& b) { return a.offset < b.offset; });
      uint64_t end = 0;
      for (const Range& range : ranges) {
        if (range.offset < end || range.count > UINT64_MAX - range.offset) {
          failHere("has chunks of '" + names_[file].substr(0, 100) + "' that overlap at splat " +
                   std::to_string(range.offset));
        }
        end = range.offset + range.count;
        found += range.count;
      }
    }
    if (!meta_.contains("counts") || !meta_["counts"].is_array() || meta_["counts"].empty()) return;
    if (meta_["counts"][0] != found) {
      failHere("says that its finest level has " + meta_["counts"][0].dump().substr(0, 60) +
               " splats; its chunks have " + std::to_string(found));
    }
  }

  /// The splats of the chunks, in the order of the file.
  SplatCloud chosen(SplatCloud cloud, size_t file, const std::vector<Range>& ranges) const {
    if (ranges.size() == 1 && ranges[0].offset == 0 && ranges[0].count == cloud.size()) {
      return cloud;
    }
    std::vector<uint32_t> indices;
    for (const Range& range : ranges) {
      if (range.offset + range.count > cloud.size()) {
        failHere("has a chunk of '" + names_[file].substr(0, 100) + "' from splat " +
                 std::to_string(range.offset) + " of " + std::to_string(range.count) +
                 " splats; the file holds " + std::to_string(cloud.size()));
      }
      for (uint64_t i = 0; i < range.count; ++i) {
        indices.push_back(static_cast<uint32_t>(range.offset + i));
      }
    }
    return gathered(cloud, indices.data(), indices.size());
  }

  std::string path_;
  Progress* progress_;
  Json meta_;
  std::vector<std::string> names_;
  std::map<fs::path, uint64_t> stored_bytes_;    ///< of the images at each place
  uint64_t cloud_bytes_ = 0;                     ///< of all that was read
  std::map<size_t, std::vector<Range>> ranges_;  ///< of the finest level, per file
};

}  // namespace

bool startsAsSogLevels(const SplatFileStart& start) {
  std::error_code ignored;
  return start.is_folder ? fs::exists(fs::path(start.path) / kSogLevelsName, ignored)
                         : start.name == kSogLevelsName;
}

SplatCloud readSogLevels(const std::string& path, Progress* progress) {
  return Reader(path, progress).read();
}

}  // namespace stipple
