#include "io/assets/scaffold_asset.h"

#include "io/assets/network_tensors.h"

namespace stipple {

namespace {

constexpr char kStem[] = "scaffold.";
constexpr uint64_t kMostGaussians = 32;
constexpr char kCoarsening[] = "coarsening_percent";

}  // namespace

void writeScaffoldAsset(const ScaffoldAsset& asset, const std::string& path) {
  requireNetworkTensors(asset.tensors, kStem, "asset", ErrorCode::kInvalidArgument);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetScaffold);
  setSplatFlags(file, asset.colour_space, asset.antialias);
  file.setMetadata("frame", "right-handed, z up, metres");
  file.setMetadata("K", std::to_string(asset.gaussians));
  file.setMetadata("sh_degree", std::to_string(asset.sh_degree));
  if (asset.coarsening_percent > 0) {
    file.setMetadata(kCoarsening, std::to_string(asset.coarsening_percent));
  }
  file.setMetadata("settings", asset.settings_json);
  for (const auto& [name, tensor] : asset.tensors) file.add(name, tensor);
  addAssetExtras(file, asset.extras);
  file.write(path);
}

ScaffoldAsset readScaffoldAsset(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetScaffold);
  ScaffoldAsset asset;
  readSplatFlags(file, asset.colour_space, asset.antialias);
  asset.gaussians = static_cast<uint32_t>(requireWhole(file, "K", 1, kMostGaussians));
  asset.sh_degree = static_cast<int>(requireWhole(file, "sh_degree", 0, kMaxShDegree));
  if (file.metadata().contains(kCoarsening)) {
    asset.coarsening_percent = static_cast<uint32_t>(requireWhole(file, kCoarsening, 0, 100));
  }
  asset.tensors = readNetworkTensors(file, kStem);
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  requireNetworkTensors(asset.tensors, kStem, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
