#pragma once

#include <span>

#include "splat/render/render.h"

namespace stipple {

/// One cloud of many, each moved by its matrix (see cloud_transform.h; the identity keeps every
/// bit) with its grade baked in, in the order given. Harmonics of lower degree are padded with
/// zeros. In: frame: what the matrices lead to; the result is labelled so. Errors: kUnsupported
/// where the clouds disagree in colour space or antialias flag: neither can be changed without
/// changing the picture. kInvalidArgument for a cloud or matrix that `transformed` refuses.
SplatCloud merged(std::span<const SplatInstance> instances, Frame frame);

/// Bytes that merged() needs at most, result included.
uint64_t mergeMemoryBound(std::span<const SplatInstance> instances);

}  // namespace stipple
