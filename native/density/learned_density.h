#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "density/anchor_sampling.h"
#include "density/density_model.h"
#include "density/octree_density.h"

namespace stipple {

/// Share of a uniform choice in every choice: density can move to where there is none yet.
constexpr double kUniformShare = 1e-3;
/// Pseudo-count of each child in the shares of prior points: where few points fall, some of the
/// density goes to the neighbours that were missed.
constexpr double kPriorPseudoCount = 0.05;

/// The active cells of one level, in Morton order.
struct LearnedLevel {
  std::vector<uint64_t> cells;
  std::vector<float> logits;  ///< [cells, 8]
  std::vector<float> prior;  ///< [cells, 8] share of all prior points, smoothed; sums to the cell's
};

/// Derivatives by the logits of some cells.
struct DensityGradient {
  struct Level {
    std::vector<uint32_t> rows;  ///< into LearnedLevel::cells, ascending
    std::vector<double> values;  ///< [rows, 8]
  };
  std::vector<Level> levels;
};

/// How a gradient is estimated from the anchors of a draw.
struct ScoreOptions {
  /// In each cell the mean of the other anchors of the cell is taken from an anchor's g. Over
  /// independent draws the mean of the gradient stays what it is; what falls away is how many
  /// anchors chance has put into a child. A cell with one anchor tells nothing then.
  bool against_others = false;
  /// Cells with fewer anchors get no gradient.
  size_t least_anchors = 1;
};

/// Density over an octree whose choices are learned. An active cell stores eight logits:
/// q(k | cell) = (1 - eps) softmax(logits)_k + eps / 8; below an inactive cell the choices are
/// even.
class LearnedDensity final : public DensityModel {
 public:
  /// All even: every cell above `active_levels` is active.
  LearnedDensity(const RootCube& root, int leaf_level, int active_levels = 1);

  /// The density that fits the points best: active are the cells with points, and every choice is
  /// the share of the points in each child, with kPriorPseudoCount. Points outside the root count
  /// for nothing. In: positions [N,3] metres; weights [N] >= 0 or empty; known_level >= 1: the
  /// points tell of nothing smaller than cells of this level, below which choices are even.
  /// Errors: kInvalidArgument for a value that is negative or not finite; no point inside the root
  /// with positive weight gives the even density.
  static LearnedDensity fromPoints(std::span<const float> positions, std::span<const float> weights,
                                   const RootCube& root, int leaf_level,
                                   int known_level = kMaxLeafLevel);

  /// From stored levels. In: settled_level, as settledLevel() was; 0: the deepest with active cells.
  /// Errors: kFormat for arrays that do not fit together, cells that are not in order or whose
  /// parent is inactive, numbers that are not finite, a settled level without active cells.
  LearnedDensity(const RootCube& root, std::vector<LearnedLevel> levels, int settled_level = 0);

  int leafLevel() const override { return static_cast<int>(levels_.size()); }
  void childLogProbabilities(int level, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* progress = nullptr) const override;

  const RootCube& root() const override { return root_; }
  const std::vector<LearnedLevel>& levels() const { return levels_; }
  size_t activeCellCount() const;

  /// New logits of some cells; values [rows, 8].
  void setLogits(int level, std::span<const uint32_t> rows, std::span<const float> values);

  /// Structural loss: divergence of the density from the prior points, sum over cells and children
  /// of p log(p / q), nats; q conditional, p the share of all points. Not null: `gradient` gets its
  /// derivatives times `weight` for every cell with points. Cost: O(active cells).
  double structuralLoss(double weight, DensityGradient* gradient) const;
  /// The same derivatives added for the cells that `gradient` has already. Cost: O(those cells).
  void addStructuralGradient(double weight, DensityGradient& gradient) const;

  /// Derivatives of sum_j g_j log q(x_j) for anchors of this density, through the even share.
  /// In: g [anchors]. Cost: O(anchors * levels). Source: DeG (arXiv 2605.16355), score-function
  /// gradient of the density; log-softmax of each level on the path of an anchor.
  DensityGradient logDensityGradient(const AnchorSet& anchors, std::span<const double> g,
                                     const ScoreOptions& options = {}) const;

  /// -sum q log q over the leaves, nats. Cost: O(active cells).
  double entropy() const;

  /// The inactive cells right below active ones that the anchors fall into, added to `draws` by
  /// (level, cell).
  using DrawCounts = std::map<std::pair<int, uint64_t>, uint64_t>;
  void countDraws(const AnchorSet& anchors, DrawCounts& draws) const;
  /// Makes those with at least `least_draws` active, with even choices: the density stays what it
  /// is. Returns per level the rows where the new cells stand now, ascending.
  std::vector<std::vector<uint32_t>> activate(const DrawCounts& draws, uint64_t least_draws);

  /// As an octree with what sampling needs, for decoding: without the even share, without choices
  /// below kUniformShare, and without cells that nothing was learned below. Its leaf level is
  /// settledLevel(): that of the deepest active cells at the start, and one more as often as
  /// activate() finds nearly all of what is kept in active cells there. A few active cells below the
  /// others do not change what is kept.
  OctreeDensity frozen() const;

  /// What frozen() keeps of the choices in some of its cells, up to date after every change: log
  /// probabilities, minus infinity for what it leaves out. Its leaf level is settledLevel().
  int settledLevel() const { return settled_level_; }
  void settledLogProbabilities(int level, std::span<const uint64_t> cells,
                               std::span<float> out) const;

 private:
  void refresh(int level, size_t row);
  void refreshAll();
  void findLiving();
  double activeShareBelow() const;
  void settle(int level, size_t row);
  void settleAll();
  std::array<double, 8> logitGradient(int level, size_t row,
                                      const std::array<double, 8>& log_gradient) const;

  RootCube root_;
  std::vector<LearnedLevel> levels_;
  std::vector<std::vector<float>> log_probabilities_;  // [cells, 8] per level, of the mixture
  int settled_level_ = 0;
  std::vector<std::vector<uint8_t>> living_;  // [cells] per level, a bit for each child: it leads
                                              // to leaves of the settled level
  std::vector<std::vector<float>> settled_;   // [cells, 8] per level
};

/// A learned density as decoding will know it, which anchors can be drawn from without freezing it.
class SettledDensity final : public DensityModel {
 public:
  explicit SettledDensity(const LearnedDensity& density) : density_(density) {}
  int leafLevel() const override { return density_.settledLevel(); }
  const RootCube& root() const override { return density_.root(); }
  void childLogProbabilities(int level, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* = nullptr) const override {
    density_.settledLogProbabilities(level, cells, out);
  }

 private:
  const LearnedDensity& density_;
};

/// Inserts rows of zeros: what belongs to the cells of a level follows LearnedDensity::activate.
void insertZeroRows(std::vector<float>& values, size_t row_length, std::span<const uint32_t> rows);

}  // namespace stipple
