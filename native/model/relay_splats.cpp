#include "model/relay_splats.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <mutex>
#include <string>
#include <utility>

#include "base/error.h"
#include "io/assets/relay_asset.h"

namespace stipple {

namespace {

/// The two that show a time, and the one that comes next.
constexpr size_t kKeptKeyFrames = 3;

ScaffoldShape shapeOf(const RelayAssetHead& head) {
  return {head.gaussians, head.sh_degree, head.colour_space, head.antialias, 0};
}

KeyFrameClip clipOf(const RelayAssetHead& head) {
  return {head.begin,
          head.frames_per_second,
          head.frame_count,
          head.spacing,
          static_cast<KeyFrameBlend>(head.blend),
          head.first_key};
}

/// Key frames from a source, of which a few are at hand.
class KeptKeyFrames {
 public:
  explicit KeptKeyFrames(KeyFrameSource source) : source_(std::move(source)) {}

  std::shared_ptr<const KeyFrame> frame(uint32_t key) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& [known, frame] : kept_) {
      if (known == key) return frame;
    }
    std::shared_ptr<const KeyFrame> frame = source_(key);
    kept_.emplace_back(key, frame);
    if (kept_.size() > kKeptKeyFrames) kept_.pop_front();
    return frame;
  }

 private:
  KeyFrameSource source_;
  mutable std::mutex mutex_;
  mutable std::deque<std::pair<uint32_t, std::shared_ptr<const KeyFrame>>> kept_;
};

KeyFrameSource keptFrames(KeyFrameSource source) {
  return [kept = std::make_shared<const KeptKeyFrames>(std::move(source))](uint32_t key) {
    return kept->frame(key);
  };
}

std::shared_ptr<const KeyFrame> frameOfFile(const RelayAsset& asset, const std::string& path,
                                            uint32_t key) {
  try {
    auto frame = std::make_shared<const KeyFrame>(
        keyFrameOfTensors(asset.key(key), "", shapeOf(asset.head())));
    if (frame->scaffold.size() == asset.head().anchor_counts[key]) return frame;
    fail(ErrorCode::kFormat, "key frame " + std::to_string(key) + " has " +
                                 std::to_string(frame->scaffold.size()) + " anchors; " +
                                 std::to_string(asset.head().anchor_counts[key]) + " are needed");
  } catch (const Error& error) {
    fail(error.code(), path + ": " + error.what());
  }
}

class RelayDecoder final : public Decoder {
 public:
  RelayDecoder(const RelayAssetHead& head, KeyFrameSource frames)
      : clip_(clipOf(head)),
        most_(mostAnchors(clip_, head.anchor_counts)),
        gaussians_(head.gaussians),
        numbers_(11 + shCoefficientCount(head.sh_degree) * 3),
        frames_(std::move(frames)) {}

  SplatCloud decode(const DecodeRequest& request) const override {
    if (request.gaussians_per_anchor != gaussians_) {
      fail(ErrorCode::kInvalidArgument,
           "gaussians per anchor is " + std::to_string(request.gaussians_per_anchor) +
               "; these anchors were learned with " + std::to_string(gaussians_));
    }
    advance(request.progress, 0.0, "Decoding splats");
    return splatsOfClip(clip_, frames_, request.time, request.budget);
  }

  uint64_t memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const override {
    // Splats twice while two key frames are joined; what networks make of an anchor.
    constexpr uint64_t kOfNetworks = 1200;
    const uint64_t splats = 2 * gaussians_per_anchor * (numbers_ + 8);
    return anchor_count * (splats + kOfNetworks) * sizeof(float) + (uint64_t{64} << 20);
  }

  uint64_t most() const { return most_; }
  const KeyFrameClip& clip() const { return clip_; }
  const KeyFrameSource& frames() const { return frames_; }

 private:
  KeyFrameClip clip_;
  uint64_t most_;
  uint32_t gaussians_;
  uint64_t numbers_;
  KeyFrameSource frames_;
};

class RelaySplats final : public SplatModel {
 public:
  RelaySplats(RelayAssetHead head, KeyFrameSource frames)
      : head_(std::move(head)), decoder_(head_, std::move(frames)) {}

  const char* kind() const override { return kAssetRelay; }

  /// Bounds are those of the anchors of all key frames.
  ModelInfo info() const override {
    ModelInfo info;
    for (const uint64_t count : head_.anchor_counts) info.leaf_count += count;
    info.sh_degree = head_.sh_degree;
    for (size_t axis = 0; axis < 3; ++axis) {
      info.bounds_min[axis] = static_cast<float>(head_.bounds[axis]);
      info.bounds_max[axis] = static_cast<float>(head_.bounds[3 + axis]);
    }
    return info;
  }

  void save(const std::string& path) const override {
    writeRelayAsset(
        head_, [this](uint32_t key) { return tensorsOfKeyFrame(*decoder_.frames()(key), ""); },
        path);
  }

 protected:
  const Decoder& decoder() const override { return decoder_; }

  void limit(ModelSettings& settings) const override {
    settings.maximum_budget = settings.default_budget = decoder_.most();
    settings.minimum_gaussians_per_anchor = head_.gaussians;
    settings.maximum_gaussians_per_anchor = head_.gaussians;
    settings.default_gaussians_per_anchor = head_.gaussians;
    settings.time = TimeRange{decoder_.clip().begin, decoder_.clip().end()};
  }

 private:
  RelayAssetHead head_;
  RelayDecoder decoder_;
};

}  // namespace

std::shared_ptr<const SplatModel> makeRelaySplats(const KeyFrameClip& clip,
                                                  const KeyFrameSource& frames, ModelNotes notes) {
  validate(clip);
  RelayAssetHead head;
  head.begin = clip.begin;
  head.frames_per_second = clip.frames_per_second;
  head.frame_count = clip.frame_count;
  head.first_key = clip.first_key;
  head.spacing = clip.spacing;
  head.blend = static_cast<uint32_t>(clip.blend);
  head.settings_json = std::move(notes.settings_json);
  head.extras = std::move(notes.extras);
  std::fill_n(head.bounds.begin(), 3, INFINITY);
  std::fill_n(head.bounds.begin() + 3, 3, -INFINITY);
  for (uint32_t key = 0; key < clip.keyCount(); ++key) {
    const std::shared_ptr<const KeyFrame> frame = frames(key);
    if (!frame) {
      fail(ErrorCode::kInvalidArgument, "the clip has " + std::to_string(key) +
                                            " key frames; of its frames it needs " +
                                            std::to_string(clip.keyCount()));
    }
    const ScaffoldParameters& scaffold = frame->scaffold;
    head.gaussians = scaffold.gaussians;
    head.sh_degree = scaffold.sh_degree;
    head.colour_space = scaffold.colour_space;
    head.antialias = scaffold.antialias;
    head.anchor_counts.push_back(scaffold.size());
    if (scaffold.size() == 0) {
      fail(ErrorCode::kInvalidArgument, "a key frame has 0 anchors; at least 1 is needed");
    }
    for (size_t i = 0; i < scaffold.positions.size(); ++i) {
      const double value = static_cast<double>(scaffold.positions[i]);
      head.bounds[i % 3] = std::min(head.bounds[i % 3], value);
      head.bounds[3 + i % 3] = std::max(head.bounds[3 + i % 3], value);
    }
  }
  return std::make_shared<const RelaySplats>(std::move(head), keptFrames(frames));
}

std::shared_ptr<const SplatModel> readRelaySplats(const std::string& path, const ReadingAid&) {
  auto asset = std::make_shared<const RelayAsset>(path);
  const size_t count = asset->head().anchor_counts.size();
  const KeyFrameClip clip = clipOf(asset->head());
  const uint32_t needed = clip.keyCount();
  if (count != needed) {
    fail(ErrorCode::kFormat, path + " has " + std::to_string(count) +
                                 " key frames; of its frames it needs " + std::to_string(needed));
  }
  try {
    validate(clip);
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
  const KeyFrameSource frames =
      keptFrames([asset, path](uint32_t key) { return frameOfFile(*asset, path, key); });
  frames(0);  // says now what is wrong with it
  return std::make_shared<const RelaySplats>(asset->head(), frames);
}

}  // namespace stipple
