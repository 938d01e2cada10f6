#pragma once

#include <memory>
#include <vector>

#include "decode/anchors/key_frame.h"
#include "model/splat_model.h"

namespace stipple {

/// The kind "relay": a long clip as anchors at key frames, each with its deformation, two of which
/// are blended at a time. In: frames of all of the clip's key frames.
/// Errors: kInvalidArgument for a clip and frames that do not fit together.
std::shared_ptr<const SplatModel> makeRelaySplats(
    const KeyFrameClip& clip, std::vector<std::shared_ptr<const KeyFrame>> frames,
    ModelNotes notes = {});

}  // namespace stipple
