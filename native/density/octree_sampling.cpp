// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), ancestral systematic sampling.
// Differs: see level_sampling.cpp, whose bits this file gives from precomputed tables. The number
// of anchors of a subtree is known before it is entered, so subtrees write to their own places.
#include "density/octree_sampling.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "density/anchor_writer.h"
#include "density/child_splits.h"

namespace stipple {
namespace {

// A task has at most this many anchors or this share of all: enough tasks to keep threads busy,
// each long against the cost of starting it.
constexpr uint64_t kTaskAnchors = 8192;
constexpr uint64_t kTaskCount = 256;

uint32_t taskLimit(uint64_t count) {
  return static_cast<uint32_t>(std::max(kTaskAnchors, count / kTaskCount));
}

/// Part of one leaf's anchors.
struct LeafTask {
  uint32_t leaf;
  uint32_t first;  ///< index in the leaf
  uint32_t count;
  size_t place;
};

/// Counts finished anchors; tells the listener and stops the work when it is cancelled.
class AnchorProgress {
 public:
  AnchorProgress(Progress* progress, uint64_t count) : progress_(progress), count_(count) {}
  void add(uint64_t anchors) {
    if (progress_ == nullptr) return;
    const uint64_t done = done_.fetch_add(anchors, std::memory_order_relaxed) + anchors;
    advance(progress_, static_cast<double>(done) / static_cast<double>(count_), "Sampling anchors");
  }

 private:
  Progress* progress_;
  uint64_t count_;
  std::atomic<uint64_t> done_{0};
};

/// What both orders share: leaves that are too large for one task, and the output.
class LeafOutput {
 public:
  LeafOutput(const SamplingTables& tables, const AnchorSamplingOptions& options, AnchorSet& anchors)
      : tables_(tables), writer_(anchors, options.seed), limit_(taskLimit(options.count)) {}

  uint32_t limit() const { return limit_; }

  void put(uint32_t leaf, uint32_t count, size_t place) const { write({leaf, 0, count, place}); }

  void putOff(uint32_t leaf, uint32_t count, size_t place) {
    for (uint32_t first = 0; first < count; first += limit_) {
      tasks_.push_back({leaf, first, std::min(limit_, count - first), place + first});
    }
  }

  void runTasks(AnchorProgress& progress) const {
    parallelFor(tasks_.size(), 1, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        write(tasks_[i]);
        progress.add(tasks_[i].count);
      }
    });
  }

 private:
  void write(const LeafTask& task) const {
    const SamplingTables::Leaf& leaf = tables_.leaves[task.leaf];
    writer_.write(leaf.code, leaf.log_q, task.first, task.count, task.place);
  }

  const SamplingTables& tables_;
  AnchorWriter writer_;
  uint32_t limit_;
  std::vector<LeafTask> tasks_;
};

class SystematicSampler {
 public:
  SystematicSampler(const OctreeTables& octree, const AnchorSamplingOptions& options,
                    AnchorSet& anchors)
      : octree_(octree), seed_(options.seed), output_(octree.tables, options, anchors) {
    plan(0, {0, static_cast<uint32_t>(options.count)}, 0);
  }

  void run(AnchorProgress& progress) {
    output_.runTasks(progress);
    parallelFor(subtrees_.size(), 1, [&](size_t begin, size_t end) {
      std::vector<Share> frontier;
      std::vector<Share> next;
      for (size_t i = begin; i < end; ++i) {
        sampleSubtree(subtrees_[i], frontier, next);
        progress.add(subtrees_[i].share.count);
      }
    });
  }

 private:
  /// Anchors that a cell holds.
  struct Share {
    uint32_t cell;
    uint32_t count;
  };
  struct Subtree {
    size_t level;
    Share share;
    size_t place;
  };

  /// Calls take(child, count) for the children of a cell that get anchors, in order.
  template <class Take>
  void part(size_t level, Share share, const Take& take) const {
    const SamplingTables::Level& table = octree_.tables.levels[level];
    const uint32_t first = table.first_child[share.cell];
    const uint32_t end = table.first_child[share.cell + 1];
    const uint64_t key = cellKey(static_cast<int>(level), octree_.cells[level][share.cell]);
    const double u = unitDouble(keyedBits(seed_, RandomUse::kSystematicSplit, key));
    uint32_t before = 0;
    for (uint32_t child = first; child < end; ++child) {
      const uint32_t below = systematicBelow(share.count, table.shares[child], 1.0 - u);
      take(Share{child, below - before});
      before = below;
    }
  }

  /// Walks down on one thread until the subtrees are small enough for a task.
  void plan(size_t level, Share share, size_t place) {
    if (share.count == 0) return;
    if (share.count <= output_.limit() && level < octree_.tables.levels.size()) {
      subtrees_.push_back({level, share, place});
    } else if (level == octree_.tables.levels.size()) {
      output_.putOff(share.cell, share.count, place);
    } else {
      part(level, share, [&](Share child) {
        plan(level + 1, child, place);
        place += child.count;
      });
    }
  }

  void sampleSubtree(const Subtree& subtree, std::vector<Share>& frontier,
                     std::vector<Share>& next) const {
    // A level has at most one cell for each anchor; one more is written and then overwritten.
    frontier.resize(subtree.share.count + 1);
    next.resize(subtree.share.count + 1);
    frontier[0] = subtree.share;
    size_t size = 1;
    const size_t leaf_level = octree_.tables.levels.size();
    for (size_t level = subtree.level; level + 1 < leaf_level; ++level) {
      size_t next_size = 0;
      for (size_t i = 0; i < size; ++i) {
        part(level, frontier[i], [&](Share child) {
          next[next_size] = child;
          next_size += child.count > 0 ? 1 : 0;
        });
      }
      std::swap(frontier, next);
      size = next_size;
    }
    size_t place = subtree.place;
    for (size_t i = 0; i < size; ++i) {
      part(leaf_level - 1, frontier[i], [&](Share leaf) {
        output_.put(leaf.cell, leaf.count, place);
        place += leaf.count;
      });
    }
  }

  const OctreeTables& octree_;
  uint64_t seed_;
  LeafOutput output_;
  std::vector<Subtree> subtrees_;
};

class ProgressiveSampler {
 public:
  ProgressiveSampler(const SamplingTables& tables, const AnchorSamplingOptions& options,
                     AnchorSet& anchors)
      : tables_(tables), seed_(options.seed), output_(tables, options, anchors), anchors_(anchors) {
    if (options.with_ranks) {
      ranks_.resize(options.count);
      scratch_.resize(options.count);
      for (size_t i = 0; i < ranks_.size(); ++i) ranks_[i] = static_cast<uint32_t>(i + 1);
    }
    plan({0, 0, static_cast<uint32_t>(tables.leaves.size()), static_cast<uint32_t>(options.count)},
         0);
  }

  void run(AnchorProgress& progress) {
    output_.runTasks(progress);
    parallelFor(subtrees_.size(), 1, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (ranks_.empty()) {
          sampleSubtree<false>(subtrees_[i].node, subtrees_[i].place);
        } else {
          sampleSubtree<true>(subtrees_[i].node, subtrees_[i].place);
        }
        progress.add(subtrees_[i].node.count);
      }
    });
    parallelFor(ranks_.size(), kTaskAnchors, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) anchors_.ranks[i] = ranks_[i];
    });
  }

 private:
  /// A node of the binary tree with its anchors.
  struct Node {
    uint32_t split;  ///< place in the preorder; meaningless for a leaf
    uint32_t leaf;   ///< first leaf
    uint32_t leaves;
    uint32_t count;
  };
  struct Subtree {
    Node node;
    size_t place;
  };

  /// The halves of a node with two leaves or more.
  std::pair<Node, Node> part(const Node& node, size_t place, bool with_ranks) {
    const SamplingTables::Split& split = tables_.splits[node.split];
    const uint32_t u = splitUniform(keyedBits(seed_, RandomUse::kProgressiveSplit, split.key));
    const uint32_t up = upperCount(node.count, split.share, u);
    if (with_ranks) {
      partRanks(std::span(ranks_).subspan(place, node.count), split.share, u, &scratch_[place]);
    }
    return {{node.split + 1, node.leaf, split.lower_leaves, node.count - up},
            {node.split + split.lower_leaves, node.leaf + split.lower_leaves,
             node.leaves - split.lower_leaves, up}};
  }

  /// Walks down on one thread until the subtrees are small enough for a task.
  void plan(const Node& node, size_t place) {
    if (node.count == 0) return;
    if (node.count <= output_.limit()) {
      subtrees_.push_back({node, place});
    } else if (node.leaves == 1) {
      output_.putOff(node.leaf, node.count, place);
    } else {
      const auto [lower, upper] = part(node, place, !ranks_.empty());
      plan(lower, place);
      plan(upper, place + lower.count);
    }
  }

  template <bool with_ranks>
  void sampleSubtree(Node node, size_t place) {
    std::array<Node, 32> stack;  // upper halves put off: at most one for each of the 30 splits
    size_t height = 0;
    while (true) {
      while (node.leaves > 1) {
        const auto [lower, upper] = part(node, place, with_ranks);
        if (lower.count == 0) {
          node = upper;
          continue;
        }
        stack[height] = upper;
        height += upper.count > 0 ? 1 : 0;
        node = lower;
      }
      output_.put(node.leaf, node.count, place);
      place += node.count;
      if (height == 0) return;
      node = stack[--height];
    }
  }

  const SamplingTables& tables_;
  uint64_t seed_;
  LeafOutput output_;
  AnchorSet& anchors_;
  std::vector<Subtree> subtrees_;
  std::vector<uint32_t> ranks_;
  std::vector<uint32_t> scratch_;
};

}  // namespace

void sampleOctree(const OctreeTables& octree, const AnchorSamplingOptions& options,
                  Progress* progress, AnchorSet& anchors) {
  AnchorProgress anchor_progress(progress, options.count);
  if (options.order == AnchorOrder::kSystematic) {
    SystematicSampler(octree, options, anchors).run(anchor_progress);
  } else {
    ProgressiveSampler(octree.tables, options, anchors).run(anchor_progress);
  }
}

}  // namespace stipple
