#include "decode/tree/merge_tree.h"

#include <algorithm>

#include "base/fresh_memory.h"
#include "base/parallel.h"
#include "data/clouds/cloud_extent.h"
#include "decode/tree/merge_cost.h"
#include "decode/tree/merge_leaves.h"
#include "decode/tree/merge_rounds.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 2048;

void validateInput(const SplatCloud& leaves, std::span<const float> visibility,
                   const MergeTreeOptions& options) {
  validate(leaves, "cloud");
  requireLeafCount(leaves.size(), "cloud");
  requireVisibility(visibility, leaves.size());
  requireFootprint(options.footprint);
}

/// Splats that stand.
class StandingNodes final : public MergingNodes {
 public:
  StandingNodes(const SplatCloud& leaves, const std::vector<uint32_t>& order,
                std::span<const float> visibility, const MergeScale& scale, SplatCloud& merged)
      : scale_(scale), merged_(merged), harmonics_(leaves, order, merged) {
    resizeFresh(nodes_, leaves.size());
    parallelFor(nodes_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const double seen = visibility.empty() ? 1.0 : countedVisibility(visibility[order[i]]);
        nodes_[i] = leafNode(leaves, order[i], seen, scale);
      }
    });
  }

  size_t size() const override { return nodes_.size(); }
  size_t placeWidth() const override { return 3; }

  void places(std::span<const uint32_t> slots, double* places) const override {
    for (size_t i = 0; i < slots.size(); ++i) {
      std::copy_n(nodes_[slots[i]].mean.begin(), 3, places + 3 * i);
    }
  }

  void lookAround(uint32_t slot, std::span<const uint32_t> others) override {
    Surrounding surrounding;
    surrounding.add(nodes_[slot]);
    for (const uint32_t other : others) surrounding.add(nodes_[other]);
    nodes_[slot].around = surrounding.mean();
  }

  void costs(uint32_t slot, const uint32_t* others, size_t count, float* costs) const override {
    kernel_.costs(nodes_.data(), slot, others, count, scale_, costs);
  }

  float merge(uint32_t first, uint32_t second, const MergeIds& ids) override {
    const MergeNode merged = mergedNode(nodes_[first], nodes_[second], scale_);
    writeNode(merged, scale_, merged_, ids.merged - nodes_.size());
    harmonics_.mix(ids, merged.weight > 0 ? nodes_[first].weight / merged.weight : 0.5);
    nodes_[first] = merged;
    return 0;
  }

  void fetchAhead(uint32_t slot) const override {
    const char* bytes = reinterpret_cast<const char*>(&nodes_[slot]);
    for (size_t line = 0; line < sizeof(MergeNode); line += 64) __builtin_prefetch(bytes + line);
  }

 private:
  MergeScale scale_;
  std::vector<MergeNode> nodes_;  ///< [slots]
  SplatCloud& merged_;
  HarmonicRows harmonics_;
  MergeCostKernel kernel_ = chosenMergeCostKernel();
};

}  // namespace

MergeTree buildMergeTree(const SplatCloud& leaves, std::span<const float> visibility,
                         const MergeTreeOptions& options, Progress* progress) {
  validateInput(leaves, visibility, options);
  const size_t leaf_count = leaves.size();
  const CloudExtent extent = cloudExtent(leaves);
  const std::vector<uint32_t> order = spatialOrder(leaves.positions, extent);
  const MergeScale scale = mergeScale(extent, options.footprint);

  MergeTree tree;
  tree.nodes = emptyLike(leaves, leaf_count - 1);
  std::vector<Merge> merges;
  {
    StandingNodes nodes(leaves, order, visibility, scale, tree.nodes);
    merges = mergeInRounds(nodes, progress);
  }
  gatherRows(tree.nodes, numberNodes(merges, order, tree));
  return tree;
}

uint64_t mergeTreeMemoryBound(uint64_t leaf_count, int sh_degree) {
  // Inner nodes and their copy while they are numbered: 11 numbers and the harmonics.
  const uint64_t row = 4 * (11 + 3 * shCoefficientCount(sh_degree));
  return leaf_count * (2 * row + sizeof(MergeNode) + mergeBytesPerNode(3) + 64) +
         (uint64_t{1} << 20);
}

void validateTree(const MergeTree& tree, const SplatCloud& leaves, const char* what) {
  validateShape(tree, leaves.size(), what);
  requireNodesLike(tree.nodes, leaves, what);
}

}  // namespace stipple
