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
constexpr size_t kHashDigits = 64;
constexpr size_t kLongestName = 255;

void requireNumbers(std::span<const float> values, const std::string& name, const char* tensor,
                    ErrorCode code) {
  for (const float value : values) {
    if (std::isfinite(value)) continue;
    fail(code, name + ": tensor " + tensor + " holds " + std::to_string(value) +
                   "; every value must be a finite number");
  }
}

void validateWeights(const WeightsReference& weights, const std::string& name, ErrorCode code) {
  // It is looked for in a folder of the user's, and nowhere else.
  const bool is_name = !weights.name.empty() && weights.name.size() <= kLongestName &&
                       weights.name.find_first_of(std::string("/\\\0", 3)) == std::string::npos &&
                       weights.name != "." && weights.name != "..";
  if (!is_name) {
    fail(code, name + " names its file of weights '" + weights.name.substr(0, 60) +
                   "'; a file name without folders is needed");
  }
  if (weights.bytes == 0) fail(code, name + " says that its file of weights has 0 bytes");
  const bool is_hash = weights.sha256.size() == kHashDigits &&
                       weights.sha256.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (!is_hash) {
    fail(code, name + " has the weights_sha256 '" + weights.sha256.substr(0, 70) +
                   "'; 64 hexadecimal digits in lower case are needed");
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
  validateWeights(asset.weights, name, code);
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
