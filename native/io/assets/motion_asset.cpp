#include "io/assets/motion_asset.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/number_text.h"
#include "io/assets/asset_time.h"
#include "io/assets/cloud_tensors.h"
#include "io/bytes/json_text.h"
#include "io/bytes/safetensors.h"

namespace stipple {

namespace {

using Json = nlohmann::json;

constexpr char kSplats[] = "motion.";
constexpr char kNodes[] = "tree.nodes.";
constexpr char kParents[] = "tree.parents";
constexpr char kErrors[] = "tree.errors";
constexpr char kClip[] = "clip";
constexpr uint64_t kMostFrames = uint64_t{1} << 24;

std::string waveName(const std::string& stem, size_t wave) {
  return stem + (wave % 2 == 0 ? "cosines." : "sines.") + std::to_string(wave / 2 + 1);
}

double lastSecond(const MotionAsset& asset) {
  return asset.begin + (asset.frame_count - 1) / asset.frames_per_second;
}

void validateClip(const MotionAsset& asset, const std::string& name, ErrorCode code) {
  const bool holds = std::isfinite(asset.begin) && std::isfinite(asset.frames_per_second) &&
                     asset.frames_per_second > 0 && asset.frame_count >= 1 &&
                     asset.frame_count <= kMostFrames && std::isfinite(lastSecond(asset)) &&
                     std::isfinite(asset.window_frames) && asset.window_frames >= 0 &&
                     asset.window_share > 0 && asset.window_share < 1;
  if (holds) return;
  fail(code, name + " has a clip of " + std::to_string(asset.frame_count) + " frames at " +
                 numberText(asset.frames_per_second) + " a second from " + numberText(asset.begin) +
                 " s, with a window of " + numberText(asset.window_frames) +
                 " frames and a share of " + numberText(asset.window_share) + "; 1 to " +
                 std::to_string(kMostFrames) +
                 " frames, a rate above 0, a window of 0 or more and a share between 0 and 1 are "
                 "needed");
}

/// Sizes that agree and splats that are splats.
void validateTensors(const MotionTensors& tensors, const std::string& stem, size_t count,
                     const std::string& name, ErrorCode code) {
  try {
    validate(tensors.splats, (name + ": " + stem.substr(0, stem.size() - 1)).c_str());
  } catch (const Error& error) {
    fail(code, error.what());
  }
  const auto requireColumn = [&](const std::string& what, const std::vector<float>& values,
                                 size_t width) {
    if (values.size() != count * width) {
      fail(code, name + ": " + what + " has " + std::to_string(values.size() / width) + " rows; " +
                     std::to_string(count) + " are needed, one for each splat");
    }
    for (const float value : values) {
      if (std::isfinite(value)) continue;
      fail(code, name + ": " + what + " holds " + std::to_string(value) +
                     "; every value must be a finite number");
    }
  };
  requireColumn(stem + "opacities", tensors.splats.opacities, 1);
  for (size_t wave = 0; wave < MotionTensors::kWaves; ++wave) {
    requireColumn(waveName(stem, wave), tensors.waves[wave], 3);
  }
  requireColumn(stem + "phases", tensors.phases, 4);
  requireColumn(stem + "spins", tensors.spins, 4);
  requireColumn(stem + "lifespans", tensors.lifespans, 2);
  requireColumn(stem + "centres", tensors.centres, 1);
}

void validateAsset(const MotionAsset& asset, const std::string& name, ErrorCode code) {
  const size_t count = asset.splats.size();
  validateTensors(asset, kSplats, count, name, code);
  if (count == 0) fail(code, name + " has 0 splats; at least 1 is needed");
  validateClip(asset, name, code);
  if (asset.parents.empty()) return;
  validateTensors(asset.nodes, kNodes, count - 1, name, code);
  const auto requireRows = [&](const char* what, size_t seen, size_t needed) {
    if (seen == needed) return;
    fail(code, name + ": " + what + " has " + std::to_string(seen) + " rows; " +
                   std::to_string(needed) + " are needed for " + std::to_string(count) + " splats");
  };
  requireRows(kErrors, asset.errors.size(), count - 1);
  requireRows(kParents, asset.parents.size(), 2 * count - 1);
}

void addTensors(SafeTensorsWriter& file, const std::string& stem, const MotionTensors& tensors) {
  addCloudTensors(file, stem, tensors.splats);
  for (size_t wave = 0; wave < MotionTensors::kWaves; ++wave) {
    file.add(waveName(stem, wave), tensors.waves[wave], 3);
  }
  file.add(stem + "phases", tensors.phases, 4);
  file.add(stem + "spins", tensors.spins, 4);
  file.add(stem + "lifespans", tensors.lifespans, 2);
  file.add(stem + "centres", tensors.centres, 1);
}

void readTensors(const SafeTensorsReader& file, const std::string& stem, const SplatCloud& flags,
                 MotionTensors& tensors) {
  tensors.splats = readCloudTensors(file, stem, flags);
  for (size_t wave = 0; wave < MotionTensors::kWaves; ++wave) {
    tensors.waves[wave] = file.readFloats(waveName(stem, wave), 3);
  }
  tensors.phases = file.readFloats(stem + "phases", 4);
  tensors.spins = file.readFloats(stem + "spins", 4);
  tensors.lifespans = file.readFloats(stem + "lifespans", 2);
  tensors.centres = file.readFloats(stem + "centres", 1);
}

void readClip(const SafeTensorsReader& file, MotionAsset& asset) {
  const Json clip =
      parseJson(requireText(file, kClip), file.path() + ": the metadata '" + kClip + "'");
  const auto number = [&](const char* key) {
    if (!clip.is_object() || !clip.contains(key) || !clip[key].is_number()) {
      fail(ErrorCode::kFormat, file.path() + " has a clip without a number '" + key + "'");
    }
    return clip[key].get<double>();
  };
  const double frames = number("frames");
  if (!(frames >= 1 && frames <= static_cast<double>(kMostFrames)) ||
      frames != std::floor(frames)) {
    fail(ErrorCode::kFormat, file.path() + " has a clip of " + numberText(frames) +
                                 " frames; a whole number from 1 to " +
                                 std::to_string(kMostFrames) + " is needed");
  }
  asset.frame_count = static_cast<uint32_t>(frames);
  asset.begin = number("begin");
  asset.frames_per_second = number("frames_per_second");
  asset.window_frames = number("window_frames");
  asset.window_share = number("window_share");
}

}  // namespace

void writeMotionAsset(const MotionAsset& asset, const std::string& path) {
  validateAsset(asset, "asset", ErrorCode::kInvalidArgument);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetMotion);
  setCloudFlags(file, asset.splats);
  file.setMetadata(kClip, Json({{"begin", asset.begin},
                                {"frames", asset.frame_count},
                                {"frames_per_second", asset.frames_per_second},
                                {"window_frames", asset.window_frames},
                                {"window_share", asset.window_share}})
                              .dump());
  file.setMetadata("settings",
                   settingsWithTime(asset.settings_json, {asset.begin, lastSecond(asset)}));
  addTensors(file, kSplats, asset);
  if (!asset.parents.empty()) {
    addTensors(file, kNodes, asset.nodes);
    file.add(kParents, asset.parents, 1);
    file.add(kErrors, asset.errors, 1);
  }
  addAssetExtras(file, asset.extras);
  file.write(path);
}

MotionAsset readMotionAsset(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetMotion);
  MotionAsset asset;
  const SplatCloud flags = readCloudFlags(file);
  readTensors(file, kSplats, flags, asset);
  if (file.tensors().contains(kParents)) {
    readTensors(file, kNodes, flags, asset.nodes);
    asset.parents = file.readUint32s(kParents, 1);
    asset.errors = file.readFloats(kErrors, 1);
    if (asset.parents.empty()) {
      fail(ErrorCode::kFormat, path + ": " + kParents + " has 0 rows; at least 1 is needed");
    }
  }
  readClip(file, asset);
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  validateAsset(asset, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
