#include "io/assets/hierarchy_asset.h"

#include "base/error.h"
#include "io/assets/asset_header.h"
#include "io/bytes/safetensors.h"
#include "io/splats/ply/ply_file.h"

namespace stipple {

namespace {

constexpr char kMip[] = "mip";
constexpr char kClassic[] = "classic";
constexpr char kLeaves[] = "tree.leaves.";
constexpr char kNodes[] = "tree.nodes.";

void addCloud(SafeTensorsWriter& file, const std::string& stem, const SplatCloud& cloud) {
  file.add(stem + "positions", cloud.positions, 3);
  file.add(stem + "rotations", cloud.rotations, 4);
  file.add(stem + "scales", cloud.scales, 3);
  file.add(stem + "opacities", cloud.opacities, 1);
  file.add(stem + "sh", cloud.sh, cloud.shStride());
}

/// In: `like` gives degree, colour space, antialias flag and frame.
SplatCloud readCloud(const SafeTensorsReader& file, const std::string& stem,
                     const SplatCloud& like) {
  SplatCloud cloud = like;
  cloud.positions = file.readFloats(stem + "positions", 3);
  cloud.rotations = file.readFloats(stem + "rotations", 4);
  cloud.scales = file.readFloats(stem + "scales", 3);
  cloud.opacities = file.readFloats(stem + "opacities", 1);
  cloud.sh = file.readFloats(stem + "sh", cloud.shStride());
  return cloud;
}

SplatCloud readFlags(const SafeTensorsReader& file) {
  SplatCloud flags;
  flags.colour_space = isFirstText(file, "colour_space", kColourSpaceDisplay, kColourSpaceLinear)
                           ? ColourSpace::kDisplay
                           : ColourSpace::kLinear;
  flags.antialias =
      isFirstText(file, "antialias", kMip, kClassic) ? Antialias::kMip : Antialias::kClassic;
  const std::string& frame = requireText(file, "frame");
  const auto known = frameFromName(frame);
  if (!known) {
    fail(ErrorCode::kFormat, file.path() + " has the frame '" + frame.substr(0, 40) +
                                 "'; three letters such as RDF, or 'unknown', are needed");
  }
  flags.frame = *known;
  const std::string& degree = requireText(file, "sh_degree");
  if (degree.size() != 1 || degree[0] < '0' || degree[0] > '0' + kMaxShDegree) {
    fail(ErrorCode::kFormat,
         file.path() + " has sh_degree = " + degree.substr(0, 40) + "; 0 to 4 is needed");
  }
  flags.sh_degree = degree[0] - '0';
  return flags;
}

/// Sizes that agree and splats that are splats, for an asset from either side.
void validateAsset(const HierarchyAsset& asset, const std::string& name, ErrorCode code) {
  try {
    validate(asset.leaves, (name + ": tree.leaves").c_str());
    validate(asset.nodes, (name + ": tree.nodes").c_str());
  } catch (const Error& error) {
    fail(code, error.what());
  }
  const size_t count = asset.leaves.size();
  if (count == 0) fail(code, name + " has 0 splats; at least 1 is needed");
  const auto requireRows = [&](const char* what, size_t seen, size_t needed) {
    if (seen == needed) return;
    fail(code, name + ": " + what + " has " + std::to_string(seen) + " rows; " +
                   std::to_string(needed) + " are needed for " + std::to_string(count) + " splats");
  };
  requireRows("tree.nodes", asset.nodes.size(), count - 1);
  requireRows("tree.errors", asset.errors.size(), count - 1);
  requireRows("tree.parents", asset.parents.size(), 2 * count - 1);
}

}  // namespace

void writeHierarchyAsset(const HierarchyAsset& asset, const std::string& path) {
  validateAsset(asset, "asset", ErrorCode::kInvalidArgument);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetHierarchy);
  const SplatCloud& leaves = asset.leaves;
  const bool display = leaves.colour_space == ColourSpace::kDisplay;
  file.setMetadata("colour_space", display ? kColourSpaceDisplay : kColourSpaceLinear);
  file.setMetadata("antialias", leaves.antialias == Antialias::kMip ? kMip : kClassic);
  file.setMetadata("frame", frameName(leaves.frame));
  file.setMetadata("sh_degree", std::to_string(leaves.sh_degree));
  file.setMetadata("settings", asset.settings_json);
  addCloud(file, kLeaves, leaves);
  addCloud(file, kNodes, asset.nodes);
  file.add("tree.parents", asset.parents, 1);
  file.add("tree.errors", asset.errors, 1);
  addAssetExtras(file, asset.extras);
  file.write(path);
}

HierarchyAsset readHierarchyAsset(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetHierarchy);
  const SplatCloud flags = readFlags(file);
  HierarchyAsset asset;
  asset.leaves = readCloud(file, kLeaves, flags);
  asset.nodes = readCloud(file, kNodes, flags);
  asset.parents = file.readUint32s("tree.parents", 1);
  asset.errors = file.readFloats("tree.errors", 1);
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  validateAsset(asset, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
