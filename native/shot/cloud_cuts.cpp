#include "shot/cloud_cuts.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <string>

#include "data/clouds/cloud_bytes.h"
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
  Shutter still;
  cut(instances, still, share, progress);
}

void CloudCuts::cut(Instances& instances, Shutter& shutter, double share, Progress* progress) {
  if (share >= 1) return;
  std::lock_guard<std::mutex> lock(mutex_);
  std::erase_if(entries_,
                [](const Entry& entry) { return entry.hierarchy->leaves().use_count() == 1; });
  // By the tree and the cloud of a step: instances may share both.
  std::map<std::pair<const SplatCloud*, const SplatCloud*>, std::shared_ptr<const SplatCloud>>
      moved;
  const size_t count = instances.list.size();
  for (size_t i = 0; i < count; ++i) {
    const std::shared_ptr<const SplatCloud> own = instances.shares[i];
    if (own->size() < 2) continue;
    instances.shares[i] = cutOf(own, share, progress);
    instances.list[i].cloud = instances.shares[i].get();
    for (size_t step = 0; step * count < shutter.clouds.size(); ++step) {
      auto& cloud = shutter.clouds[step * count + i];
      if (!cloud) continue;
      auto& made = moved[{own.get(), cloud.get()}];
      if (!made && cloud == own) made = instances.shares[i];
      if (!made) {
        const std::string name =
            "instance " + std::to_string(i) + ": the cloud of step " + std::to_string(step);
        validate(*cloud, name.c_str());
        made = std::make_shared<const SplatCloud>(
            entryOf(own, progress).hierarchy->decodeMoved(*cloud, cutSize(*own, share), progress));
      }
      cloud = made;
    }
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

uint64_t CloudCuts::memoryBound(const Instances& instances, const Shutter& shutter, double share) {
  uint64_t bytes = memoryBound(instances, share), largest = 0;
  if (share >= 1) return bytes;
  std::vector<std::pair<const SplatCloud*, const SplatCloud*>> seen;
  for (size_t i = 0; i < shutter.clouds.size(); ++i) {
    const SplatCloud* cloud = shutter.clouds[i].get();
    const SplatCloud* own = instances.shares[i % instances.shares.size()].get();
    if (cloud && cloud->size() >= 2) seen.emplace_back(own, cloud);
  }
  std::sort(seen.begin(), seen.end());
  seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
  for (const auto& [own, cloud] : seen) {
    bytes += cloudBytes(cutSize(*own, share), own->sh_degree);
    largest = std::max(largest, HierarchyDecoder::movedMemoryBound(own->size()));
  }
  return bytes + largest;
}

CloudCuts::Entry& CloudCuts::entryOf(const std::shared_ptr<const SplatCloud>& cloud,
                                     Progress* progress) {
  auto entry = std::find_if(entries_.begin(), entries_.end(),
                            [&](const Entry& known) { return known.hierarchy->leaves() == cloud; });
  if (entry == entries_.end()) {
    auto tree = std::make_shared<const MergeTree>(buildMergeTree(*cloud, {}, {}, progress));
    entries_.push_back({std::make_shared<const HierarchyDecoder>(cloud, std::move(tree)), {}});
    entry = std::prev(entries_.end());
  }
  return *entry;
}

std::shared_ptr<const SplatCloud> CloudCuts::cutOf(const std::shared_ptr<const SplatCloud>& cloud,
                                                   double share, Progress* progress) {
  Entry& entry = entryOf(cloud, progress);
  for (const auto& [known_share, made] : entry.made) {
    if (known_share == share) return made;
  }
  DecodeRequest request;
  request.budget = cutSize(*cloud, share);
  request.progress = progress;
  auto made = std::make_shared<const SplatCloud>(entry.hierarchy->decode(request));
  if (entry.made.size() == kMaxKept) entry.made.erase(entry.made.begin());
  entry.made.emplace_back(share, made);
  return made;
}

}  // namespace stipple
