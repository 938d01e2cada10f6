#include "splat/cpu/visible_splats.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kProjectionGrain = 4096;

struct Keyed {
  uint32_t key;
  uint32_t slot;
};

VisibleSplat makeVisible(const PlacedScene& scene, const PlacedCloud& placed, size_t index,
                         const Projected<double>& projected) {
  VisibleSplat splat;
  splat.footprint = projected.footprint;
  splat.half_x = projected.half_x;
  splat.half_y = projected.half_y;
  splat.log2_opacity = static_cast<float>(std::log2(projected.footprint.opacity));
  splat.depth = static_cast<float>(std::min(projected.depth, 1e38));
  splatColour(scene, placed, index, splat.colour);
  splat.index = static_cast<uint32_t>(placed.first_index + index);
  return splat;
}

/// Projects splats [begin, end) into slots from `begin` on; their keys go to `keyed`, same places.
/// Returns how many are visible.
size_t projectRange(const PlacedScene& scene, size_t begin, size_t end, VisibleSplat* slots,
                    Keyed* keyed) {
  size_t filled = begin;
  size_t cloud = cloudOfSplat(scene, begin);
  for (size_t i = begin; i < end; ++i) {
    while (i - scene.clouds[cloud].first_index >= scene.clouds[cloud].cloud->size()) ++cloud;
    const PlacedCloud& placed = scene.clouds[cloud];
    const size_t index = i - placed.first_index;
    Projected<double> projected;
    if (!projectSplat(scene, placed, index, projected)) continue;
    slots[filled] = makeVisible(scene, placed, index, projected);
    keyed[filled] = {depthKey(projected.depth), static_cast<uint32_t>(filled)};
    ++filled;
  }
  return filled - begin;
}

/// Stable radix sort by key, 11 bits a pass; passes in which every key has the same digit are left
/// out. The result is in `a`.
void sortByKey(std::vector<Keyed>& a) {
  constexpr uint32_t kBits = 11;
  constexpr uint32_t kDigits = 1u << kBits;
  std::vector<Keyed> b(a.size());
  std::array<std::array<size_t, kDigits>, 3> counts{};
  for (const Keyed& item : a) {
    for (uint32_t pass = 0; pass < 3; ++pass) {
      ++counts[pass][(item.key >> (pass * kBits)) & (kDigits - 1)];
    }
  }
  for (uint32_t pass = 0; pass < 3; ++pass) {
    std::array<size_t, kDigits>& count = counts[pass];
    if (*std::max_element(count.begin(), count.end()) == a.size()) continue;
    size_t sum = 0;
    for (size_t& slot : count) {
      const size_t here = slot;
      slot = sum;
      sum += here;
    }
    for (const Keyed& item : a) {
      b[count[(item.key >> (pass * kBits)) & (kDigits - 1)]++] = item;
    }
    a.swap(b);
  }
}

}  // namespace

VisibleSplats findVisibleSplats(const PlacedScene& scene, Progress* progress) {
  VisibleSplats visible;
  const size_t count = scene.splat_count;
  if (count == 0) return visible;
  // Without initialisation: pages of splats that are culled are never touched.
  const auto slots = std::make_unique_for_overwrite<VisibleSplat[]>(count);
  const auto keyed = std::make_unique_for_overwrite<Keyed[]>(count);
  std::vector<size_t> filled(rangeCount(count, kProjectionGrain));
  parallelFor(count, kProjectionGrain, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    filled[begin / kProjectionGrain] = projectRange(scene, begin, end, slots.get(), keyed.get());
  });

  for (const size_t part : filled) visible.count += part;
  std::vector<Keyed> sorted;
  sorted.reserve(visible.count);
  for (size_t range = 0; range < filled.size(); ++range) {
    const Keyed* first = keyed.get() + range * kProjectionGrain;
    sorted.insert(sorted.end(), first, first + filled[range]);
  }
  sortByKey(sorted);
  visible.splats = std::make_unique_for_overwrite<VisibleSplat[]>(visible.count);
  parallelFor(visible.count, kProjectionGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) visible.splats[i] = slots[sorted[i].slot];
  });
  return visible;
}

uint64_t visibleSplatsMemoryBound(uint64_t splat_count) {
  return splat_count * (2 * sizeof(VisibleSplat) + 3 * sizeof(Keyed)) +
         rangeCount(splat_count, kProjectionGrain) * sizeof(size_t);
}

}  // namespace stipple
