#include "io/assets/latent_asset.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "base/error.h"

namespace stipple {

namespace {

constexpr char kTokens[] = "latent.tokens";
constexpr char kCamera[] = "latent.camera";
// Scale and offset; files whose object lies as the networks have it do not have it.
constexpr char kPlacement[] = "latent.placement";

void requireNumbers(std::span<const float> values, const std::string& name, const char* tensor,
                    ErrorCode code) {
  for (const float value : values) {
    if (std::isfinite(value)) continue;
    fail(code, name + ": tensor " + tensor + " holds " + std::to_string(value) +
                   "; every value must be a finite number");
  }
}

void validateAsset(const LatentAsset& asset, const std::string& name, ErrorCode code) {
  const Latent& latent = asset.latent;
  if (latent.token_count < 1 || latent.token_count > kMaxLatentTokens || latent.width < 1 ||
      latent.width > kMaxLatentWidth || latent.tokens.size() != latent.token_count * latent.width) {
    fail(code, name + " has a latent of " + std::to_string(latent.token_count) + " tokens of " +
                   std::to_string(latent.width) + " numbers, " +
                   std::to_string(latent.tokens.size()) + " in all; 1 to " +
                   std::to_string(kMaxLatentTokens) + " tokens of 1 to " +
                   std::to_string(kMaxLatentWidth) + " are allowed");
  }
  requireNumbers(latent.tokens, name, kTokens, code);
  requireNumbers(latent.camera, name, kCamera, code);
  const LatentPlacement& placement = latent.placement;
  bool is_placed = std::isfinite(placement.scale) && placement.scale > 0;
  for (const double offset : placement.offset) is_placed = is_placed && std::isfinite(offset);
  if (!is_placed) {
    fail(code, name + " has a tensor " + kPlacement +
                   " that no object stands by; a scale above 0 and a finite offset are needed");
  }
  validate(asset.weights, name, code);
}

LatentPlacement readPlacement(const SafeTensorsReader& file) {
  LatentPlacement placement;
  if (!file.tensors().contains(kPlacement)) return placement;
  const Tensor stored = file.readTensor(kPlacement);
  const auto* values = std::get_if<std::vector<double>>(&stored.values);
  if (values == nullptr || values->size() != 4) {
    fail(ErrorCode::kFormat, file.path() + ": tensor " + kPlacement + " is not F64 of shape [4]");
  }
  placement.scale = (*values)[0];
  std::copy(values->begin() + 1, values->end(), placement.offset.begin());
  return placement;
}

Latent readLatent(const SafeTensorsReader& file) {
  Latent latent;
  const Tensor tokens = file.readTensor(kTokens);
  const auto* values = std::get_if<std::vector<float>>(&tokens.values);
  if (values == nullptr || tokens.shape.size() != 2 || tokens.shape[1] < 1 ||
      tokens.shape[1] > kMaxLatentWidth) {
    fail(ErrorCode::kFormat, file.path() + ": tensor " + kTokens +
                                 " is not F32 of shape [tokens, width] with a width of 1 to " +
                                 std::to_string(kMaxLatentWidth));
  }
  latent.token_count = tokens.shape[0];
  latent.width = static_cast<uint32_t>(tokens.shape[1]);
  latent.tokens = *values;
  const std::vector<float> camera = file.readFloats(kCamera, 1);
  if (camera.size() != latent.camera.size()) {
    fail(ErrorCode::kFormat, file.path() + ": tensor " + kCamera + " has " +
                                 std::to_string(camera.size()) + " numbers; 5 are needed");
  }
  std::copy(camera.begin(), camera.end(), latent.camera.begin());
  latent.placement = readPlacement(file);
  return latent;
}

}  // namespace

void writeLatentAsset(const LatentAsset& asset, const std::string& path) {
  validateAsset(asset, "asset", ErrorCode::kInvalidArgument);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetLatent);
  file.setMetadata("frame", "right-handed, z up, unit cube");
  file.setMetadata("weights_file", asset.weights.name);
  file.setMetadata("weights_bytes", std::to_string(asset.weights.bytes));
  file.setMetadata("weights_sha256", asset.weights.sha256);
  file.setMetadata("settings", asset.settings_json);
  const std::vector<float> camera(asset.latent.camera.begin(), asset.latent.camera.end());
  file.add(kTokens, asset.latent.tokens, asset.latent.width);
  file.add(kCamera, camera, 1);
  const LatentPlacement& where = asset.latent.placement;
  const Tensor placement = {
      {4}, std::vector<double>{where.scale, where.offset[0], where.offset[1], where.offset[2]}};
  if (where.scale != 1 || where.offset != std::array<double, 3>{}) file.add(kPlacement, placement);
  addAssetExtras(file, asset.extras);
  file.write(path);
}

LatentAsset readLatentAsset(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetLatent);
  LatentAsset asset;
  asset.latent = readLatent(file);
  asset.weights.name = requireText(file, "weights_file");
  asset.weights.bytes = requireWhole(file, "weights_bytes", 1, UINT64_MAX);
  asset.weights.sha256 = requireText(file, "weights_sha256");
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  validateAsset(asset, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
