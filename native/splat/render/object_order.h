#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "splat/render/scene.h"

namespace stipple {

/// Sets objects_apart and drawn_order of a scene. With one object there is nothing to choose, and
/// nothing is done. Objects come by the mean of their splats' depths (view z of the centres;
/// distances where the camera sees no plane), the nearest first, equal ones in the order of the
/// scene. Same result for any number of threads. Cost: 12 bytes read per splat.
/// Errors: kUnsupported where a surface stands anywhere: it may cut an object in two, of which each
/// part would need a place of its own between the other objects.
void orderObjects(const RenderOptions& options, PlacedScene& scene);

constexpr size_t kSortedAtOnce = 1 << 16;

/// Upper bound of the bytes that orderObjects and sortByObject allocate.
inline uint64_t objectSortBound(uint64_t splat_count, uint64_t object_count) {
  const uint64_t sums = splat_count / (1 << 15) + 1;
  const uint64_t places = (splat_count / kSortedAtOnce + 1) * object_count;
  const uint64_t ranges = splat_count / 2048 + 1;
  return (sums + places + ranges + 4 * object_count) * sizeof(uint64_t);
}

/// Items of splats, which are in the order of depth, object by object as scene.drawn_order has
/// them. In: object_of(item), an index into scene.clouds. Out: to, as many as `from`. Same result
/// for any number of threads.
template <typename Item, typename ObjectOf>
void sortByObject(const PlacedScene& scene, std::span<const Item> from, ObjectOf object_of,
                  Item* to) {
  const size_t objects = scene.clouds.size(), chunks = rangeCount(from.size(), kSortedAtOnce);
  std::vector<size_t> places(chunks * objects);
  parallelFor(from.size(), kSortedAtOnce, [&](size_t begin, size_t end) {
    size_t* counts = &places[begin / kSortedAtOnce * objects];
    for (size_t i = begin; i < end; ++i) ++counts[object_of(from[i])];
  });
  size_t sum = 0;
  for (const size_t object : scene.drawn_order) {
    for (size_t chunk = 0; chunk < chunks; ++chunk) {
      sum += std::exchange(places[chunk * objects + object], sum);
    }
  }
  parallelFor(from.size(), kSortedAtOnce, [&](size_t begin, size_t end) {
    size_t* next = &places[begin / kSortedAtOnce * objects];
    for (size_t i = begin; i < end; ++i) to[next[object_of(from[i])]++] = from[i];
  });
}

}  // namespace stipple
