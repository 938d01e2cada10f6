// Based on: PlayCanvas, streamed SOG (lod-meta.json), as splat-transform 3.2 reads it: a binary
// tree of chunks, each with a range of splats in one file per level.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <tuple>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/json_text.h"
#include "io/bytes/limits.h"
#include "io/bytes/output_file.h"
#include "io/splats/cloud_parts.h"
#include "io/splats/sog_file.h"
#include "io/splats/sog_level_names.h"
#include "io/splats/sog_levels.h"
#include "math/covariance.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kMaxDepth = 40;
// A splat is drawn to about three standard deviations.
constexpr double kExtent = 3.0;
constexpr char kStage[] = "Writing splats";

/// A splat of one of the levels.
struct Item {
  uint32_t level;
  uint32_t index;
};

/// Splats of one level that go into one file, in their order.
struct Unit {
  size_t level;
  std::string folder;
  std::vector<uint32_t> indices;
};

struct Box {
  std::array<double, 3> low;
  std::array<double, 3> high;
  Box() {
    low.fill(std::numeric_limits<double>::infinity());
    high.fill(-std::numeric_limits<double>::infinity());
  }
  void add(size_t axis, double from, double to) {
    low[axis] = std::min(low[axis], from);
    high[axis] = std::max(high[axis], to);
  }
  void add(const Box& other) {
    for (size_t axis = 0; axis < 3; ++axis) add(axis, other.low[axis], other.high[axis]);
  }
  size_t longestAxis() const {
    size_t longest = 0;
    for (size_t axis = 1; axis < 3; ++axis) {
      if (high[axis] - low[axis] > high[longest] - low[longest]) longest = axis;
    }
    return longest;
  }
};

class Writer {
 public:
  Writer(const std::vector<const SplatCloud*>& levels, const SplatCloud* environment,
         const std::string& path, const SogLevelsOptions& options, Progress* progress)
      : levels_(levels),
        environment_(environment != nullptr && environment->size() > 0 ? environment : nullptr),
        path_(path),
        folder_(fs::path(path).parent_path()),
        options_(options),
        progress_(progress) {}

  void write() {
    const std::vector<fs::path> old = oldFolders();
    Json meta = chunks();
    std::vector<fs::path> made;
    try {
      writeUnits(made);
      if (environment_ != nullptr) {
        const std::string folder = freshFolder("env");
        made.push_back(folder_ / folder);
        writeSog(*environment_, metaIn(folder), {}, nullptr);
        meta["environment"] = folder + "/" + kSogMetaName;
      }
      // Paths are known only now: a folder that is there belongs to another scene.
      meta["filenames"] = Json::array();
      for (const Unit& unit : units_) {
        meta["filenames"].push_back(unit.folder + "/" + kSogMetaName);
      }
      OutputFile file(path_);
      const std::string text = meta.dump();
      file.write(text.data(), text.size());
      file.commit();
    } catch (...) {
      for (const fs::path& folder : made) removeScene(folder);
      throw;
    }
    for (const fs::path& folder : old) removeScene(folder);
    advance(progress_, 1.0, kStage);
  }

 private:
  const float* position(const Item& item) const {
    return &levels_[item.level]->positions[item.index * size_t{3}];
  }

  /// Cuts space into chunks and gives each a range in the files of its levels.
  Json chunks() {
    std::vector<Item> items;
    Json counts = Json::array();
    for (size_t level = 0; level < levels_.size(); ++level) {
      for (size_t i = 0; i < levels_[level]->size(); ++i) {
        items.push_back({static_cast<uint32_t>(level), static_cast<uint32_t>(i)});
      }
      counts.push_back(levels_[level]->size());
    }
    open_.assign(levels_.size(), std::numeric_limits<size_t>::max());
    Json meta;
    meta["version"] = 1;
    meta["asset"]["generator"] = "stipple";
    meta["count"] = items.size();
    meta["counts"] = counts;
    meta["lodLevels"] = levels_.size();
    Box bounds;
    meta["tree"] = node(items.data(), items.data() + items.size(), 0, bounds);
    return meta;
  }

  static Json toJson(const Box& box) { return {{"min", box.low}, {"max", box.high}}; }

  Json node(Item* begin, Item* end, int depth, Box& bounds) {
    Box centres;
    for (const Item* item = begin; item != end; ++item) {
      for (size_t axis = 0; axis < 3; ++axis) {
        const double value = static_cast<double>(position(*item)[axis]);
        centres.add(axis, value, value);
      }
    }
    const size_t count = static_cast<size_t>(end - begin);
    const size_t axis = centres.longestAxis();
    const double side = count > 0 ? centres.high[axis] - centres.low[axis] : 0.0;
    const bool splits = count > options_.chunk_splats || side > options_.chunk_side;
    Json json;
    if (splits && side > 0 && count > 1 && depth < kMaxDepth) {
      Item* middle = begin + count / 2;
      // Equal places by level and index, so that the cut is always the same.
      std::nth_element(begin, middle, end, [&](const Item& a, const Item& b) {
        const float x = position(a)[axis], y = position(b)[axis];
        return std::tie(x, a.level, a.index) < std::tie(y, b.level, b.index);
      });
      Box left, right;
      Json children = Json::array();
      children.push_back(node(begin, middle, depth + 1, left));
      children.push_back(node(middle, end, depth + 1, right));
      bounds.add(left);
      bounds.add(right);
      json["bound"] = toJson(bounds);
      json["children"] = std::move(children);
      return json;
    }
    Json ranges = Json::object();
    for (size_t level = 0; level < levels_.size(); ++level) {
      std::vector<uint32_t> indices;
      for (const Item* item = begin; item != end; ++item) {
        if (item->level == level) indices.push_back(item->index);
      }
      if (indices.empty()) continue;
      std::sort(indices.begin(), indices.end());
      sortAlongMortonCurve(levels_[level]->positions, indices.data(), indices.size());
      for (const uint32_t i : indices) addExtent(*levels_[level], i, bounds);
      ranges[std::to_string(level)] = place(level, indices);
    }
    // The bounds of nothing are a point.
    json["bound"] = toJson(count > 0 ? bounds : pointBox());
    json["lods"] = std::move(ranges);
    return json;
  }

  static Box pointBox() {
    Box box;
    for (size_t axis = 0; axis < 3; ++axis) box.add(axis, 0.0, 0.0);
    return box;
  }

  static void addExtent(const SplatCloud& cloud, size_t i, Box& bounds) {
    const Mat3d variance = covariance<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]);
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      const double centre = static_cast<double>(cloud.positions[i * 3 + axis]);
      const double reach = kExtent * std::sqrt(variance(a, a));
      bounds.add(axis, centre - reach, centre + reach);
    }
  }

  /// Appends a chunk to the level's open file, which is closed when it is full.
  Json place(size_t level, const std::vector<uint32_t>& indices) {
    if (open_[level] >= units_.size()) {
      open_[level] = units_.size();
      units_.push_back({level, std::string(), {}});
    }
    const size_t file = open_[level];
    std::vector<uint32_t>& to = units_[file].indices;
    const Json range = {{"file", file}, {"offset", to.size()}, {"count", indices.size()}};
    to.insert(to.end(), indices.begin(), indices.end());
    if (to.size() >= options_.chunk_splats) open_[level] = std::numeric_limits<size_t>::max();
    return range;
  }

  void writeUnits(std::vector<fs::path>& made) {
    std::vector<size_t> numbers(levels_.size(), 0);
    for (size_t u = 0; u < units_.size(); ++u) {
      Unit& unit = units_[u];
      unit.folder =
          freshFolder(std::to_string(unit.level) + "_" + std::to_string(numbers[unit.level]++));
      made.push_back(folder_ / unit.folder);
      SogOptions options;
      options.sort = false;
      writeSog(gathered(*levels_[unit.level], unit.indices.data(), unit.indices.size()),
               metaIn(unit.folder), options, nullptr);
      advance(progress_, static_cast<double>(u + 1) / static_cast<double>(units_.size() + 1),
              kStage);
    }
  }

  std::string metaIn(const std::string& folder) const {
    return (folder_ / folder / kSogMetaName).string();
  }

  /// Makes a folder of this name, or with a number after it where there is one.
  std::string freshFolder(const std::string& name) const {
    for (unsigned number = 1;; ++number) {
      const std::string tried = number == 1 ? name : name + "_" + std::to_string(number);
      std::error_code error;
      if (fs::create_directory(folder_ / tried, error)) return tried;
      if (error) {
        fail(ErrorCode::kIo, (folder_ / tried).string() + " cannot be made: " + error.message());
      }
    }
  }

  /// Null where it cannot be read.
  Json oldMeta() const {
    try {
      return parseOrderedJson(readTextFile(path_, kMaxJsonBytes), path_);
    } catch (const Error&) {
      return nullptr;
    }
  }

  /// Folders that a lod-meta.json which is there names; none where it cannot be read.
  std::vector<fs::path> oldFolders() const {
    std::vector<fs::path> folders;
    std::error_code ignored;
    if (!fs::exists(path_, ignored)) return folders;
    const Json old = oldMeta();
    if (!old.is_object() || !old.contains("filenames") || !old["filenames"].is_array()) {
      return folders;
    }
    std::vector<Json> names(old["filenames"].begin(), old["filenames"].end());
    if (old.contains("environment")) names.push_back(old["environment"]);
    for (const Json& name : names) {
      const fs::path path = name.is_string() ? name.get<std::string>() : "";
      // FOLDER/meta.json and nothing that leads elsewhere.
      if (path.filename() == kSogMetaName && path.is_relative() && path.has_parent_path() &&
          !path.parent_path().has_parent_path() && path.parent_path() != "..") {
        folders.push_back(folder_ / path.parent_path());
      }
    }
    return folders;
  }

  /// Removes the files that writeSog makes, and the folder where nothing else is in it.
  static void removeScene(const fs::path& folder) {
    std::error_code ignored;
    for (const char* name : {"means_l.webp", "means_u.webp", "scales.webp", "quats.webp",
                             "sh0.webp", "shN_centroids.webp", "shN_labels.webp", kSogMetaName}) {
      fs::remove(folder / name, ignored);
    }
    fs::remove(folder, ignored);
  }

  const std::vector<const SplatCloud*>& levels_;
  const SplatCloud* environment_;
  std::string path_;
  fs::path folder_;
  SogLevelsOptions options_;
  Progress* progress_;
  std::vector<Unit> units_;
  std::vector<size_t> open_;  ///< per level, the file that takes chunks
};

}  // namespace

void writeSogLevels(const std::vector<const SplatCloud*>& levels, const SplatCloud* environment,
                    const std::string& path, const SogLevelsOptions& options, Progress* progress) {
  if (levels.empty()) {
    fail(ErrorCode::kInvalidArgument, "a streamed scene has 0 levels; at least 1 is needed");
  }
  for (const SplatCloud* level : levels) validate(*level, "level");
  if (environment != nullptr) validate(*environment, "environment");
  Writer(levels, environment, path, options, progress).write();
}

}  // namespace stipple
