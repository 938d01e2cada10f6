#include "decode/merge_rounds.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "base/parallel.h"
#include "base/random.h"
#include "decode/merge_neighbours.h"

// Based on: Murtagh, A Survey of Recent Advances in Hierarchical Clustering Algorithms, Computer
// Journal 1983 (nodes that are each other's nearest may merge in any order, or at once).
// Differs: partners are looked for among neighbours, which a merged node takes over from both of
// its children, and all such pairs of a round merge side by side.

namespace stipple {

namespace {

constexpr size_t kNeighbourCount = 8;
/// Partners that are kept per node, the cheapest ones.
constexpr size_t kListCapacity = 16;
/// Neighbours are searched afresh when this many times fewer nodes are left.
constexpr size_t kSearchAgain = 4;
constexpr size_t kGrain = 256;
constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

struct Entry {
  float cost;
  uint32_t slot;
};

/// A merged node lives on in the slot of its first child.
class MergeRounds {
 public:
  MergeRounds(std::vector<MergeNode> nodes, const MergeScale& scale)
      : scale_(scale), nodes_(std::move(nodes)), count_(nodes_.size()) {
    ids_.resize(count_);
    active_.resize(count_);
    for (size_t i = 0; i < count_; ++i) ids_[i] = active_[i] = static_cast<uint32_t>(i);
    entries_.resize(count_ * kListCapacity);
    sizes_.assign(count_, 0);
    best_.assign(count_, kNone);
    alias_ = ids_;
    changed_.assign(count_, 0);
    errors_.assign(count_, 0.0f);
    merges_.reserve(count_ == 0 ? 0 : count_ - 1);
  }

  template <typename OnMerge>
  std::vector<Merge> run(const OnMerge& on_merge, Progress* progress) {
    searchNeighbours();
    size_t searched_at = active_.size();
    while (active_.size() > 1) {
      advance(progress, 1.0 - static_cast<double>(active_.size()) / static_cast<double>(count_),
              "Merging splats");
      if (active_.size() * kSearchAgain <= searched_at) {
        searchNeighbours();
        searched_at = active_.size();
      }
      const size_t before = active_.size();
      choosePairs();
      if (pairs_.empty()) {
        // Only nodes without partners are left. (Where there is an entry, the cheapest one makes a
        // pair.)
        searchNeighbours();
        searched_at = active_.size();
        continue;
      }
      mergePairs(on_merge);
      updateLists();
      // Long chains of ever cheaper partners have one pair each; taking costs within an eighth of
      // an octave for equal breaks them.
      coarse_ = pairs_.size() * 16 < before;
    }
    return std::move(merges_);
  }

 private:
  float costOf(uint32_t a, uint32_t b) const {
    if (a > b) std::swap(a, b);
    const MergeNode merged = mergedNode(nodes_[a], nodes_[b], scale_);
    constexpr double kLargest = std::numeric_limits<float>::max();
    return static_cast<float>(std::min(mergeError(nodes_[a], nodes_[b], merged, scale_), kLargest));
  }

  /// A total order of edges: by cost, ties shuffled so that equal costs leave many pairs.
  uint64_t key(uint32_t slot, const Entry& entry) const {
    const uint32_t low = std::min(slot, entry.slot);
    const uint32_t high = std::max(slot, entry.slot);
    uint32_t cost = std::bit_cast<uint32_t>(entry.cost);
    if (coarse_) cost >>= 20;
    const uint64_t shuffled = mixBits((static_cast<uint64_t>(low) << 32) | high);
    return (static_cast<uint64_t>(cost) << 32) | (shuffled >> 32);
  }

  void searchNeighbours() {
    const size_t count = active_.size();
    std::vector<double> places(count * 3);
    for (size_t i = 0; i < count; ++i) {
      const MergeNode& node = nodes_[active_[i]];
      std::copy(node.mean.begin(), node.mean.end(), places.begin() + static_cast<long>(i * 3));
      sizes_[active_[i]] = 0;
    }
    const std::vector<uint32_t> rows = nearestNeighbours(places, kNeighbourCount);
    const auto append = [&](uint32_t slot, uint32_t other) {
      Entry* list = &entries_[slot * kListCapacity];
      for (size_t k = 0; k < sizes_[slot]; ++k) {
        if (list[k].slot == other) return;
      }
      if (sizes_[slot] < kListCapacity) list[sizes_[slot]++] = {0.0f, other};
    };
    const auto forEachRow = [&](const auto& use) {
      for (size_t i = 0; i < count; ++i) {
        for (size_t k = 0; k < kNeighbourCount; ++k) {
          const uint32_t other = rows[i * kNeighbourCount + k];
          if (other != kNoPlace) use(active_[i], active_[other]);
        }
      }
    };
    forEachRow([&](uint32_t slot, uint32_t other) { append(slot, other); });
    forEachRow([&](uint32_t slot, uint32_t other) { append(other, slot); });
    keepMutual(active_, [](uint32_t) { return true; });
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const uint32_t slot = active_[i];
        Entry* list = &entries_[slot * kListCapacity];
        for (size_t k = 0; k < sizes_[slot]; ++k) list[k].cost = costOf(slot, list[k].slot);
      }
    });
  }

  void choosePairs() {
    parallelFor(active_.size(), kGrain * 16, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const uint32_t slot = active_[i];
        const Entry* list = &entries_[slot * kListCapacity];
        uint64_t least = std::numeric_limits<uint64_t>::max();
        best_[slot] = kNone;
        for (size_t k = 0; k < sizes_[slot]; ++k) {
          const uint64_t value = key(slot, list[k]);
          if (value < least || best_[slot] == kNone) {
            least = value;
            best_[slot] = list[k].slot;
          }
        }
      }
    });
    pairs_.clear();
    for (const uint32_t slot : active_) {
      const uint32_t other = best_[slot];
      if (other != kNone && slot < other && best_[other] == slot) pairs_.push_back({slot, other});
    }
  }

  template <typename OnMerge>
  void mergePairs(const OnMerge& on_merge) {
    ++round_;
    const size_t first_merge = merges_.size();
    merges_.resize(first_merge + pairs_.size());
    parallelFor(pairs_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const auto [a, b] = pairs_[i];
        const uint32_t id = static_cast<uint32_t>(count_ + first_merge + i);
        const MergeNode merged = mergedNode(nodes_[a], nodes_[b], scale_);
        // Never below that of the children, so that a cut refines from the top.
        const float error = std::max({costOf(a, b), errors_[a], errors_[b]});
        merges_[first_merge + i] = {ids_[a], ids_[b], error};
        on_merge(id, merges_[first_merge + i], nodes_[a], nodes_[b], merged);
        nodes_[a] = merged;
        ids_[a] = id;
        errors_[a] = error;
        alias_[b] = a;
        changed_[a] = changed_[b] = round_;
      }
    });
  }

  void updateLists() {
    parallelFor(pairs_.size(), kGrain / 4, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) takeOver(pairs_[i].first, pairs_[i].second);
    });
    std::vector<uint32_t> merged(pairs_.size());
    for (size_t i = 0; i < merged.size(); ++i) merged[i] = pairs_[i].first;
    keepMutual(merged, [&](uint32_t other) { return changed_[other] == round_; });
    std::erase_if(active_, [&](uint32_t slot) { return alias_[slot] != slot; });
    parallelFor(active_.size(), kGrain * 16, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (changed_[active_[i]] != round_) follow(active_[i]);
      }
    });
  }

  /// Drops entries that their partner does not list too; only partners that concerns() names are
  /// looked at.
  template <typename Concerns>
  void keepMutual(const std::vector<uint32_t>& slots, const Concerns& concerns) {
    static_assert(kListCapacity <= 32);
    std::vector<uint32_t> kept(slots.size());
    parallelFor(slots.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const Entry* list = &entries_[slots[i] * kListCapacity];
        for (size_t k = 0; k < sizes_[slots[i]]; ++k) {
          const uint32_t other = list[k].slot;
          const Entry* back = &entries_[other * kListCapacity];
          const bool mutual =
              !concerns(other) || std::any_of(back, back + sizes_[other], [&](const Entry& entry) {
                return entry.slot == slots[i];
              });
          kept[i] |= (mutual ? 1u : 0u) << k;
        }
      }
    });
    parallelFor(slots.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        Entry* list = &entries_[slots[i] * kListCapacity];
        uint8_t count = 0;
        for (size_t k = 0; k < sizes_[slots[i]]; ++k) {
          if (kept[i] >> k & 1) list[count++] = list[k];
        }
        sizes_[slots[i]] = count;
      }
    });
  }

  /// The list of a merged node: the partners of both children, the cheapest kept.
  void takeOver(uint32_t a, uint32_t b) {
    Entry candidates[2 * kListCapacity];
    size_t count = 0;
    for (const uint32_t child : {a, b}) {
      const Entry* list = &entries_[child * kListCapacity];
      for (size_t k = 0; k < sizes_[child]; ++k) {
        const uint32_t slot = alias_[list[k].slot];
        if (slot == a) continue;
        bool known = false;
        for (size_t j = 0; j < count; ++j) known |= candidates[j].slot == slot;
        if (!known) candidates[count++] = {0.0f, slot};
      }
    }
    for (size_t k = 0; k < count; ++k) candidates[k].cost = costOf(a, candidates[k].slot);
    if (count > kListCapacity) {
      std::nth_element(candidates, candidates + kListCapacity, candidates + count,
                       [&](const Entry& x, const Entry& y) { return key(a, x) < key(a, y); });
      count = kListCapacity;
    }
    std::copy(candidates, candidates + count, &entries_[a * kListCapacity]);
    sizes_[a] = static_cast<uint8_t>(count);
  }

  /// Brings the entries of a node that stayed up to date with partners that merged.
  void follow(uint32_t slot) {
    Entry* list = &entries_[slot * kListCapacity];
    size_t kept = 0;
    for (size_t k = 0; k < sizes_[slot]; ++k) {
      if (changed_[list[k].slot] != round_) {
        list[kept++] = list[k];
        continue;
      }
      const uint32_t other = alias_[list[k].slot];
      bool known = false;
      for (size_t j = 0; j < kept; ++j) known |= list[j].slot == other;
      if (known) continue;
      const Entry* back = &entries_[other * kListCapacity];
      for (size_t j = 0; j < sizes_[other]; ++j) {
        if (back[j].slot != slot) continue;
        list[kept++] = {back[j].cost, other};
        break;
      }
    }
    sizes_[slot] = static_cast<uint8_t>(kept);
  }

  struct Pair {
    uint32_t first;
    uint32_t second;
  };

  MergeScale scale_;
  std::vector<MergeNode> nodes_;  ///< [slots]
  size_t count_;
  std::vector<uint32_t> ids_;      ///< [slots] of the node that lives there
  std::vector<uint32_t> active_;   ///< slots in use, ascending
  std::vector<Entry> entries_;     ///< [slots, kListCapacity]
  std::vector<uint8_t> sizes_;     ///< [slots] entries in use
  std::vector<uint32_t> best_;     ///< [slots]
  std::vector<uint32_t> alias_;    ///< [slots] itself, or where it merged into in this round
  std::vector<uint32_t> changed_;  ///< [slots] last round in which it merged
  std::vector<float> errors_;      ///< [slots]
  std::vector<Pair> pairs_;
  std::vector<Merge> merges_;
  uint32_t round_ = 0;
  bool coarse_ = false;
};

}  // namespace

std::vector<Merge> mergeInRounds(
    std::vector<MergeNode> nodes, const MergeScale& scale,
    const std::function<void(uint32_t id, const Merge& merge, const MergeNode& first,
                             const MergeNode& second, const MergeNode& merged)>& on_merge,
    Progress* progress) {
  return MergeRounds(std::move(nodes), scale).run(on_merge, progress);
}

}  // namespace stipple
