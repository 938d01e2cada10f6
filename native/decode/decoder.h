#pragma once

#include <cstdint>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "density/anchor_sampling.h"

namespace stipple {

/// What a decoder turns into splats: the whole anchor set, in one call.
struct DecodeRequest {
  const AnchorSet* anchors = nullptr;
  uint64_t budget = 0;  ///< P; only decoders without anchors (an existing cloud) read it
  uint32_t gaussians_per_anchor = 1;  ///< K
  double time = 0.0;                  ///< seconds, finite; only decoders of moving splats read it
  uint64_t seed = 0;
  Progress* progress = nullptr;
};

class Decoder {
 public:
  virtual ~Decoder() = default;
  /// anchors → anchors * K splats, in anchor order.
  virtual SplatCloud decode(const DecodeRequest& request) const = 0;
  /// For a decoder without anchors: the same for a budget that moves, up to twice as many splats,
  /// so that none of them jumps. Errors: kUnsupported for others, whose anchors tell what grows
  /// from what (growthOfAnchors).
  virtual SplatCloud decodeSmooth(const DecodeRequest& request) const;
  /// Bytes that decode holds at most, the splats included, without the anchors.
  virtual uint64_t memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const = 0;
};

}  // namespace stipple
