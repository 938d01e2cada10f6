#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "splat/render/render.h"

namespace stipple {

/// The placed clouds of a picture, with shares that keep the clouds alive while it is made.
struct Instances {
  std::vector<std::shared_ptr<const SplatCloud>> shares;
  std::vector<SplatInstance> list;
};

/// Splats of all instances together.
uint64_t splatCount(const Instances& instances);

/// True when the composited values are display values.
bool compositesInDisplaySpace(const Instances& instances, BlendSpace blend_space);

}  // namespace stipple
