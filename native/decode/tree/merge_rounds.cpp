#include "decode/tree/merge_rounds.h"

#include <algorithm>
#include <bit>
#include <initializer_list>
#include <limits>

#include "base/atomic_ref.h"
#include "base/fresh_memory.h"
#include "base/parallel.h"
#include "base/random.h"
#include "decode/tree/merge_neighbours.h"

// Based on: Murtagh, A Survey of Recent Advances in Hierarchical Clustering Algorithms, Computer
// Journal 1983 (nodes that are each other's nearest may merge in any order, or at once).
// Differs: partners are looked for among neighbours, which a merged node takes over from both of
// its children, and all such pairs of a round merge side by side.

namespace stipple {

namespace {

/// Partners that are kept per node, the cheapest ones.
constexpr size_t kListCapacity = 10;
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
  explicit MergeRounds(MergingNodes& nodes) : nodes_(nodes), count_(nodes.size()) {
    ids_.resize(count_);
    active_.resize(count_);
    for (size_t i = 0; i < count_; ++i) ids_[i] = active_[i] = static_cast<uint32_t>(i);
    resizeFresh(entries_, count_ * kListCapacity);
    sizes_.assign(count_, 0);
    best_.assign(count_, {0.0f, kNone});
    stale_.assign(count_, 1);
    touched_.assign(count_, 0);
    alias_ = ids_;
    changed_.assign(count_, 0);
    errors_.assign(count_, 0.0f);
    merges_.reserve(count_ == 0 ? 0 : count_ - 1);
  }

  std::vector<Merge> run(Progress* progress) {
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
      mergePairs();
      updateLists();
      // Long chains of ever cheaper partners have one pair each; taking costs within an eighth of
      // an octave for equal breaks them.
      coarse_ = pairs_.size() * 16 < before;
    }
    return std::move(merges_);
  }

 private:
  /// Costs of a node with the others of entries[0..count).
  void fillCosts(uint32_t slot, Entry* entries, size_t count) const {
    uint32_t others[2 * kListCapacity] = {};
    float costs[2 * kListCapacity];
    for (size_t k = 0; k < count; ++k) others[k] = entries[k].slot;
    nodes_.costs(slot, others, count, costs);
    for (size_t k = 0; k < count; ++k) entries[k].cost = costs[k];
  }

  /// A total order of the edges of a slot: by cost, ties shuffled so that equal costs leave many
  /// pairs, then by the other slot.
  bool isCheaper(uint32_t slot, const Entry& x, const Entry& y) const {
    const uint32_t shift = coarse_ ? 20 : 0;
    const uint32_t cost_x = std::bit_cast<uint32_t>(x.cost) >> shift;
    const uint32_t cost_y = std::bit_cast<uint32_t>(y.cost) >> shift;
    if (cost_x != cost_y) return cost_x < cost_y;
    const uint64_t shuffled_x = shuffled(slot, x.slot);
    const uint64_t shuffled_y = shuffled(slot, y.slot);
    return shuffled_x != shuffled_y ? shuffled_x < shuffled_y : x.slot < y.slot;
  }

  static uint64_t shuffled(uint32_t a, uint32_t b) {
    return mixBits((static_cast<uint64_t>(std::min(a, b)) << 32) | std::max(a, b));
  }

  void searchNeighbours() {
    const size_t count = active_.size();
    const size_t width = nodes_.placeWidth();
    std::vector<double> places;
    resizeFresh(places, count * width);
    parallelFor(count, kGrain * 16, [&](size_t begin, size_t end) {
      nodes_.places(std::span(active_).subspan(begin, end - begin), &places[begin * width]);
    });
    for (const uint32_t slot : active_) sizes_[slot] = 0;
    const std::vector<uint32_t> rows = nearestNeighbours(places, kMergeNeighbours, width);
    const auto append = [&](uint32_t slot, uint32_t other) {
      if (sizes_[slot] == kListCapacity) return;
      entries_[slot * kListCapacity + sizes_[slot]++] = {0.0f, other};
    };
    std::vector<uint8_t> one_sided(count, 0);  // bit k: the neighbour k does not know the slot
    static_assert(kMergeNeighbours <= 8);
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        for (size_t k = 0; k < kMergeNeighbours; ++k) {
          const uint32_t other = rows[i * kMergeNeighbours + k];
          if (other == kNoPlace) break;
          append(active_[i], active_[other]);
          const uint32_t* back = &rows[other * kMergeNeighbours];
          const bool known = std::find(back, back + kMergeNeighbours, i) != back + kMergeNeighbours;
          one_sided[i] = static_cast<uint8_t>(one_sided[i] | (known ? 0 : 1) << k);
        }
      }
    });
    // Who is a neighbour's neighbour comes after the slot's own, in the order of the slots. Where
    // there is no room, the edge is given up at its other end.
    for (size_t i = 0; i < count; ++i) {
      const uint8_t asking = one_sided[i];
      one_sided[i] = 0;
      for (size_t k = 0; asking >> k != 0; ++k) {
        if (!(asking >> k & 1)) continue;
        const uint32_t other = active_[rows[i * kMergeNeighbours + k]];
        if (sizes_[other] < kListCapacity) {
          append(other, active_[i]);
        } else {
          one_sided[i] = static_cast<uint8_t>(one_sided[i] | 1 << k);
        }
      }
    }
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) keepEntries(active_[i], ~uint32_t{one_sided[i]});
    });
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) lookAround(active_[i], {active_[i]});
    });
    // An edge costs the same from both ends: the lower slot finds out.
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const uint32_t slot = active_[i];
        Entry* list = &entries_[slot * kListCapacity];
        Entry* above = std::partition(list, list + sizes_[slot],
                                      [&](const Entry& e) { return e.slot < slot; });
        fillCosts(slot, above, static_cast<size_t>(list + sizes_[slot] - above));
        stale_[slot] = 1;
      }
    });
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        Entry* list = &entries_[active_[i] * kListCapacity];
        for (Entry* entry = list; entry < list + sizes_[active_[i]]; ++entry) {
          if (entry->slot < active_[i]) entry->cost = entryOf(entry->slot, active_[i])->cost;
        }
      }
    });
  }

  /// What a slot lists about another that it does list; null: it does not.
  const Entry* entryOf(uint32_t slot, uint32_t other) const {
    const Entry* list = &entries_[slot * kListCapacity];
    for (size_t k = 0; k < sizes_[slot]; ++k) {
      if (list[k].slot == other) return list + k;
    }
    return nullptr;
  }

  void choosePairs() {
    const bool all = coarse_ != was_coarse_;
    was_coarse_ = coarse_;
    parallelFor(active_.size(), kGrain * 16, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const uint32_t slot = active_[i];
        if (!all && !stale_[slot]) continue;
        stale_[slot] = 0;
        const Entry* list = &entries_[slot * kListCapacity];
        best_[slot] = {0.0f, kNone};
        for (size_t k = 0; k < sizes_[slot]; ++k) {
          if (best_[slot].slot == kNone || isCheaper(slot, list[k], best_[slot])) {
            best_[slot] = list[k];
          }
        }
      }
    });
    const auto isPair = [&](uint32_t slot) {
      const uint32_t other = best_[slot].slot;
      return other != kNone && slot < other && best_[other].slot == slot;
    };
    const std::vector<uint32_t> first = chosen(active_, isPair);
    pairs_.clear();
    for (const uint32_t slot : first) pairs_.push_back({slot, best_[slot].slot});
  }

  /// Those slots of a list that are chosen, in its order.
  template <typename IsChosen>
  static std::vector<uint32_t> chosen(const std::vector<uint32_t>& slots, IsChosen is_chosen) {
    constexpr size_t kPart = kGrain * 32;
    std::vector<std::vector<uint32_t>> parts(rangeCount(slots.size(), kPart));
    parallelFor(slots.size(), kPart, [&](size_t begin, size_t end) {
      std::vector<uint32_t>& part = parts[begin / kPart];
      part.reserve(end - begin);
      for (size_t i = begin; i < end; ++i) {
        if (is_chosen(slots[i])) part.push_back(slots[i]);
      }
    });
    if (parts.size() == 1) return std::move(parts[0]);
    std::vector<uint32_t> all;
    size_t count = 0;
    for (const std::vector<uint32_t>& part : parts) count += part.size();
    all.reserve(count);
    for (const std::vector<uint32_t>& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
  }

  void mergePairs() {
    ++round_;
    const size_t first_merge = merges_.size();
    merges_.resize(first_merge + pairs_.size());
    parallelFor(pairs_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const auto [a, b] = pairs_[i];
        const uint32_t id = static_cast<uint32_t>(count_ + first_merge + i);
        const float made = nodes_.merge(a, b, {id, ids_[a], ids_[b]});
        // Never below that of the children, so that a cut refines from the top.
        const float error = std::max({best_[a].cost, made, errors_[a], errors_[b]});
        merges_[first_merge + i] = {ids_[a], ids_[b], error};
        ids_[a] = id;
        errors_[a] = error;
        alias_[b] = a;
        changed_[a] = changed_[b] = round_;
      }
    });
  }

  void updateLists() {
    parallelFor(pairs_.size(), kGrain / 4, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        lookAround(pairs_[i].first, {pairs_[i].first, pairs_[i].second});
      }
    });
    parallelFor(pairs_.size(), kGrain / 4, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) takeOver(pairs_[i].first, pairs_[i].second);
    });
    std::vector<uint32_t> merged(pairs_.size());
    for (size_t i = 0; i < merged.size(); ++i) merged[i] = pairs_[i].first;
    keepMutual(merged);
    active_ = chosen(active_, [&](uint32_t slot) { return alias_[slot] == slot; });
    parallelFor(active_.size(), kGrain * 16, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const uint32_t slot = active_[i];
        if (touched_[slot] != round_ || changed_[slot] == round_) continue;
        follow(slot);
        stale_[slot] = 1;
      }
    });
  }

  /// Keeps those entries of a list whose bit is set.
  void keepEntries(uint32_t slot, uint32_t kept) {
    static_assert(kListCapacity <= 32);
    Entry* list = &entries_[slot * kListCapacity];
    uint8_t count = 0;
    for (size_t k = 0; k < sizes_[slot]; ++k) {
      if (kept >> k & 1) list[count++] = list[k];
    }
    sizes_[slot] = count;
  }

  /// Of nodes that merged in this round: drops entries among each other that the partner did not
  /// keep.
  void keepMutual(const std::vector<uint32_t>& slots) {
    std::vector<uint32_t> kept(slots.size());
    parallelFor(slots.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const Entry* list = &entries_[slots[i] * kListCapacity];
        for (size_t k = 0; k < sizes_[slots[i]]; ++k) {
          const uint32_t other = list[k].slot;
          const bool mutual = changed_[other] != round_ || entryOf(other, slots[i]) != nullptr;
          kept[i] |= (mutual ? 1u : 0u) << k;
        }
      }
    });
    parallelFor(slots.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) keepEntries(slots[i], kept[i]);
    });
  }

  /// What is around a node: itself and the partners of those whose lists are its own. Who is near
  /// to both children counts twice.
  void lookAround(uint32_t slot, std::initializer_list<uint32_t> sources) {
    uint32_t others[2 * kListCapacity];
    size_t count = 0;
    for (const uint32_t source : sources) {
      const Entry* list = &entries_[source * kListCapacity];
      for (size_t k = 0; k < sizes_[source]; ++k) {
        const uint32_t other = alias_[list[k].slot];
        if (other != slot) others[count++] = other;
      }
    }
    nodes_.lookAround(slot, {others, count});
  }

  /// The list of a merged node: the partners of both children, the cheapest kept.
  void takeOver(uint32_t a, uint32_t b) {
    Entry candidates[2 * kListCapacity];
    size_t count = 0;
    for (const uint32_t child : {a, b}) {
      const Entry* list = &entries_[child * kListCapacity];
      for (size_t k = 0; k < sizes_[child]; ++k) {
        // Entries are mutual: these are all who have to look again.
        AtomicRef<uint32_t>(touched_[list[k].slot]).store(round_, std::memory_order_relaxed);
        const uint32_t slot = alias_[list[k].slot];
        if (slot == a) continue;
        bool known = false;
        for (size_t j = 0; j < count; ++j) known |= candidates[j].slot == slot;
        if (known) continue;
        candidates[count++] = {0.0f, slot};
        nodes_.fetchAhead(slot);
      }
    }
    fillCosts(a, candidates, count);
    stale_[a] = 1;
    if (count > kListCapacity) {
      std::nth_element(candidates, candidates + kListCapacity, candidates + count,
                       [&](const Entry& x, const Entry& y) { return isCheaper(a, x, y); });
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
      if (const Entry* back = entryOf(other, slot)) list[kept++] = {back->cost, other};
    }
    sizes_[slot] = static_cast<uint8_t>(kept);
  }

  struct Pair {
    uint32_t first;
    uint32_t second;
  };

  MergingNodes& nodes_;
  size_t count_;
  std::vector<uint32_t> ids_;      ///< [slots] of the node that lives there
  std::vector<uint32_t> active_;   ///< slots in use, ascending
  std::vector<Entry> entries_;     ///< [slots, kListCapacity]
  std::vector<uint8_t> sizes_;     ///< [slots] entries in use
  std::vector<Entry> best_;        ///< [slots] the cheapest one
  std::vector<uint8_t> stale_;     ///< [slots] 1: the list has changed since best_ was found
  std::vector<uint32_t> touched_;  ///< [slots] last round in which a partner merged
  std::vector<uint32_t> alias_;    ///< [slots] itself, or where it merged into in this round
  std::vector<uint32_t> changed_;  ///< [slots] last round in which it merged
  std::vector<float> errors_;      ///< [slots]
  std::vector<Pair> pairs_;
  std::vector<Merge> merges_;
  uint32_t round_ = 0;
  bool coarse_ = false;
  bool was_coarse_ = false;
};

}  // namespace

std::vector<Merge> mergeInRounds(MergingNodes& nodes, Progress* progress) {
  return MergeRounds(nodes).run(progress);
}

}  // namespace stipple
