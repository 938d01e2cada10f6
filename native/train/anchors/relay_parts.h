#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "data/tensor_table.h"
#include "decode/anchors/key_frame.h"
#include "train/anchors/key_frame_store.h"
#include "train/anchors/relay_segments.h"

namespace stipple {

/// What a fit of a long clip has finished: each part is written once, at the end of its segment,
/// and read when its turn comes. `steps`, where asked for, are those that the fit has done.
class RelayParts {
 public:
  /// In: shape: what anchors of all key frames have in common.
  RelayParts(std::shared_ptr<KeyFrameStore> store, std::vector<RelaySegment> segments,
             const ScaffoldShape& shape);

  const std::vector<RelaySegment>& segments() const { return segments_; }

  /// Errors: kIo.
  void put(const RelaySegment& segment, const KeyFrame& frame);
  void putBlends(const RelaySegment& segment, const std::vector<std::vector<float>>& blends);

  /// What a segment has made of its key frame. Errors: kFormat: it is not there; kIo.
  KeyFrame keyFrame(RelayStage stage, uint32_t key) const;
  /// The last finished stage of a key frame, with what its blending has come to. Empty while the
  /// global anchors, which all begin with, are under way. Errors: as keyFrame().
  std::optional<KeyFrame> latest(uint32_t key, uint64_t steps) const;
  bool isFinished(RelayStage stage, uint32_t key, uint64_t steps) const;

 private:
  TensorTable need(RelayStage stage, uint32_t key) const;
  void takeBlend(uint32_t pair, uint32_t key, uint64_t steps, KeyFrame& frame) const;

  std::shared_ptr<KeyFrameStore> store_;
  std::vector<RelaySegment> segments_;
  ScaffoldShape shape_;
};

}  // namespace stipple
