#include "model/motion_splats.h"

#include <string>
#include <utility>

#include "base/error.h"
#include "data/position_bounds.h"
#include "io/assets/motion_asset.h"

namespace stipple {

namespace {

static_assert(MotionAsset::kWaves == kMotionWaves);

/// All splats at the time of the request.
class MotionDecoder final : public Decoder {
 public:
  explicit MotionDecoder(MotionCloud moving) : moving_(std::move(moving)) {}

  SplatCloud decode(const DecodeRequest& request) const override {
    return splatsAt(moving_, request.time);
  }
  uint64_t memoryBound(uint64_t budget, uint32_t) const override {
    constexpr uint64_t kOthers = 3 + 4 + 3 + 1;
    return budget * (kOthers + moving_.splats.shStride()) * sizeof(float);
  }

  const MotionCloud& moving() const { return moving_; }

 private:
  MotionCloud moving_;
};

class MotionSplats final : public SplatModel {
 public:
  MotionSplats(MotionCloud moving, ModelNotes notes)
      : decoder_(std::move(moving)), notes_(std::move(notes)) {}

  const char* kind() const override { return kAssetMotion; }

  /// Bounds are those at the begin of the clip.
  ModelInfo info() const override {
    const MotionCloud& moving = decoder_.moving();
    ModelInfo info;
    info.leaf_count = moving.size();
    info.sh_degree = moving.splats.sh_degree;
    fillBounds(splatsAt(moving, moving.clip.begin).positions, info.bounds_min.data(),
               info.bounds_max.data());
    return info;
  }

  void save(const std::string& path) const override {
    const MotionCloud& moving = decoder_.moving();
    MotionAsset asset;
    asset.splats = moving.splats;
    asset.waves = moving.waves;
    asset.phases = moving.phases;
    asset.spins = moving.spins;
    asset.lifespans = moving.lifespans;
    asset.centres = moving.centres;
    asset.begin = moving.clip.begin;
    asset.frames_per_second = moving.clip.frames_per_second;
    asset.frame_count = moving.clip.frame_count;
    asset.window_frames = moving.clip.window_frames;
    asset.window_share = moving.clip.window_share;
    asset.settings_json = notes_.settings_json;
    asset.extras = notes_.extras;
    writeMotionAsset(asset, path);
  }

  std::shared_ptr<const SplatModel> keep(std::span<const uint8_t> mask) const override {
    const MotionCloud& moving = decoder_.moving();
    MotionCloud left = kept(moving, mask);
    if (left.size() == 0) {
      fail(ErrorCode::kInvalidArgument, "mask leaves out all " + std::to_string(moving.size()) +
                                            " splats; at least one must stay");
    }
    return makeMotionSplats(std::move(left));
  }

  uint64_t keepMemoryBound() const override {
    const MotionCloud& moving = decoder_.moving();
    constexpr uint64_t kOfMotion = 3 * kMotionWaves + 4 + 4 + 2 + 1;
    constexpr uint64_t kOthers = 3 + 4 + 3 + 1;
    return moving.size() * (kOfMotion + kOthers + moving.splats.shStride()) * sizeof(float);
  }

 protected:
  const Decoder& decoder() const override { return decoder_; }

  void limit(ModelSettings& settings) const override {
    const MotionCloud& moving = decoder_.moving();
    settings.minimum_budget = settings.maximum_budget = settings.default_budget = moving.size();
    settings.time = TimeRange{moving.clip.begin, moving.clip.end()};
  }

 private:
  MotionDecoder decoder_;
  ModelNotes notes_;
};

}  // namespace

std::shared_ptr<const SplatModel> makeMotionSplats(MotionCloud moving, ModelNotes notes) {
  validate(moving, "moving splats");
  if (moving.size() == 0) {
    fail(ErrorCode::kInvalidArgument, "there are 0 moving splats; at least 1 is needed");
  }
  return std::make_shared<const MotionSplats>(std::move(moving), std::move(notes));
}

std::shared_ptr<const SplatModel> readMotionSplats(const std::string& path, const ReadingAid&) {
  MotionAsset asset = readMotionAsset(path);
  ModelNotes notes = {std::move(asset.settings_json), std::move(asset.extras)};
  MotionCloud moving;
  moving.splats = std::move(asset.splats);
  moving.waves = std::move(asset.waves);
  moving.phases = std::move(asset.phases);
  moving.spins = std::move(asset.spins);
  moving.lifespans = std::move(asset.lifespans);
  moving.centres = std::move(asset.centres);
  moving.clip = {asset.begin, asset.frames_per_second, asset.frame_count, asset.window_frames,
                 asset.window_share};
  try {
    return makeMotionSplats(std::move(moving), std::move(notes));
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
}

}  // namespace stipple
