#include "splat/cpu/visible_splats.h"

#include <algorithm>
#include <functional>
#include <numbers>

#include "base/parallel.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/render/object_order.h"

namespace stipple {

namespace {

constexpr size_t kGatherSplats = 8192;
constexpr double kLargestWeight = 3.4e38;

/// Checks and projects splats [begin, end) into slots from `begin` on. Returns how many are
/// visible.
size_t projectRange(Projector project, const PlacedScene& scene, size_t begin, size_t end,
                    const ProjectedSlots& slots) {
  size_t slot = begin;
  for (size_t cloud = cloudOfSplat(scene, begin); begin < end; ++cloud) {
    const PlacedCloud& placed = scene.clouds[cloud];
    const size_t first = begin - placed.first_index;
    const size_t last = std::min<size_t>(end - placed.first_index, placed.cloud->size());
    if (!placed.is_checked && !rowsAreValid(*placed.cloud, first, last)) refuseCloud(placed);
    slot = project(scene, placed, first, last, slots, slot);
    begin = placed.first_index + last;
  }
  return slot;
}

/// Changes visible.order from that of depth to that of objects, in the other array of items.
void orderByObject(const PlacedScene& scene, VisibleSplats& visible) {
  // Slots of a range that lies within one object tell it by their numbers.
  constexpr size_t kSeveral = SIZE_MAX;
  std::vector<size_t> objects(visible.filled.size());
  for (size_t range = 0; range < objects.size(); ++range) {
    const uint64_t first = range * kRangeSplats;
    const uint64_t last = std::min<uint64_t>(first + kRangeSplats, scene.splat_count) - 1;
    const size_t object = cloudOfSplat(scene, first);
    objects[range] = object == cloudOfSplat(scene, last) ? object : kSeveral;
  }
  const auto object_of = [&](DepthItem item) {
    const uint32_t slot = static_cast<uint32_t>(item);
    const size_t object = objects[slot / kRangeSplats];
    return object != kSeveral ? object : cloudOfSplat(scene, visible.extras[slot].index);
  };
  DepthItem* sorted = visible.items[visible.order == visible.items[0].get() ? 1 : 0].get();
  sortByObject<DepthItem>(scene, {visible.order, visible.count}, object_of, sorted);
  visible.order = sorted;
}

}  // namespace

void findVisibleSplats(Projector project, const PlacedScene& scene, Progress* progress,
                       VisibleSplats& visible) {
  const size_t count = scene.splat_count;
  visible.count = 0;
  visible.order = nullptr;
  visible.spans = nullptr;
  if (count == 0) return;
  const ProjectedSlots slots = {visible.splats.resize(count), visible.extras.resize(count),
                                visible.items[0].resize(count), visible.slot_spans.resize(count)};
  visible.items[1].resize(count);
  visible.filled.resize(rangeCount(count, kRangeSplats));
  visible.digits.resize(kDepthSortDigits);
  const auto project_range = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    const size_t after = projectRange(project, scene, begin, end, slots);
    visible.filled[begin / kRangeSplats] = static_cast<uint32_t>(after - begin);
  };
  parallelFor(count, kRangeSplats, std::cref(project_range));

  for (const uint32_t part : visible.filled) visible.count += part;
  visible.order = sortByDepth({{visible.items[0].get(), visible.items[1].get()},
                               visible.filled,
                               kRangeSplats,
                               visible.count,
                               visible.digits.data()});
  if (scene.objects_apart) orderByObject(scene, visible);
  TileSpan* spans = visible.items[visible.order == slots.items ? 1 : 0].get();
  const auto gather = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    for (size_t i = begin; i < end; ++i) spans[i] = slots.spans[visible.slotAt(i)];
  };
  parallelFor(visible.count, kGatherSplats, std::cref(gather));
  visible.spans = spans;
}

VisibleSplats findVisibleSplats(const PlacedScene& scene, Progress* progress) {
  VisibleSplats visible;
  findVisibleSplats(chosenProjector(), scene, progress, visible);
  return visible;
}

void visibleFlags(RenderWorkspace& drawn, std::vector<uint8_t>& flags) {
  const VisibleSplats& visible = drawn.arrays().visible;
  flags.resize(drawn.arrays().scene.splat_count);
  const auto write_range = [&](size_t begin, size_t end) {
    std::fill(&flags[begin], &flags[begin] + (end - begin), uint8_t{0});
    const size_t end_slot = begin + visible.slotCount(begin);
    for (size_t slot = begin; slot < end_slot; ++slot) flags[visible.extras[slot].index] = 1;
  };
  parallelFor(flags.size(), kRangeSplats, std::cref(write_range));
}

void unhiddenWeights(RenderWorkspace& drawn, std::vector<float>& weights) {
  const VisibleSplats& visible = drawn.arrays().visible;
  const SplatSlots slots = visible.slots();
  weights.resize(drawn.arrays().scene.splat_count);
  const auto write_range = [&](size_t begin, size_t end) {
    std::fill(&weights[begin], &weights[begin] + (end - begin), 0.0f);
    const size_t end_slot = begin + visible.slotCount(begin);
    for (size_t slot = begin; slot < end_slot; ++slot) {
      const Footprint<double> f = slots.footprint(static_cast<uint32_t>(slot));
      const double weight = 2 * std::numbers::pi * f.opacity / (f.l00 * f.l11);
      weights[slots.extras[slot].index] = static_cast<float>(std::min(weight, kLargestWeight));
    }
  };
  parallelFor(weights.size(), kRangeSplats, std::cref(write_range));
}

uint64_t visibleSplatsMemoryBound(uint64_t splat_count) {
  const uint64_t arrays = splat_count * (sizeof(VisibleSplat) + sizeof(VisibleExtra) +
                                         2 * sizeof(DepthItem) + sizeof(TileSpan));
  // Arrays on huge pages, 8 MiB at least, are rounded up to 2 MiB.
  return arrays + std::min(arrays / 4, 5 * (uint64_t{2} << 20)) +
         rangeCount(splat_count, kRangeSplats) * sizeof(uint32_t) +
         kDepthSortDigits * sizeof(uint32_t);
}

}  // namespace stipple
