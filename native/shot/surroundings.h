#pragma once

#include <cstdint>
#include <vector>

#include "math/camera.h"

namespace stipple {

/// A picture of all directions of the world around the camera: row 0 is straight up (+z), the
/// middle column looks along +y, and columns further right turn towards +x.
struct Surroundings {
  const float* pixels = nullptr;  ///< [height, width, 3] in the picture's own space; null: none
  uint32_t width = 0;
  uint32_t height = 0;
};

/// Errors: kInvalidArgument for a picture without pixels.
void validate(const Surroundings& surroundings);

/// What a camera sees of them, by straight lines between the four pixels around a direction.
/// In: a camera that validate() accepts. Out: [H,W,3], row 0 at the top; 0 where the camera's
/// picture shows nothing, as beyond a fisheye's field of view.
/// Determinism: the same bits for any number of threads. Cost: O(H W).
std::vector<float> surroundingsSeen(const Surroundings& surroundings, const Camera& camera);

/// Bytes that surroundingsSeen() allocates.
uint64_t surroundingsSeenBytes(const Camera& camera);

}  // namespace stipple
