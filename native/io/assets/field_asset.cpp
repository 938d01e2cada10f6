#include "io/assets/field_asset.h"

#include "base/error.h"
#include "io/assets/network_tensors.h"

namespace stipple {

namespace {

constexpr char kStem[] = "field.";
constexpr uint64_t kMostAnchors = uint64_t{1} << 28;

void validateAsset(const FieldAsset& asset, const std::string& name, ErrorCode code) {
  validateOctree(asset, name, code);
  if (asset.least_anchors < 1 || asset.least_anchors > asset.most_anchors) {
    fail(code, name + " has budgets " + std::to_string(asset.least_anchors) + " to " +
                   std::to_string(asset.most_anchors) + "; at least 1, ascending, is needed");
  }
  requireNetworkTensors(asset.tensors, kStem, name, code);
}

}  // namespace

void writeFieldAsset(const FieldAsset& asset, const std::string& path) {
  validateAsset(asset, "asset", ErrorCode::kInvalidArgument);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetField);
  setSplatFlags(file, asset.colour_space, asset.antialias);
  file.setMetadata("frame", "right-handed, z up, metres");
  file.setMetadata("field_level", std::to_string(asset.field_level));
  file.setMetadata("K", std::to_string(asset.gaussians));
  file.setMetadata("sh_degree", std::to_string(asset.sh_degree));
  file.setMetadata("least_anchors", std::to_string(asset.least_anchors));
  file.setMetadata("most_anchors", std::to_string(asset.most_anchors));
  file.setMetadata("jitter", asset.jitter ? "leaf" : "none");
  if (asset.contracted) file.setMetadata("space", "contracted");
  if (asset.nested) {
    file.setMetadata("draws", "nested");
    file.setMetadata("seed", std::to_string(asset.seed));
  }
  file.setMetadata("settings", asset.settings_json);
  addOctree(file, asset);
  for (const auto& [name, tensor] : asset.tensors) file.add(name, tensor);
  addAssetExtras(file, asset.extras);
  file.write(path);
}

FieldAsset readFieldAsset(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetField);
  FieldAsset asset;
  static_cast<OctreeTensors&>(asset) = readOctree(file);
  readSplatFlags(file, asset.colour_space, asset.antialias);
  asset.jitter = isFirstText(file, "jitter", "leaf", "none");
  // Files of fields that learned with independent draws do not have it.
  asset.nested = file.metadata().contains("draws") && isFirstText(file, "draws", "nested", "any");
  if (asset.nested) asset.seed = requireWhole(file, "seed", 0, UINT64_MAX);
  asset.contracted =
      file.metadata().contains("space") && isFirstText(file, "space", "contracted", "plain");
  asset.field_level = static_cast<int>(requireWhole(file, "field_level", 1, 10));
  asset.gaussians = static_cast<uint32_t>(requireWhole(file, "K", 4, 32));
  asset.sh_degree = static_cast<int>(requireWhole(file, "sh_degree", 0, kMaxShDegree));
  asset.least_anchors = requireWhole(file, "least_anchors", 1, kMostAnchors);
  asset.most_anchors = requireWhole(file, "most_anchors", asset.least_anchors, kMostAnchors);
  asset.tensors = readNetworkTensors(file, kStem);
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  validateAsset(asset, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
