#include "density/sampling_tables.h"

#include <algorithm>
#include <array>
#include <limits>

#include "base/parallel.h"
#include "density/child_splits.h"

namespace stipple {
namespace {

constexpr size_t kGrain = 4096;
constexpr float kNothing = -std::numeric_limits<float>::infinity();

/// Builds the preorder of the binary splits from the octree.
class SplitBuilder {
 public:
  SplitBuilder(std::span<const std::vector<uint64_t>> cells,
               std::span<const std::vector<float>> log_probabilities, SamplingTables& tables)
      : cells_(cells), log_probabilities_(log_probabilities), tables_(tables) {
    const size_t level_count = tables.levels.size();
    first_leaf_.resize(level_count + 1);
    for (size_t level = level_count; level-- > 0;) {
      const std::vector<uint32_t>& first_child = tables.levels[level].first_child;
      const bool above_leaves = level + 1 == level_count;
      std::vector<uint32_t>& first_leaf = first_leaf_[level];
      first_leaf.resize(first_child.size());
      for (size_t i = 0; i < first_child.size(); ++i) {
        first_leaf[i] = above_leaves ? first_child[i] : first_leaf_[level + 1][first_child[i]];
      }
    }
  }

  void build() {
    tables_.splits.resize(tables_.leaves.size() - 1);
    // Subtrees of about a thousandth of the leaves are put off and then built side by side.
    put_off_below_ = tables_.leaves.size() / 1024;
    buildCell({0, 0, 0});
    const std::vector<Subtree> subtrees = std::move(put_off_);
    put_off_below_ = 0;
    parallelFor(subtrees.size(), 8, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) buildCell(subtrees[i]);
    });
  }

 private:
  struct Subtree {
    size_t level;
    uint32_t cell;
    uint32_t place;  ///< of its first split
  };

  uint32_t leafCount(size_t level, uint32_t begin, uint32_t end) const {
    if (level == tables_.levels.size()) return end - begin;
    return first_leaf_[level][end] - first_leaf_[level][begin];
  }

  void buildCell(const Subtree& subtree) {
    const size_t level = subtree.level;
    if (level == tables_.levels.size()) return;
    if (leafCount(level, subtree.cell, subtree.cell + 1) < put_off_below_) {
      put_off_.push_back(subtree);
      return;
    }
    const float* log_probabilities = &log_probabilities_[level][8 * size_t{subtree.cell}];
    const auto probabilities = childProbabilities(log_probabilities);
    const BinaryShares shares = binaryShares(probabilities);
    std::array<uint32_t, 9> child;  // index of child k, or of the first one behind it
    child[0] = tables_.levels[level].first_child[subtree.cell];
    for (size_t k = 0; k < 8; ++k) child[k + 1] = child[k] + (probabilities[k] > 0.0 ? 1 : 0);
    const uint64_t key = cellKey(static_cast<int>(level), cells_[level][subtree.cell]);
    buildNode(level, 1, key, shares, child, subtree.place);
  }

  void buildNode(size_t level, size_t node, uint64_t key, const BinaryShares& shares,
                 const std::array<uint32_t, 9>& child, uint32_t place) {
    if (node >= 8) {
      buildCell({level + 1, child[node - 8], place});
      return;
    }
    const uint64_t share = shares[node];
    if (share > 0 && share < kFullShare) {
      const size_t width = node >= 4 ? 1 : node >= 2 ? 2 : 4;  // children in a half
      const size_t begin = (2 * node * width) - 8;
      const uint32_t lower = leafCount(level + 1, child[begin], child[begin + width]);
      tables_.splits[place] = {static_cast<uint32_t>(share), static_cast<uint32_t>(key), lower};
      buildNode(level, 2 * node, key << 1, shares, child, place + 1);
      buildNode(level, 2 * node + 1, key << 1 | 1, shares, child, place + lower);
    } else {
      const size_t up = share == 0 ? 0 : 1;
      buildNode(level, 2 * node + up, key << 1 | up, shares, child, place);
    }
  }

  std::span<const std::vector<uint64_t>> cells_;
  std::span<const std::vector<float>> log_probabilities_;
  SamplingTables& tables_;
  std::vector<std::vector<uint32_t>> first_leaf_;
  std::vector<Subtree> put_off_;
  uint32_t put_off_below_ = 0;
};

}  // namespace

SamplingTables makeSamplingTables(std::span<const std::vector<uint64_t>> cells,
                                  std::span<const std::vector<float>> log_probabilities) {
  SamplingTables tables;
  tables.levels.resize(cells.size());
  std::vector<double> log_q{0.0};
  for (size_t level = 0; level < cells.size(); ++level) {
    const std::vector<float>& logs = log_probabilities[level];
    const size_t cell_count = cells[level].size();
    SamplingTables::Level& table = tables.levels[level];
    table.first_child.resize(cell_count + 1);
    for (size_t i = 0; i < cell_count; ++i) {
      uint32_t children = 0;
      for (size_t k = 0; k < 8; ++k) children += logs[8 * i + k] > kNothing ? 1 : 0;
      table.first_child[i + 1] = table.first_child[i] + children;
    }
    table.shares.resize(table.first_child.back());
    const bool above_leaves = level + 1 == cells.size();
    if (above_leaves) tables.leaves.resize(table.shares.size());
    std::vector<double> child_log_q(above_leaves ? 0 : table.shares.size());
    parallelFor(cell_count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const auto probabilities = childProbabilities(&logs[8 * i]);
        const auto shares = cumulativeShares(probabilities);
        size_t child = table.first_child[i];
        for (size_t k = 0; k < 8; ++k) {
          if (probabilities[k] <= 0.0) continue;
          table.shares[child] = shares[k];
          const double sum = log_q[i] + static_cast<double>(logs[8 * i + k]);
          if (above_leaves) {
            tables.leaves[child] = {static_cast<uint32_t>(cells[level][i] << 3 | k),
                                    static_cast<float>(sum)};
          } else {
            child_log_q[child] = sum;
          }
          ++child;
        }
      }
    });
    log_q = std::move(child_log_q);
  }
  SplitBuilder(cells, log_probabilities, tables).build();
  return tables;
}

}  // namespace stipple
