#include "io/surface_asset.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/asset_header.h"
#include "io/safetensors.h"

namespace stipple {

namespace {

using Json = nlohmann::json;

constexpr size_t kMaxLevels = 64;

std::string levelName(const char* stem, size_t level) {
  return std::string(stem) + "." + std::to_string(level);
}

/// JSON text of the metadata. Errors: kFormat.
Json parseText(const SafeTensorsReader& file, const char* key) {
  const Json value = Json::parse(requireText(file, key), nullptr, false);
  if (value.is_discarded()) {
    fail(ErrorCode::kFormat, file.path() + " has metadata '" + key + "' that is not valid JSON");
  }
  return value;
}

void readRoot(const SafeTensorsReader& file, SurfaceAsset& asset) {
  const Json root = parseText(file, "root_cube");
  const bool numbers = root.is_array() && root.size() == 4 && root[0].is_number() &&
                       root[1].is_number() && root[2].is_number() && root[3].is_number();
  if (!numbers || !(root[3].get<double>() > 0) || !std::isfinite(root[3].get<double>())) {
    fail(ErrorCode::kFormat,
         file.path() + " has a root_cube that is not [x, y, z, side] with a positive side");
  }
  for (size_t axis = 0; axis < 3; ++axis) asset.root_origin[axis] = root[axis].get<double>();
  asset.root_side = root[3].get<double>();
}

void requireRows(const std::string& what, size_t seen, size_t expected, ErrorCode code) {
  if (seen != expected) {
    fail(code, what + " has " + std::to_string(seen) + " rows; " + std::to_string(expected) +
                   " are needed");
  }
}

void requireNumbers(const std::string& what, const std::vector<float>& values, size_t width,
                    ErrorCode code) {
  for (size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) continue;
    fail(code, what + " holds " + std::to_string(values[i]) + " in row " +
                   std::to_string(i / width) + "; every value must be a finite number");
  }
}

/// Sizes that agree and numbers that are numbers, for an asset from either side.
void validateAsset(const SurfaceAsset& asset, const std::string& name, ErrorCode code) {
  if (asset.cells.size() > kMaxLevels || asset.cells.size() != asset.log_probabilities.size()) {
    fail(code, name + " has " + std::to_string(asset.cells.size()) + " levels of cells and " +
                   std::to_string(asset.log_probabilities.size()) +
                   " of log-probabilities; equal numbers up to 64 are needed");
  }
  for (size_t level = 0; level < asset.cells.size(); ++level) {
    const std::string what = name + ": octree.log_p." + std::to_string(level);
    requireRows(what, asset.log_probabilities[level].size(), asset.cells[level].size() * 8, code);
    for (const float value : asset.log_probabilities[level]) {
      // Probability 0 is stored as minus infinity.
      if (std::isnan(value) || value == HUGE_VALF) {
        fail(code, what + " holds " + std::to_string(value) + "; at most 0 is allowed");
      }
    }
  }
  const PointSet& surface = asset.surface;
  const size_t count = surface.size();
  const auto check = [&](const char* part, const std::vector<float>& values, size_t width) {
    requireRows(name + ": surface." + part, values.size() / width, count, code);
    requireNumbers(name + ": surface." + part, values, width, code);
  };
  check("positions", surface.positions, 3);
  check("normals", surface.normals, 3);
  check("colours", surface.colours, 3);
  check("opacities", surface.opacities, 1);
  check("areas", surface.areas, 1);
  check("weights", surface.weights, 1);
}

}  // namespace

void writeSurfaceAsset(const SurfaceAsset& asset, const std::string& path) {
  validateAsset(asset, "asset", ErrorCode::kInvalidArgument);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetSurface);
  file.setMetadata("colour_space", "lin_rec709_display");
  file.setMetadata("frame", "right-handed, z up, metres");
  file.setMetadata("root_cube", Json({asset.root_origin[0], asset.root_origin[1],
                                      asset.root_origin[2], asset.root_side})
                                    .dump());
  file.setMetadata("levels", std::to_string(asset.cells.size()));
  file.setMetadata("settings", asset.settings_json);
  for (size_t level = 0; level < asset.cells.size(); ++level) {
    file.add(levelName("octree.cells", level), asset.cells[level], 1);
    file.add(levelName("octree.log_p", level), asset.log_probabilities[level], 8);
  }
  file.add("surface.positions", asset.surface.positions, 3);
  file.add("surface.normals", asset.surface.normals, 3);
  file.add("surface.colours", asset.surface.colours, 3);
  file.add("surface.opacities", asset.surface.opacities, 1);
  file.add("surface.areas", asset.surface.areas, 1);
  file.add("surface.weights", asset.surface.weights, 1);
  addAssetExtras(file, asset.extras);
  file.write(path);
}

SurfaceAsset readSurfaceAsset(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetSurface);
  SurfaceAsset asset;
  readRoot(file, asset);
  const Json levels = parseText(file, "levels");
  if (!levels.is_number_unsigned() || levels.get<uint64_t>() > kMaxLevels) {
    fail(ErrorCode::kFormat, path + " has levels = " + levels.dump().substr(0, 40) +
                                 "; a whole number up to 64 is needed");
  }
  for (size_t level = 0; level < levels.get<size_t>(); ++level) {
    asset.cells.push_back(file.readUint64s(levelName("octree.cells", level), 1));
    asset.log_probabilities.push_back(file.readFloats(levelName("octree.log_p", level), 8));
  }
  asset.surface.positions = file.readFloats("surface.positions", 3);
  asset.surface.normals = file.readFloats("surface.normals", 3);
  asset.surface.colours = file.readFloats("surface.colours", 3);
  asset.surface.opacities = file.readFloats("surface.opacities", 1);
  asset.surface.areas = file.readFloats("surface.areas", 1);
  asset.surface.weights = file.readFloats("surface.weights", 1);
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  validateAsset(asset, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
