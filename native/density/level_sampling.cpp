// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), ancestral systematic sampling.
// Differs: cells without mass never get an anchor, not even for U = 0; counts in double precision;
// an order that nests the anchors of all budgets.
#include "density/level_sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/parallel.h"
#include "density/anchor_writer.h"
#include "density/child_splits.h"

namespace stipple {
namespace {

constexpr size_t kGrain = 1024;

/// The cells of one level that hold anchors, in Morton order.
struct Frontier {
  std::vector<uint64_t> cells;
  std::vector<uint32_t> counts;
  std::vector<double> log_q;

  /// Empties it and makes room, so that growing never holds two copies.
  void restart(size_t room) {
    cells.clear();
    counts.clear();
    log_q.clear();
    cells.reserve(room);
    counts.reserve(room);
    log_q.reserve(room);
  }
};

/// Where the numbers of a split come from.
class SplitNumbers {
 public:
  SplitNumbers(uint64_t seed, UniformSource* source) : seed_(seed), source_(source) {}
  double systematic(uint64_t key) const {
    return source_ != nullptr ? source_->uniform(RandomUse::kSystematicSplit, key)
                              : unitDouble(keyedBits(seed_, RandomUse::kSystematicSplit, key));
  }
  uint32_t progressive(uint64_t key) const {
    if (source_ == nullptr) {
      return splitUniform(keyedBits(seed_, RandomUse::kProgressiveSplit, key));
    }
    return static_cast<uint32_t>(source_->uniform(RandomUse::kProgressiveSplit, key) * 0x1.0p32);
  }

 private:
  uint64_t seed_;
  UniformSource* source_;
};

std::array<uint32_t, 8> partSystematically(uint32_t n, const std::array<double, 8>& probabilities,
                                           double u) {
  const std::array<double, 8> shares = cumulativeShares(probabilities);
  std::array<uint32_t, 8> counts{};
  uint32_t before = 0;
  for (size_t k = 0; k < 8; ++k) {
    if (probabilities[k] <= 0.0) continue;
    const uint32_t below = systematicBelow(n, shares[k], 1.0 - u);
    counts[k] = below - before;
    before = below;
  }
  return counts;
}

/// In: ranks: the arrival ranks of the cell's anchors, or empty. Out: parted among the children.
std::array<uint32_t, 8> partProgressively(uint32_t n, const std::array<double, 8>& probabilities,
                                          uint64_t key, const SplitNumbers& numbers,
                                          std::span<uint32_t> ranks, uint32_t* scratch) {
  const BinaryShares shares = binaryShares(probabilities);
  std::array<uint32_t, 16> counts{};
  counts[1] = n;
  std::array<uint32_t, 16> first{};
  for (size_t node = 1; node < 8; ++node) {
    const uint64_t share = shares[node];
    const bool splits = share > 0 && share < kFullShare;
    // The key of a node is that of its cell with the halves taken so far behind it.
    const int depth = node >= 4 ? 2 : node >= 2 ? 1 : 0;
    const uint64_t node_key = key << depth | (node - (size_t{1} << depth));
    const bool draws = splits && counts[node] > 0;
    const uint32_t u = draws ? numbers.progressive(node_key) : 0;
    const uint32_t up = upperCount(counts[node], share, u);
    counts[2 * node + 1] = up;
    counts[2 * node] = counts[node] - up;
    first[2 * node] = first[node];
    first[2 * node + 1] = first[node] + counts[2 * node];
    if (draws && !ranks.empty()) {
      partRanks(ranks.subspan(first[node], counts[node]), share, u, scratch);
    }
  }
  std::array<uint32_t, 8> children;
  std::copy(counts.begin() + 8, counts.end(), children.begin());
  return children;
}

class LevelSampler {
 public:
  LevelSampler(const DensityModel& model, const AnchorSamplingOptions& options,
               UniformSource* source, Progress* progress)
      : model_(model),
        options_(options),
        numbers_(options.seed, source),
        source_(source),
        progress_(progress) {
    if (options.with_ranks) {
      ranks_.resize(options.count);
      scratch_.resize(options.count);
      for (size_t i = 0; i < ranks_.size(); ++i) ranks_[i] = static_cast<uint32_t>(i + 1);
    }
  }

  void sample(AnchorSet& anchors) {
    Frontier frontier{{0}, {static_cast<uint32_t>(options_.count)}, {0.0}};
    Frontier next;
    for (int level = 0; level < anchors.leaf_level; ++level) {
      next.restart(std::min<size_t>(options_.count, 8 * frontier.cells.size()));
      size_t place = 0;
      const size_t question = std::max<size_t>(model_.questionCells(), 1);
      for (size_t begin = 0; begin < frontier.cells.size(); begin += question) {
        advance(progress_,
                (level + static_cast<double>(begin) / static_cast<double>(frontier.cells.size())) /
                    (anchors.leaf_level + 1),
                "Sampling anchors");
        const size_t end = std::min(frontier.cells.size(), begin + question);
        place = descend(level, frontier, begin, end, place, next);
      }
      std::swap(frontier, next);
    }
    writeLeaves(frontier, anchors);
  }

 private:
  /// Appends the children of frontier cells begin..end-1 to `next`. In: place: number of anchors
  /// before cell `begin`. Returns that before cell `end`.
  size_t descend(int level, const Frontier& frontier, size_t begin, size_t end, size_t place,
                 Frontier& next) {
    const size_t cell_count = end - begin;
    log_probabilities_.resize(8 * cell_count);
    child_counts_.resize(cell_count);
    places_.resize(cell_count);
    for (size_t i = 0; i < cell_count; ++i) {
      places_[i] = place;
      place += frontier.counts[begin + i];
    }
    model_.childLogProbabilities(level, std::span(frontier.cells).subspan(begin, cell_count),
                                 log_probabilities_, progress_);
    // Numbers of a source come in the order of the cells.
    parallelFor(cell_count, source_ != nullptr ? cell_count : kGrain, [&](size_t from, size_t to) {
      for (size_t i = from; i < to; ++i) {
        const auto probabilities = childProbabilities(&log_probabilities_[8 * i]);
        const uint64_t key = cellKey(level, frontier.cells[begin + i]);
        const uint32_t n = frontier.counts[begin + i];
        if (options_.order == AnchorOrder::kSystematic) {
          child_counts_[i] = partSystematically(n, probabilities, numbers_.systematic(key));
        } else {
          const auto ranks =
              ranks_.empty() ? std::span<uint32_t>() : std::span(ranks_).subspan(places_[i], n);
          child_counts_[i] = partProgressively(n, probabilities, key, numbers_, ranks,
                                               scratch_.data() + (ranks_.empty() ? 0 : places_[i]));
        }
      }
    });
    for (size_t i = 0; i < cell_count; ++i) {
      for (size_t k = 0; k < 8; ++k) {
        if (child_counts_[i][k] == 0) continue;
        next.cells.push_back(frontier.cells[begin + i] << 3 | k);
        next.counts.push_back(child_counts_[i][k]);
        next.log_q.push_back(frontier.log_q[begin + i] +
                             static_cast<double>(log_probabilities_[8 * i + k]));
      }
    }
    return place;
  }

  void writeLeaves(const Frontier& leaves, AnchorSet& anchors) {
    std::copy(ranks_.begin(), ranks_.end(), anchors.ranks.begin());
    std::vector<size_t> places(leaves.cells.size());
    size_t place = 0;
    for (size_t i = 0; i < places.size(); ++i) {
      places[i] = place;
      place += leaves.counts[i];
    }
    const AnchorWriter writer(anchors, options_.seed);
    if (source_ != nullptr) {
      for (size_t i = 0; i < places.size(); ++i) writeFromSource(writer, leaves, i, places[i]);
      return;
    }
    parallelFor(places.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        writer.write(leaves.cells[i], static_cast<float>(leaves.log_q[i]), 0, leaves.counts[i],
                     places[i]);
      }
    });
  }

  void writeFromSource(const AnchorWriter& writer, const Frontier& leaves, size_t i, size_t place) {
    const uint64_t key = cellKey(model_.leafLevel(), leaves.cells[i]);
    for (uint32_t j = 0; j < leaves.counts[i]; ++j) {
      std::array<double, 3> u;
      for (size_t axis = 0; axis < 3; ++axis) {
        u[axis] = source_->uniform(RandomUse::kLeafJitter, (key << 28 | j) * 4 + axis);
      }
      writer.writeAt(leaves.cells[i], static_cast<float>(leaves.log_q[i]), u.data(), place + j);
    }
  }

  const DensityModel& model_;
  const AnchorSamplingOptions& options_;
  SplitNumbers numbers_;
  UniformSource* source_;
  Progress* progress_;
  std::vector<float> log_probabilities_;
  std::vector<std::array<uint32_t, 8>> child_counts_;
  std::vector<size_t> places_;
  std::vector<uint32_t> ranks_;
  std::vector<uint32_t> scratch_;
};

}  // namespace

void sampleLevelByLevel(const DensityModel& model, const AnchorSamplingOptions& options,
                        UniformSource* source, Progress* progress, AnchorSet& anchors) {
  LevelSampler(model, options, source, progress).sample(anchors);
}

}  // namespace stipple
