#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "splat/render/object_order.h"
#include "splat/render/scene.h"

namespace stipple {

/// Parts in parallel, then halves of them merged.
inline void sortInParts(std::vector<uint64_t>& keys) {
  constexpr size_t kParts = 8;
  const auto at = [&](size_t part) {
    return keys.begin() + static_cast<ptrdiff_t>(keys.size() * part / kParts);
  };
  parallelFor(kParts, 1, [&](size_t begin, size_t end) {
    for (size_t part = begin; part < end; ++part) std::sort(at(part), at(part + 1));
  });
  for (size_t side = 1; side < kParts; side *= 2) {
    parallelFor(kParts / (2 * side), 1, [&](size_t begin, size_t end) {
      for (size_t pair = begin; pair < end; ++pair) {
        const size_t first = pair * 2 * side;
        std::inplace_merge(at(first), at(first + side), at(first + 2 * side));
      }
    });
  }
}

/// What make(placed cloud, index, splat) accepts of every splat of a scene, with its index, by the
/// rounded depth that depth(splat) tells, ties in the order of the scene; object by object where
/// those are drawn apart. Same for any number of threads.
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
  // Depth above, place below: no two are equal, so any sort gives one order.
  std::vector<uint64_t> order(splats.size());
  parallelFor(order.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      order[i] = uint64_t{depthKey(depth(splats[i]))} << 32 | i;
    }
  });
  sortInParts(order);
  if (scene.objects_apart) {
    const std::vector<uint64_t> by_depth = order;
    const auto object_of = [&](uint64_t key) {
      return cloudOfSplat(scene, splats[static_cast<uint32_t>(key)].index);
    };
    sortByObject<uint64_t>(scene, by_depth, object_of, order.data());
  }
  std::vector<Splat> sorted(splats.size());
  parallelFor(order.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) sorted[i] = splats[static_cast<uint32_t>(order[i])];
  });
  return sorted;
}

}  // namespace stipple
