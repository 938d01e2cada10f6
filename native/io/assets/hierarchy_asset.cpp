#include "io/assets/hierarchy_asset.h"

#include "base/error.h"
#include "io/assets/asset_header.h"
#include "io/assets/cloud_tensors.h"
#include "io/bytes/safetensors.h"

namespace stipple {

namespace {

constexpr char kLeaves[] = "tree.leaves.";
constexpr char kNodes[] = "tree.nodes.";

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
  setCloudFlags(file, asset.leaves);
  file.setMetadata("settings", asset.settings_json);
  addCloudTensors(file, kLeaves, asset.leaves);
  addCloudTensors(file, kNodes, asset.nodes);
  file.add("tree.parents", asset.parents, 1);
  file.add("tree.errors", asset.errors, 1);
  addAssetExtras(file, asset.extras);
  file.write(path);
}

HierarchyAsset readHierarchyAsset(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetHierarchy);
  const SplatCloud flags = readCloudFlags(file);
  HierarchyAsset asset;
  asset.leaves = readCloudTensors(file, kLeaves, flags);
  asset.nodes = readCloudTensors(file, kNodes, flags);
  asset.parents = file.readUint32s("tree.parents", 1);
  asset.errors = file.readFloats("tree.errors", 1);
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  validateAsset(asset, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
