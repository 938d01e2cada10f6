#pragma once

#include <memory>

#include "decode/anchors/key_frame.h"
#include "model/splat_model.h"

namespace stipple {

/// The kind "relay": a long clip as anchors at key frames, each with its deformation, two of which
/// are blended at a time. In: frames, each of the clip's key frames, the same whenever it is asked
/// for: a few of them are kept. Errors: kInvalidArgument for a clip and frames that do not fit
/// together; those of frames.
std::shared_ptr<const SplatModel> makeRelaySplats(const KeyFrameClip& clip,
                                                  const KeyFrameSource& frames,
                                                  ModelNotes notes = {});

}  // namespace stipple
