#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

#include "base/parallel.h"
#include "splat/scene.h"

namespace stipple {

/// What make(placed cloud, index, splat) accepts of every splat of a scene, with its index, by the
/// rounded depth that depth(splat) tells, ties in the order of the scene. Same for any number of
/// threads.
template <typename Splat, typename Make, typename Depth>
std::vector<Splat> splatsInDepthOrder(const PlacedScene& scene, Make make, Depth depth) {
  constexpr size_t kGrain = 1024;
  std::vector<Splat> splats;
  for (const PlacedCloud& placed : scene.clouds) {
    const size_t count = placed.cloud->size();
    std::vector<std::vector<Splat>> made(rangeCount(count, kGrain));
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      Splat splat;
      for (size_t i = begin; i < end; ++i) {
        if (!make(placed, i, splat)) continue;
        splat.index = static_cast<uint32_t>(placed.first_index + i);
        made[begin / kGrain].push_back(splat);
      }
    });
    for (const std::vector<Splat>& range : made) {
      splats.insert(splats.end(), range.begin(), range.end());
    }
  }
  std::vector<uint32_t> order(splats.size());
  std::iota(order.begin(), order.end(), uint32_t{0});
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return depthKey(depth(splats[a])) < depthKey(depth(splats[b]));
  });
  std::vector<Splat> sorted;
  sorted.reserve(splats.size());
  for (const uint32_t i : order) sorted.push_back(splats[i]);
  return sorted;
}

}  // namespace stipple
