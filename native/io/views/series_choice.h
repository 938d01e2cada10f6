#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stipple {

/// Which image of a series: of what frame, by what camera.
struct SeriesPlace {
  uint64_t frame = 0;
  size_t camera = 0;  ///< counted from 0
};

/// At most `most` images, spread evenly: so many of every frame as its share of all is, up or down
/// by one, and in each frame other cameras, which take turns. Where no image is missing, the
/// numbers of images of any two frames differ by at most 1, and so do those of any two cameras.
/// Returns: indices into `places`, ascending. Cost: O(n log n + n cameras).
std::vector<size_t> evenChoice(const std::vector<SeriesPlace>& places, uint64_t most);

}  // namespace stipple
