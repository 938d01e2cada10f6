#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Which points are selected, or at most `distance` from one that is: 0, 1. [N]
/// In: points [N,3] finite; mask [N] of 0 and 1; distance >= 0.
/// Determinism: any number of threads. Cost: O(N) for what is far from the edge of the selection,
/// O(log N) for each point near it.
std::vector<uint8_t> grown(std::span<const float> points, std::span<const uint8_t> mask,
                           double distance);

/// Which points are selected, and further than `distance` from every one that is not. As grown().
std::vector<uint8_t> shrunken(std::span<const float> points, std::span<const uint8_t> mask,
                              double distance);

/// Median distance of selected points to their 8th neighbour among all points; of up to 32 of them,
/// evenly chosen. 0 where nothing is selected; the furthest neighbour counts where there are fewer
/// than 8. Cost: O(N), all threads.
double neighbourSpacing(std::span<const float> points, std::span<const uint8_t> mask);

}  // namespace stipple
