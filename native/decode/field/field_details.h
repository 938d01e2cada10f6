#pragma once

#include <cstddef>
#include <span>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// What is read where a Gaussian is: numbers added to its first harmonic (3), the logit of its
/// opacity and the logarithms of its scales (one for all), an offset in units of its footprint (3),
/// and its shape: the logarithm of each scale (3), and a turn r (3), by which the quaternion
/// (1, r) rotates it about the axes of the world, of both a share of kShapeShare. Fields of earlier
/// asset files have no shapes, those of the first have colours alone.
constexpr size_t kColourChannels = 3;
constexpr size_t kDetailOpacity = 3;
constexpr size_t kDetailScale = 4;
constexpr size_t kDetailOffset = 5;
constexpr size_t kChannelsWithoutShapes = 8;
constexpr size_t kDetailScales = 8;
constexpr size_t kDetailTurn = 11;
constexpr size_t kDetailChannels = 14;
/// Shapes learn slower than all else for it: as fast, they fit what views show of places that few
/// of them see, and other views of those places lose up to 3 dB.
constexpr float kShapeShare = 0.3f;

/// How the details of N Gaussians are to be taken.
struct FieldDetails {
  size_t channels;                    ///< of each row of details
  std::span<const float> footprints;  ///< [N] of the Gaussians, unit cube
  std::span<const float> stretch;  ///< [N] of the way back: what sizes were multiplied by; empty: 1
};

/// In: details [N, channels]. In and out: cloud: N Gaussians in the unit cube.
/// Threads and determinism: Gaussians in parallel, independent.
void addDetails(const FieldDetails& how, std::span<const float> details, SplatCloud& cloud);

/// Derivatives by the details [N, channels]; those by scales and rotations become derivatives by
/// what they were without details. Of opacities there is nothing to change: what follows takes
/// them by their logits, which details are added to. In: side: of the root, metres; cloud: in the
/// world; gradient: by its values, places and sizes by those in the unit cube.
void addDetailsBackward(const FieldDetails& how, std::span<const float> details, float side,
                        const SplatCloud& cloud, SplatCloud& gradient, std::span<float> by_details);

}  // namespace stipple
