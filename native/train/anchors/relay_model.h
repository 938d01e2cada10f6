#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "base/progress.h"
#include "data/views/view_source.h"
#include "decode/anchors/key_frame.h"
#include "train/anchors/key_frame_store.h"
#include "train/anchors/scaffold_model.h"
#include "train/backend/backend_factory.h"
#include "train/loop/fit_model.h"

namespace stipple {

struct RelayModelOptions {
  ScaffoldModelOptions anchors;  ///< of each key frame
  KeyFrameClip clip;
  bool grows_by_level = true;  ///< anchors with varied features grow late
  /// Ranks of features, 0..1, at which the middle and the high level begin.
  std::array<double, 2> level_quantiles = {0.5, 0.8};
  /// By which gradients of these two levels count at the begin of a segment, 0..1; the weights rise
  /// to 1 at its end.
  std::array<double, 2> level_weights = {0.25, 0.0};
  uint64_t iterations = 30000;
};

/// One model over a long clip: anchors at key frames, deformed until the neighbouring key frames,
/// and blended between. Only one key frame is at hand in the first three stages, and two in the
/// fourth; all others are in the store. See docs/methods/relay.md.
/// In: store, in which a fit that begins finds nothing and one that goes on what it put there.
/// Errors: kInvalidArgument for no views, options out of range.
std::unique_ptr<FitModel> makeRelayModel(const BackendFactory& backends, const ViewSource& views,
                                         std::span<const size_t> training,
                                         const RelayModelOptions& options,
                                         std::shared_ptr<KeyFrameStore> store,
                                         Progress* progress = nullptr);

/// Key frames as such a fit has them now, the last finished stage of each, which are read from the
/// store whenever they are asked for; null for other models.
KeyFrameSource relayResult(const FitModel& model);

}  // namespace stipple
