#include "io/assets/field_asset.h"

#include <cmath>

#include "base/error.h"
#include "io/splats/ply/ply_file.h"

namespace stipple {

namespace {

constexpr char kStem[] = "field.";
constexpr uint64_t kMostAnchors = uint64_t{1} << 28;

bool isFieldTensor(const std::string& name) {
  return name.rfind(kStem, 0) == 0;
}

void validateAsset(const FieldAsset& asset, const std::string& name, ErrorCode code) {
  validateOctree(asset, name, code);
  if (asset.least_anchors < 1 || asset.least_anchors > asset.most_anchors) {
    fail(code, name + " has budgets " + std::to_string(asset.least_anchors) + " to " +
                   std::to_string(asset.most_anchors) + "; at least 1, ascending, is needed");
  }
  if (asset.tensors.empty()) fail(code, name + " has no tensors of a field; they are needed");
  for (const auto& [tensor_name, tensor] : asset.tensors) {
    const auto* values = std::get_if<std::vector<float>>(&tensor.values);
    if (!isFieldTensor(tensor_name) || values == nullptr) {
      fail(code, name + ": tensor " + tensor_name +
                     " is not one of a field; names begin with 'field.', values are float32");
    }
    for (const float value : *values) {
      if (std::isfinite(value)) continue;
      fail(code, name + ": tensor " + tensor_name + " holds " + std::to_string(value) +
                     "; every value must be a finite number");
    }
  }
}

}  // namespace

void writeFieldAsset(const FieldAsset& asset, const std::string& path) {
  validateAsset(asset, "asset", ErrorCode::kInvalidArgument);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetField);
  const bool display = asset.colour_space == ColourSpace::kDisplay;
  file.setMetadata("colour_space", display ? kColourSpaceDisplay : kColourSpaceLinear);
  file.setMetadata("antialias", asset.antialias == Antialias::kMip ? "mip" : "classic");
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
  asset.colour_space = isFirstText(file, "colour_space", kColourSpaceDisplay, kColourSpaceLinear)
                           ? ColourSpace::kDisplay
                           : ColourSpace::kLinear;
  asset.antialias =
      isFirstText(file, "antialias", "mip", "classic") ? Antialias::kMip : Antialias::kClassic;
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
  for (const auto& [name, tensor] : file.tensors()) {
    if (isFieldTensor(name)) asset.tensors[name] = file.readTensor(name);
  }
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  validateAsset(asset, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
