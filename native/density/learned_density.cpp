// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355): factorised octree density, cross
// entropy to surface points, score-function gradient. Differs: logits are stored per cell instead
// of coming from a network; each choice is mixed with an even one; the structural loss starts at
// its minimum, which is known in closed form.
#include "density/learned_density.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "density/octree_leaves.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 2048;
const float kEvenLog = static_cast<float>(-std::log(8.0));
/// Logits stay within this of each other's size: beyond it exp() of their differences is 0 anyway.
constexpr float kLargestLogit = 60.0f;
/// Share of what is kept that must lie in active cells of a level, before it goes down to it.
constexpr double kSettledShare = 0.98;
constexpr float kNothing = -std::numeric_limits<float>::infinity();

using Eight = std::array<double, 8>;

Eight softmax(const float* logits) {
  const float largest = *std::max_element(logits, logits + 8);
  Eight shares;
  double sum = 0;
  for (size_t k = 0; k < 8; ++k) {
    shares[k] = std::exp(static_cast<double>(logits[k]) - static_cast<double>(largest));
    sum += shares[k];
  }
  for (double& share : shares) share /= sum;
  return shares;
}

/// Mixture with the even choice; each at least kUniformShare / 8.
Eight mixed(const Eight& shares) {
  Eight out;
  for (size_t k = 0; k < 8; ++k) out[k] = (1 - kUniformShare) * shares[k] + kUniformShare / 8;
  return out;
}

/// Logits with softmax such that the mixture is p, as nearly as the even share lets it.
void logitsOf(const Eight& p, float* logits) {
  for (size_t k = 0; k < 8; ++k) {
    const double share = (p[k] - kUniformShare / 8) / (1 - kUniformShare);
    logits[k] = static_cast<float>(std::log(std::max(share, 0.1 * kUniformShare)));
  }
}

void requireLeafLevel(int level) {
  if (level >= 1 && level <= kMaxLeafLevel) return;
  fail(ErrorCode::kInvalidArgument, "the density's leaf level is " + std::to_string(level) +
                                        "; allowed is 1 to " + std::to_string(kMaxLeafLevel));
}

/// Row of a cell, or the number of rows.
size_t rowOf(const std::vector<uint64_t>& cells, uint64_t cell) {
  const auto at = std::lower_bound(cells.begin(), cells.end(), cell);
  return at != cells.end() && *at == cell ? static_cast<size_t>(at - cells.begin()) : cells.size();
}

/// Walks through ascending cells and the rows that hold them side by side.
class RowCursor {
 public:
  explicit RowCursor(const std::vector<uint64_t>& cells) : cells_(cells) {}
  /// Row of a cell that is not below the one before, or the number of rows.
  size_t find(uint64_t cell) {
    size_t step = 1;
    while (at_ + step < cells_.size() && cells_[at_ + step] <= cell) step *= 2;
    const auto begin = cells_.begin() + static_cast<ptrdiff_t>(at_ + step / 2);
    const auto end =
        cells_.begin() + static_cast<ptrdiff_t>(std::min(cells_.size(), at_ + step + 1));
    at_ = static_cast<size_t>(std::lower_bound(begin, end, cell) - cells_.begin());
    const bool found = at_ < cells_.size() && cells_[at_] == cell;
    const size_t row = found ? at_ : cells_.size();
    at_ = std::min(at_, cells_.size() - (cells_.empty() ? 0 : 1));
    return row;
  }

 private:
  const std::vector<uint64_t>& cells_;
  size_t at_ = 0;
};

/// Sums of g over the anchors of each child become sums of g minus the mean of the others' in the
/// cell: n / (n - 1) (g - mean of all n). In: counts, of anchors, in all at least two.
void subtractMeanOfOthers(const Eight& counts, Eight& sums) {
  const double count = std::accumulate(counts.begin(), counts.end(), 0.0);
  const double mean = std::accumulate(sums.begin(), sums.end(), 0.0) / count;
  for (size_t k = 0; k < 8; ++k) sums[k] = count / (count - 1) * (sums[k] - mean * counts[k]);
}

/// The points inside the root with weight.
void keepInside(std::span<const float> positions, std::span<const float> weights,
                const RootCube& root, std::vector<float>& kept, std::vector<float>& kept_weights) {
  for (size_t i = 0; i < positions.size() / 3; ++i) {
    bool inside = weights.empty() || weights[i] > 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double u =
          (static_cast<double>(positions[i * 3 + axis]) - root.origin[axis]) / root.side;
      inside = inside && u >= 0 && u < 1;
    }
    if (!inside) continue;
    kept.insert(kept.end(), &positions[i * 3], &positions[i * 3] + 3);
    kept_weights.push_back(weights.empty() ? 1.0f : weights[i]);
  }
}

}  // namespace

LearnedDensity::LearnedDensity(const RootCube& root, int leaf_level, int active_levels)
    : root_(root) {
  requireLeafLevel(leaf_level);
  levels_.resize(static_cast<size_t>(leaf_level));
  for (size_t l = 0; l < levels_.size() && static_cast<int>(l) < active_levels; ++l) {
    LearnedLevel& level = levels_[l];
    level.cells.resize(size_t{1} << (3 * l));
    for (size_t i = 0; i < level.cells.size(); ++i) level.cells[i] = i;
    level.logits.assign(level.cells.size() * 8, 0.0f);
    level.prior.assign(level.cells.size() * 8, 0.0f);
  }
  refreshAll();
}

LearnedDensity LearnedDensity::fromPoints(std::span<const float> positions,
                                          std::span<const float> weights, const RootCube& root,
                                          int leaf_level, int known_level) {
  requireLeafLevel(leaf_level);
  known_level = std::min(known_level, leaf_level);
  requireFinite(positions.data(), positions.size(), 3, "prior points: position");
  requireFinite(weights.data(), weights.size(), 1, "prior points: weight");
  std::vector<float> kept, kept_weights;
  keepInside(positions, weights, root, kept, kept_weights);
  if (kept_weights.empty()) return LearnedDensity(root, leaf_level);
  OctreeLeaves children = gatherLeaves(kept, kept_weights, root, known_level);
  double total = 0;
  for (const double mass : children.masses) total += mass;
  // Weights count as points: as many as there are, whatever their unit.
  const double to_count = static_cast<double>(kept_weights.size()) / total;
  LearnedDensity density(root, leaf_level);
  for (size_t l = static_cast<size_t>(known_level); l-- > 0;) {
    LearnedLevel level;
    OctreeLeaves parents;
    std::vector<Eight> masses;
    for (size_t i = 0; i < children.codes.size(); ++i) {
      const uint64_t parent = children.codes[i] >> 3;
      if (level.cells.empty() || level.cells.back() != parent) {
        level.cells.push_back(parent);
        masses.push_back({});
      }
      masses.back()[children.codes[i] & 7] += children.masses[i];
    }
    level.logits.resize(level.cells.size() * 8);
    level.prior.resize(level.cells.size() * 8);
    for (size_t i = 0; i < level.cells.size(); ++i) {
      double mass = 0;
      for (const double m : masses[i]) mass += m;
      Eight shares;
      for (size_t k = 0; k < 8; ++k) {
        shares[k] = (masses[i][k] * to_count + kPriorPseudoCount) /
                    (mass * to_count + 8 * kPriorPseudoCount);
        level.prior[i * 8 + k] = static_cast<float>(mass / total * shares[k]);
      }
      logitsOf(shares, &level.logits[i * 8]);
      parents.codes.push_back(level.cells[i]);
      parents.masses.push_back(mass);
    }
    density.levels_[l] = std::move(level);
    children = std::move(parents);
  }
  density.settled_level_ = 0;
  density.refreshAll();
  return density;
}

LearnedDensity::LearnedDensity(const RootCube& root, std::vector<LearnedLevel> levels,
                               int settled_level)
    : root_(root), levels_(std::move(levels)), settled_level_(settled_level) {
  requireLeafLevel(static_cast<int>(std::min<size_t>(levels_.size(), 100)));
  if (levels_[0].cells != std::vector<uint64_t>{0}) {
    fail(ErrorCode::kFormat, "level 0 of the density lists " +
                                 std::to_string(levels_[0].cells.size()) +
                                 " cells; the root alone, cell 0, is needed");
  }
  for (size_t l = 0; l < levels_.size(); ++l) {
    const LearnedLevel& level = levels_[l];
    const std::string name = "level " + std::to_string(l) + " of the density";
    if (level.logits.size() != level.cells.size() * 8 ||
        level.prior.size() != level.cells.size() * 8) {
      fail(ErrorCode::kFormat, name + " has " + std::to_string(level.logits.size()) +
                                   " logits and " + std::to_string(level.prior.size()) +
                                   " prior shares; 8 for each of its " +
                                   std::to_string(level.cells.size()) + " cells are needed");
    }
    requireFinite(level.logits.data(), level.logits.size(), 8, (name + ": logits").c_str());
    requireFinite(level.prior.data(), level.prior.size(), 8, (name + ": prior").c_str());
    for (size_t i = 0; i < level.cells.size(); ++i) {
      const bool ascends = i == 0 || level.cells[i] > level.cells[i - 1];
      const bool has_parent =
          l == 0 || rowOf(levels_[l - 1].cells, level.cells[i] >> 3) < levels_[l - 1].cells.size();
      if (ascends && has_parent) continue;
      fail(ErrorCode::kFormat, name + " lists cell " + std::to_string(level.cells[i]) +
                                   " out of order or without its parent; ascending cells below "
                                   "those of the level above are needed");
    }
  }
  const bool is_there = settled_level >= 0 && static_cast<size_t>(settled_level) <= levels_.size();
  if (!is_there ||
      (settled_level > 0 && levels_[static_cast<size_t>(settled_level) - 1].cells.empty())) {
    fail(ErrorCode::kFormat, "the density is settled down to level " +
                                 std::to_string(settled_level) + ", which has no cells above it");
  }
  refreshAll();
}

void LearnedDensity::refresh(int level, size_t row) {
  const size_t l = static_cast<size_t>(level);
  const Eight q = mixed(softmax(&levels_[l].logits[row * 8]));
  for (size_t k = 0; k < 8; ++k) {
    log_probabilities_[l][row * 8 + k] = static_cast<float>(std::log(q[k]));
  }
}

void LearnedDensity::refreshAll() {
  log_probabilities_.resize(levels_.size());
  for (size_t l = 0; l < levels_.size(); ++l) {
    log_probabilities_[l].resize(levels_[l].logits.size());
    parallelFor(levels_[l].cells.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t row = begin; row < end; ++row) refresh(static_cast<int>(l), row);
    });
  }
  settleAll();
}

void LearnedDensity::childLogProbabilities(int level, std::span<const uint64_t> cells,
                                           std::span<float> out, Progress*) const {
  const size_t l = static_cast<size_t>(level);
  const std::vector<uint64_t>& active = levels_[l].cells;
  parallelFor(cells.size(), kGrain, [&](size_t begin, size_t end) {
    RowCursor cursor(active);
    for (size_t i = begin; i < end; ++i) {
      const size_t row = cursor.find(cells[i]);
      if (row < active.size()) {
        std::copy_n(&log_probabilities_[l][row * 8], 8, &out[i * 8]);
      } else {
        std::fill_n(&out[i * 8], 8, kEvenLog);
      }
    }
  });
}

size_t LearnedDensity::activeCellCount() const {
  size_t count = 0;
  for (const LearnedLevel& level : levels_) count += level.cells.size();
  return count;
}

void LearnedDensity::setLogits(int level, std::span<const uint32_t> rows,
                               std::span<const float> values) {
  LearnedLevel& cells = levels_[static_cast<size_t>(level)];
  parallelFor(rows.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t k = 0; k < 8; ++k) {
        cells.logits[rows[i] * size_t{8} + k] =
            std::clamp(values[i * 8 + k], -kLargestLogit, kLargestLogit);
      }
      refresh(level, rows[i]);
      if (level < settled_level_) settle(level, rows[i]);
    }
  });
}

/// With q_k = (1 - eps) s_k + eps / 8 and G_k the derivative by log q_k:
/// r_k = G_k (1 - eps) s_k / q_k, by logit_i: r_i - s_i sum r.
std::array<double, 8> LearnedDensity::logitGradient(int level, size_t row,
                                                    const Eight& log_gradient) const {
  const Eight shares = softmax(&levels_[static_cast<size_t>(level)].logits[row * 8]);
  const Eight q = mixed(shares);
  Eight r;
  double sum = 0;
  for (size_t k = 0; k < 8; ++k) {
    r[k] = log_gradient[k] * (1 - kUniformShare) * shares[k] / q[k];
    sum += r[k];
  }
  for (size_t k = 0; k < 8; ++k) r[k] -= shares[k] * sum;
  return r;
}

double LearnedDensity::structuralLoss(double weight, DensityGradient* gradient) const {
  double loss = 0;
  if (gradient != nullptr) gradient->levels.assign(levels_.size(), {});
  for (size_t l = 0; l < levels_.size(); ++l) {
    const LearnedLevel& level = levels_[l];
    for (size_t row = 0; row < level.cells.size(); ++row) {
      double mass = 0;
      for (size_t k = 0; k < 8; ++k) mass += static_cast<double>(level.prior[row * 8 + k]);
      if (mass <= 0) continue;
      for (size_t k = 0; k < 8; ++k) {
        const double p = static_cast<double>(level.prior[row * 8 + k]);
        if (p <= 0) continue;
        loss += p * (std::log(p / mass) - static_cast<double>(log_probabilities_[l][row * 8 + k]));
      }
      if (gradient == nullptr) continue;
      gradient->levels[l].rows.push_back(static_cast<uint32_t>(row));
      gradient->levels[l].values.resize(gradient->levels[l].values.size() + 8, 0.0);
    }
  }
  if (gradient != nullptr) addStructuralGradient(weight, *gradient);
  return loss;
}

void LearnedDensity::addStructuralGradient(double weight, DensityGradient& gradient) const {
  for (size_t l = 0; l < levels_.size(); ++l) {
    DensityGradient::Level& out = gradient.levels[l];
    parallelFor(out.rows.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        Eight by_log;
        for (size_t k = 0; k < 8; ++k) {
          by_log[k] = -weight * static_cast<double>(levels_[l].prior[out.rows[i] * size_t{8} + k]);
        }
        const Eight by_logit = logitGradient(static_cast<int>(l), out.rows[i], by_log);
        for (size_t k = 0; k < 8; ++k) out.values[i * 8 + k] += by_logit[k];
      }
    });
  }
}

DensityGradient LearnedDensity::logDensityGradient(const AnchorSet& anchors,
                                                   std::span<const double> g,
                                                   const ScoreOptions& options) const {
  const size_t least = std::max<size_t>(options.least_anchors, options.against_others ? 2 : 1);
  DensityGradient gradient;
  gradient.levels.resize(levels_.size());
  // Levels apart: each walks the anchors, which are in Morton order, as runs of equal cells.
  parallelFor(levels_.size(), 1, [&](size_t begin, size_t end) {
    for (size_t l = begin; l < end; ++l) {
      const int below = 3 * (static_cast<int>(levels_.size() - l) - 1);
      RowCursor cursor(levels_[l].cells);
      DensityGradient::Level& out = gradient.levels[l];
      for (size_t i = 0; i < anchors.size();) {
        const uint64_t cell = anchors.leaves[i] >> (below + 3);
        Eight sums{}, counts{};
        const size_t first = i;
        for (; i < anchors.size() && anchors.leaves[i] >> (below + 3) == cell; ++i) {
          sums[(anchors.leaves[i] >> below) & 7] += g[i];
          counts[(anchors.leaves[i] >> below) & 7] += 1;
        }
        if (i - first < least) continue;
        if (options.against_others) subtractMeanOfOthers(counts, sums);
        const size_t row = cursor.find(cell);
        if (row == levels_[l].cells.size()) continue;
        const Eight by_logit = logitGradient(static_cast<int>(l), row, sums);
        out.rows.push_back(static_cast<uint32_t>(row));
        out.values.insert(out.values.end(), by_logit.begin(), by_logit.end());
      }
    }
  });
  return gradient;
}

double LearnedDensity::entropy() const {
  // Bottom up: the entropy below a cell, given the cell.
  std::vector<double> below;
  for (size_t l = levels_.size(); l-- > 0;) {
    const double even_below = static_cast<double>(levels_.size() - l - 1) * std::log(8.0);
    std::vector<double> here(levels_[l].cells.size());
    for (size_t row = 0; row < here.size(); ++row) {
      for (size_t k = 0; k < 8; ++k) {
        const double log_p = static_cast<double>(log_probabilities_[l][row * 8 + k]);
        double child = even_below;
        if (l + 1 < levels_.size()) {
          const size_t child_row = rowOf(levels_[l + 1].cells, levels_[l].cells[row] << 3 | k);
          if (child_row < below.size()) child = below[child_row];
        }
        here[row] += std::exp(log_p) * (child - log_p);
      }
    }
    below = std::move(here);
  }
  return below[0];
}

void LearnedDensity::countDraws(const AnchorSet& anchors, DrawCounts& draws) const {
  for (size_t l = 1; l < levels_.size(); ++l) {
    const int below = 3 * static_cast<int>(levels_.size() - l);
    RowCursor cursor(levels_[l].cells);
    RowCursor parents(levels_[l - 1].cells);
    for (size_t i = 0; i < anchors.size();) {
      const uint64_t cell = anchors.leaves[i] >> below;
      const size_t first = i;
      while (i < anchors.size() && anchors.leaves[i] >> below == cell) ++i;
      if (cursor.find(cell) < levels_[l].cells.size()) continue;
      if (parents.find(cell >> 3) == levels_[l - 1].cells.size()) continue;
      draws[{static_cast<int>(l), cell}] += i - first;
    }
  }
}

std::vector<std::vector<uint32_t>> LearnedDensity::activate(const DrawCounts& draws,
                                                            uint64_t least_draws) {
  std::vector<std::vector<uint32_t>> inserted(levels_.size());
  bool has_new = false;
  for (size_t l = 1; l < levels_.size(); ++l) {
    LearnedLevel& level = levels_[l];
    std::vector<uint64_t> fresh;
    for (auto at = draws.lower_bound({static_cast<int>(l), 0});
         at != draws.end() && at->first.first == static_cast<int>(l); ++at) {
      const uint64_t cell = at->first.second;
      if (at->second >= least_draws && rowOf(level.cells, cell) == level.cells.size()) {
        fresh.push_back(cell);
      }
    }
    if (fresh.empty()) continue;
    std::vector<uint64_t> cells(level.cells.size() + fresh.size());
    std::merge(level.cells.begin(), level.cells.end(), fresh.begin(), fresh.end(), cells.begin());
    for (const uint64_t cell : fresh) {
      inserted[l].push_back(static_cast<uint32_t>(rowOf(cells, cell)));
    }
    level.cells = std::move(cells);
    insertZeroRows(level.logits, 8, inserted[l]);
    insertZeroRows(level.prior, 8, inserted[l]);
    insertZeroRows(log_probabilities_[l], 8, inserted[l]);
    for (const uint32_t row : inserted[l]) refresh(static_cast<int>(l), row);
    has_new = true;
  }
  if (has_new) settleAll();
  while (activeShareBelow() >= kSettledShare) {
    ++settled_level_;
    settleAll();
  }
  return inserted;
}

/// Share of what is kept whose children at the settled level are active cells.
double LearnedDensity::activeShareBelow() const {
  const auto depth = static_cast<size_t>(settled_level_);
  if (depth == levels_.size() || levels_[depth].cells.empty()) return 0;
  std::vector<double> shares{1.0};
  double total = 0;
  for (size_t l = 0; l < depth; ++l) {
    const std::vector<uint64_t>& children = levels_[l + 1].cells;
    std::vector<double> below(children.size());
    RowCursor parents(levels_[l].cells);
    total = 0;
    for (size_t i = 0; i < children.size(); ++i) {
      const size_t row = parents.find(children[i] >> 3);
      below[i] =
          shares[row] * std::exp(static_cast<double>(settled_[l][row * 8 + (children[i] & 7)]));
      total += below[i];
    }
    shares = std::move(below);
  }
  return total;
}

/// Which children lead down to active cells right above the settled level, whose children are
/// leaves. A matter of which cells are active, not of logits: it changes with activate() alone.
void LearnedDensity::findLiving() {
  auto depth = static_cast<size_t>(settled_level_);
  if (depth == 0) {
    depth = levels_.size();
    while (levels_[depth - 1].cells.empty()) --depth;
    settled_level_ = static_cast<int>(depth);
  }
  living_.assign(levels_.size(), {});
  living_[depth - 1].assign(levels_[depth - 1].cells.size(), 0xff);
  for (size_t l = depth - 1; l-- > 0;) {
    const std::vector<uint64_t>& children = levels_[l + 1].cells;
    living_[l].assign(levels_[l].cells.size(), 0);
    RowCursor parents(levels_[l].cells);
    for (size_t i = 0; i < children.size(); ++i) {
      if (living_[l + 1][i] == 0) continue;
      living_[l][parents.find(children[i] >> 3)] |= static_cast<uint8_t>(1u << (children[i] & 7));
    }
  }
}

void LearnedDensity::settle(int level, size_t row) {
  const size_t l = static_cast<size_t>(level);
  const uint8_t living = living_[l][row];
  const Eight shares = softmax(&levels_[l].logits[row * 8]);
  Eight kept{};
  // Where only what is too small leads anywhere, it is kept.
  for (const double least : {kUniformShare, 0.0}) {
    for (size_t k = 0; k < 8; ++k) {
      if ((living >> k & 1) != 0 && shares[k] >= least) kept[k] = shares[k];
    }
    if (std::accumulate(kept.begin(), kept.end(), 0.0) > 0) break;
  }
  const double sum = std::accumulate(kept.begin(), kept.end(), 0.0);
  for (size_t k = 0; k < 8; ++k) {
    settled_[l][row * 8 + k] = kept[k] > 0 ? static_cast<float>(std::log(kept[k] / sum)) : kNothing;
  }
}

void LearnedDensity::settleAll() {
  findLiving();
  settled_.resize(levels_.size());
  for (size_t l = 0; l < static_cast<size_t>(settled_level_); ++l) {
    settled_[l].resize(levels_[l].logits.size());
    parallelFor(levels_[l].cells.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t row = begin; row < end; ++row) settle(static_cast<int>(l), row);
    });
  }
}

void LearnedDensity::settledLogProbabilities(int level, std::span<const uint64_t> cells,
                                             std::span<float> out) const {
  const size_t l = static_cast<size_t>(level);
  parallelFor(cells.size(), kGrain, [&](size_t begin, size_t end) {
    RowCursor cursor(levels_[l].cells);
    for (size_t i = begin; i < end; ++i) {
      const size_t row = cursor.find(cells[i]);
      if (row < levels_[l].cells.size()) {
        std::copy_n(&settled_[l][row * 8], 8, &out[i * 8]);
      } else {
        std::fill_n(&out[i * 8], 8, kNothing);
      }
    }
  });
}

OctreeDensity LearnedDensity::frozen() const {
  const auto depth = static_cast<size_t>(settled_level_);
  std::vector<std::vector<uint64_t>> cells(depth);
  std::vector<std::vector<float>> logs(depth);
  cells[0] = levels_[0].cells;
  logs[0] = settled_[0];
  // Top down: cells whose parent gave them up go.
  for (size_t l = 1; l < depth; ++l) {
    RowCursor parents(cells[l - 1]);
    for (size_t row = 0; row < levels_[l].cells.size(); ++row) {
      const uint64_t cell = levels_[l].cells[row];
      const size_t parent = parents.find(cell >> 3);
      if (parent == cells[l - 1].size()) continue;
      if (logs[l - 1][parent * 8 + (cell & 7)] == kNothing) continue;
      cells[l].push_back(cell);
      logs[l].insert(logs[l].end(), &settled_[l][row * 8], &settled_[l][row * 8] + 8);
    }
  }
  return OctreeDensity::fromLevels(root_, std::move(cells), std::move(logs));
}

void insertZeroRows(std::vector<float>& values, size_t row_length, std::span<const uint32_t> rows) {
  std::vector<float> out(values.size() + rows.size() * row_length, 0.0f);
  size_t next = 0;
  for (size_t row = 0, from = 0; row < out.size() / row_length; ++row) {
    if (next < rows.size() && rows[next] == row) {
      ++next;
      continue;
    }
    std::copy_n(&values[from], row_length, &out[row * row_length]);
    from += row_length;
  }
  values = std::move(out);
}

}  // namespace stipple
