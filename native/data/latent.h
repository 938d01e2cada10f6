#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stipple {

/// Where decoded splats stand: a position p of the networks becomes scale p + offset.
struct LatentPlacement {
  double scale = 1.0;                        ///< above 0
  std::array<double, 3> offset = {0, 0, 0};  ///< metres
};

/// What networks learned with, which says where they may be trusted. The defaults are those of the
/// published networks.
struct LatentRange {
  int leaf_level = 8;  ///< leaf cells along each side, as a power of two
  uint64_t least_anchors = 1024, most_anchors = 8192, usual_anchors = 2048;
};

/// A code that the decoders of density-sampled Gaussians turn into splats at any budget, with the
/// camera that the flow network saw the object by.
struct Latent {
  uint64_t token_count = 0;
  uint32_t width = 16;
  std::vector<float> tokens;  ///< [token_count, width]
  /// Direction from the origin to the camera (3), 1 / distance (0: orthographic), distance *
  /// tan(field of view / 2), or half of an orthographic scale. All 0 where there is none.
  std::array<float, 5> camera = {0, 0, 0, 0, 0};
  LatentPlacement placement;
};

}  // namespace stipple
