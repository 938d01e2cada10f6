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

constexpr char kStem[] = "motion.";
constexpr char kClip[] = "clip";
constexpr uint64_t kMostFrames = uint64_t{1} << 24;

std::string waveName(size_t wave) {
  return (wave % 2 == 0 ? "motion.cosines." : "motion.sines.") + std::to_string(wave / 2 + 1);
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

/// Sizes that agree and splats that are splats, for an asset from either side.
void validateAsset(const MotionAsset& asset, const std::string& name, ErrorCode code) {
  try {
    validate(asset.splats, (name + ": motion").c_str());
  } catch (const Error& error) {
    fail(code, error.what());
  }
  const size_t count = asset.splats.size();
  if (count == 0) fail(code, name + " has 0 splats; at least 1 is needed");
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
  for (size_t wave = 0; wave < MotionAsset::kWaves; ++wave) {
    requireColumn(waveName(wave), asset.waves[wave], 3);
  }
  requireColumn("motion.phases", asset.phases, 4);
  requireColumn("motion.spins", asset.spins, 4);
  requireColumn("motion.lifespans", asset.lifespans, 2);
  requireColumn("motion.centres", asset.centres, 1);
  validateClip(asset, name, code);
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
  addCloudTensors(file, kStem, asset.splats);
  for (size_t wave = 0; wave < MotionAsset::kWaves; ++wave) {
    file.add(waveName(wave), asset.waves[wave], 3);
  }
  file.add("motion.phases", asset.phases, 4);
  file.add("motion.spins", asset.spins, 4);
  file.add("motion.lifespans", asset.lifespans, 2);
  file.add("motion.centres", asset.centres, 1);
  addAssetExtras(file, asset.extras);
  file.write(path);
}

MotionAsset readMotionAsset(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetMotion);
  MotionAsset asset;
  asset.splats = readCloudTensors(file, kStem, readCloudFlags(file));
  for (size_t wave = 0; wave < MotionAsset::kWaves; ++wave) {
    asset.waves[wave] = file.readFloats(waveName(wave), 3);
  }
  asset.phases = file.readFloats("motion.phases", 4);
  asset.spins = file.readFloats("motion.spins", 4);
  asset.lifespans = file.readFloats("motion.lifespans", 2);
  asset.centres = file.readFloats("motion.centres", 1);
  readClip(file, asset);
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  validateAsset(asset, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
