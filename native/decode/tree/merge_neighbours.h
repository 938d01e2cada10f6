#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Nearest neighbours of places. Where very many share one place, some of them are its neighbours,
/// evenly, and one of them knows places beyond. Ties and the order within a row are those of the
/// search; the same for any number of threads.
/// In: places [count,width]; neighbour_count k >= 1; width >= 1.
/// Returns: [count,k] indices, never the place itself; rows of fewer than k places end with
/// kNoPlace. Cost: O(count log count).
constexpr uint32_t kNoPlace = UINT32_MAX;
std::vector<uint32_t> nearestNeighbours(std::span<const double> places, size_t neighbour_count,
                                        size_t width = 3);

}  // namespace stipple
