#include "io/assets/octree_tensors.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/assets/asset_header.h"
#include "io/bytes/json_text.h"

namespace stipple {

namespace {

using Json = nlohmann::json;

constexpr size_t kMaxLevels = 64;

std::string levelName(const char* stem, size_t level) {
  return std::string(stem) + "." + std::to_string(level);
}

/// JSON text of the metadata. Errors: kFormat.
Json parseText(const SafeTensorsReader& file, const char* key) {
  return parseJson(requireText(file, key), file.path() + ": the metadata '" + key + "'");
}

void readRoot(const SafeTensorsReader& file, OctreeTensors& octree) {
  const Json root = parseText(file, "root_cube");
  const bool numbers = root.is_array() && root.size() == 4 && root[0].is_number() &&
                       root[1].is_number() && root[2].is_number() && root[3].is_number();
  if (!numbers || !(root[3].get<double>() > 0) || !std::isfinite(root[3].get<double>())) {
    fail(ErrorCode::kFormat,
         file.path() + " has a root_cube that is not [x, y, z, side] with a positive side");
  }
  for (size_t axis = 0; axis < 3; ++axis) octree.root_origin[axis] = root[axis].get<double>();
  octree.root_side = root[3].get<double>();
}

}  // namespace

void addOctree(SafeTensorsWriter& file, const OctreeTensors& octree) {
  file.setMetadata("root_cube", Json({octree.root_origin[0], octree.root_origin[1],
                                      octree.root_origin[2], octree.root_side})
                                    .dump());
  file.setMetadata("levels", std::to_string(octree.cells.size()));
  for (size_t level = 0; level < octree.cells.size(); ++level) {
    file.add(levelName("octree.cells", level), octree.cells[level], 1);
    file.add(levelName("octree.log_p", level), octree.log_probabilities[level], 8);
  }
}

OctreeTensors readOctree(const SafeTensorsReader& file) {
  OctreeTensors octree;
  readRoot(file, octree);
  const Json levels = parseText(file, "levels");
  if (!levels.is_number_unsigned() || levels.get<uint64_t>() > kMaxLevels) {
    fail(ErrorCode::kFormat, file.path() + " has levels = " + levels.dump().substr(0, 40) +
                                 "; a whole number up to 64 is needed");
  }
  for (size_t level = 0; level < levels.get<size_t>(); ++level) {
    octree.cells.push_back(file.readUint64s(levelName("octree.cells", level), 1));
    octree.log_probabilities.push_back(file.readFloats(levelName("octree.log_p", level), 8));
  }
  return octree;
}

void validateOctree(const OctreeTensors& octree, const std::string& name, ErrorCode code) {
  if (octree.cells.size() > kMaxLevels || octree.cells.size() != octree.log_probabilities.size()) {
    fail(code, name + " has " + std::to_string(octree.cells.size()) + " levels of cells and " +
                   std::to_string(octree.log_probabilities.size()) +
                   " of log-probabilities; equal numbers up to 64 are needed");
  }
  for (size_t level = 0; level < octree.cells.size(); ++level) {
    const std::string what = name + ": octree.log_p." + std::to_string(level);
    const size_t seen = octree.log_probabilities[level].size();
    const size_t needed = octree.cells[level].size() * 8;
    if (seen != needed) {
      fail(code, what + " has " + std::to_string(seen) + " rows; " + std::to_string(needed) +
                     " are needed");
    }
    for (const float value : octree.log_probabilities[level]) {
      // Probability 0 is stored as minus infinity.
      if (std::isnan(value) || value == HUGE_VALF) {
        fail(code, what + " holds " + std::to_string(value) + "; at most 0 is allowed");
      }
    }
  }
}

}  // namespace stipple
