#include "train/anchors/relay_parts.h"

#include <string>
#include <utility>

#include "base/error.h"
#include "train/networks/trainer_tensors.h"

namespace stipple {

namespace {

std::string nameOf(RelayStage stage, uint32_t key) {
  if (stage == RelayStage::kGlobal) return "global";
  return (stage == RelayStage::kBlend ? "pair" : "key") + std::to_string(key) + ".stage" +
         std::to_string(static_cast<uint32_t>(stage));
}

}  // namespace

RelayParts::RelayParts(std::shared_ptr<KeyFrameStore> store, std::vector<RelaySegment> segments,
                       const ScaffoldShape& shape)
    : store_(std::move(store)), segments_(std::move(segments)), shape_(shape) {}

void RelayParts::put(const RelaySegment& segment, const KeyFrame& frame) {
  store_->put(nameOf(segment.stage, segment.key), tensorsOfKeyFrame(frame, ""));
}

void RelayParts::putBlends(const RelaySegment& segment,
                           const std::vector<std::vector<float>>& blends) {
  TensorTable table;
  putValues("blend.0", blends[0], table);
  putValues("blend.1", blends[1], table);
  store_->put(nameOf(segment.stage, segment.key), table);
}

TensorTable RelayParts::need(RelayStage stage, uint32_t key) const {
  std::optional<TensorTable> table = store_->get(nameOf(stage, key));
  if (table) return std::move(*table);
  fail(ErrorCode::kFormat,
       "the fit cannot go on: of its key frames, '" + nameOf(stage, key) + "' is not there");
}

KeyFrame RelayParts::keyFrame(RelayStage stage, uint32_t key) const {
  return keyFrameOfTensors(need(stage, key), "", shape_);
}

std::optional<KeyFrame> RelayParts::latest(uint32_t key, uint64_t steps) const {
  for (const RelayStage stage : {RelayStage::kWindow, RelayStage::kKeyFrame, RelayStage::kGlobal}) {
    if (!isFinished(stage, key, steps)) continue;
    KeyFrame frame = keyFrame(stage, key);
    for (uint32_t pair = key > 0 ? key - 1 : 0; pair <= key; ++pair) {
      takeBlend(pair, key, steps, frame);
    }
    return frame;
  }
  return {};
}

bool RelayParts::isFinished(RelayStage stage, uint32_t key, uint64_t steps) const {
  for (const RelaySegment& segment : segments_) {
    if (segment.stage == stage && (segment.key == key || stage == RelayStage::kGlobal)) {
      return segment.end <= steps;
    }
  }
  return false;
}

/// Of pair `pair`, what belongs to the key frame: forward numbers to its first, backward ones to
/// its second.
void RelayParts::takeBlend(uint32_t pair, uint32_t key, uint64_t steps, KeyFrame& frame) const {
  if (!isFinished(RelayStage::kBlend, pair, steps)) return;
  const TensorTable table = need(RelayStage::kBlend, pair);
  const bool is_first = pair == key;
  const std::vector<float> blend = takeValues<float>(table, is_first ? "blend.0" : "blend.1",
                                                     frame.blend.size(), frame.blend.size());
  for (size_t i = is_first ? 0 : 2; i < blend.size(); i += kBlendNumbers) {
    frame.blend[i] = blend[i];
    frame.blend[i + 1] = blend[i + 1];
  }
}

}  // namespace stipple
