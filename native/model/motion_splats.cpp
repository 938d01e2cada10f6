#include "model/motion_splats.h"

#include <string>
#include <utility>

#include "base/error.h"
#include "data/position_bounds.h"
#include "io/assets/motion_asset.h"
#include "model/moving_budgets.h"

namespace stipple {

namespace {

static_assert(MotionTensors::kWaves == kMotionWaves);

void store(const MotionCloud& moving, MotionTensors& tensors) {
  tensors.splats = moving.splats;
  tensors.waves = moving.waves;
  tensors.phases = moving.phases;
  tensors.spins = moving.spins;
  tensors.lifespans = moving.lifespans;
  tensors.centres = moving.centres;
}

MotionCloud restore(MotionTensors& tensors, const MotionClip& clip) {
  MotionCloud moving;
  moving.splats = std::move(tensors.splats);
  moving.waves = std::move(tensors.waves);
  moving.phases = std::move(tensors.phases);
  moving.spins = std::move(tensors.spins);
  moving.lifespans = std::move(tensors.lifespans);
  moving.centres = std::move(tensors.centres);
  moving.clip = clip;
  return moving;
}

class MotionSplats final : public SplatModel {
 public:
  MotionSplats(MotionCloud moving, ModelNotes notes, std::shared_ptr<const MovingTree> tree,
               MovingTreeSource trees)
      : decoder_(std::move(moving), std::move(tree), trees),
        notes_(std::move(notes)),
        trees_(std::move(trees)) {}

  const char* kind() const override { return kAssetMotion; }

  /// Bounds are those at the begin of the clip.
  ModelInfo info() const override {
    const MotionCloud& moving = decoder_.leaves();
    ModelInfo info;
    info.leaf_count = moving.size();
    info.sh_degree = moving.splats.sh_degree;
    fillBounds(splatsAt(moving, moving.clip.begin).positions, info.bounds_min.data(),
               info.bounds_max.data());
    return info;
  }

  void save(const std::string& path) const override {
    const MotionCloud& moving = decoder_.leaves();
    MotionAsset asset;
    store(moving, asset);
    if (const auto tree = decoder_.tree()) {
      store(tree->nodes, asset.nodes);
      asset.parents = tree->parents;
      asset.errors = tree->errors;
    }
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
    const MotionCloud& moving = decoder_.leaves();
    MotionCloud left = kept(moving, mask);
    if (left.size() == 0) {
      fail(ErrorCode::kInvalidArgument, "mask leaves out all " + std::to_string(moving.size()) +
                                            " splats; at least one must stay");
    }
    return makeMotionSplats(std::move(left), {}, nullptr, trees_);
  }

  uint64_t keepMemoryBound() const override {
    const MotionCloud& moving = decoder_.leaves();
    constexpr uint64_t kOfMotion = 3 * kMotionWaves + 4 + 4 + 2 + 1;
    constexpr uint64_t kOthers = 3 + 4 + 3 + 1;
    return moving.size() * (kOfMotion + kOthers + moving.splats.shStride()) * sizeof(float);
  }

 protected:
  const Decoder& decoder() const override { return decoder_; }

  void limit(ModelSettings& settings) const override {
    const MotionCloud& moving = decoder_.leaves();
    settings.maximum_budget = settings.default_budget = moving.size();
    settings.time = TimeRange{moving.clip.begin, moving.clip.end()};
  }

 private:
  MovingDecoder decoder_;
  ModelNotes notes_;
  MovingTreeSource trees_;  ///< for what keep() leaves
};

}  // namespace

std::shared_ptr<const SplatModel> makeMotionSplats(MotionCloud moving, ModelNotes notes,
                                                   std::shared_ptr<const MovingTree> tree,
                                                   MovingTreeSource trees) {
  validate(moving, "moving splats");
  if (moving.size() == 0) {
    fail(ErrorCode::kInvalidArgument, "there are 0 moving splats; at least 1 is needed");
  }
  if (tree) validate(tree->nodes, "inner nodes of moving splats");
  return std::make_shared<const MotionSplats>(std::move(moving), std::move(notes), std::move(tree),
                                              std::move(trees));
}

std::shared_ptr<const SplatModel> readMotionSplats(const std::string& path, const ReadingAid& aid) {
  MotionAsset asset = readMotionAsset(path);
  ModelNotes notes = {std::move(asset.settings_json), std::move(asset.extras)};
  const MotionClip clip = {asset.begin, asset.frames_per_second, asset.frame_count,
                           asset.window_frames, asset.window_share};
  std::shared_ptr<MovingTree> tree;
  if (!asset.parents.empty()) {
    tree = std::make_shared<MovingTree>();
    tree->nodes = restore(asset.nodes, clip);
    tree->parents = std::move(asset.parents);
    tree->errors = std::move(asset.errors);
  }
  try {
    return makeMotionSplats(restore(asset, clip), std::move(notes), std::move(tree),
                            movingTreesByViews(aid.backends));
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
}

}  // namespace stipple
