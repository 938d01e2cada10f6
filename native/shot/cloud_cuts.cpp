#include "shot/cloud_cuts.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "decode/tree/merge_tree.h"

namespace stipple {

namespace {

/// Shares of one cloud that are kept: those of two levels, and two of an artist who compares.
constexpr size_t kMaxKept = 4;

uint64_t cutSize(const SplatCloud& cloud, double share) {
  const double wanted = std::ceil(share * static_cast<double>(cloud.size()));
  return std::clamp<uint64_t>(static_cast<uint64_t>(wanted), 1, cloud.size());
}

}  // namespace

void CloudCuts::cut(Instances& instances, double share, Progress* progress) {
  if (share >= 1) return;
  std::lock_guard<std::mutex> lock(mutex_);
  std::erase_if(entries_,
                [](const Entry& entry) { return entry.hierarchy->leaves().use_count() == 1; });
  for (size_t i = 0; i < instances.list.size(); ++i) {
    if (instances.shares[i]->size() < 2) continue;
    instances.shares[i] = cutOf(instances.shares[i], share, progress);
    instances.list[i].cloud = instances.shares[i].get();
  }
}

uint64_t CloudCuts::memoryBound(const Instances& instances, double share) {
  if (share >= 1) return 0;
  uint64_t bytes = 0;
  std::vector<const SplatCloud*> seen;
  for (const auto& cloud : instances.shares) {
    if (std::find(seen.begin(), seen.end(), cloud.get()) != seen.end()) continue;
    seen.push_back(cloud.get());
    bytes += mergeTreeMemoryBound(cloud->size(), cloud->sh_degree);
  }
  return bytes;
}

std::shared_ptr<const SplatCloud> CloudCuts::cutOf(const std::shared_ptr<const SplatCloud>& cloud,
                                                   double share, Progress* progress) {
  auto entry = std::find_if(entries_.begin(), entries_.end(),
                            [&](const Entry& known) { return known.hierarchy->leaves() == cloud; });
  if (entry == entries_.end()) {
    auto tree = std::make_shared<const MergeTree>(buildMergeTree(*cloud, {}, {}, progress));
    entries_.push_back({std::make_shared<const HierarchyDecoder>(cloud, std::move(tree)), {}});
    entry = std::prev(entries_.end());
  }
  for (const auto& [known_share, made] : entry->made) {
    if (known_share == share) return made;
  }
  DecodeRequest request;
  request.budget = cutSize(*cloud, share);
  request.progress = progress;
  auto made = std::make_shared<const SplatCloud>(entry->hierarchy->decode(request));
  if (entry->made.size() == kMaxKept) entry->made.erase(entry->made.begin());
  entry->made.emplace_back(share, made);
  return made;
}

}  // namespace stipple
