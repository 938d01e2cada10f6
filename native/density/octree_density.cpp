#include "density/octree_density.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "density/octree_leaves.h"
#include "density/sampling_tables.h"

namespace stipple {
namespace {

constexpr size_t kGrain = 4096;
constexpr float kNothing = -std::numeric_limits<float>::infinity();
// exp stays a normal double; float32 log-probabilities of sums of float32 weights stay above -250.
constexpr float kLowestLog = -700.0f;
// Sums of eight exponentials of float32 logarithms are within 1e-6 of one; more is a broken file.
constexpr double kSumTolerance = 1e-4;

void requireLeafLevel(size_t level) {
  if (level < 1 || level > static_cast<size_t>(kMaxLeafLevel)) {
    fail(ErrorCode::kInvalidArgument, "the octree's leaf level is " + std::to_string(level) +
                                          "; allowed is 1 to " + std::to_string(kMaxLeafLevel));
  }
}

std::string nameCell(uint64_t cell, size_t level) {
  return "cell " + std::to_string(cell) + " at level " + std::to_string(level);
}

/// Refuses log-probabilities of a cell that are not a distribution.
void requireDistribution(const float* log_probabilities, uint64_t cell, size_t level) {
  double sum = 0.0;
  for (size_t k = 0; k < 8; ++k) {
    const float value = log_probabilities[k];
    if (value == kNothing) continue;
    if (!std::isfinite(value) || value < kLowestLog || value > static_cast<float>(kSumTolerance)) {
      fail(ErrorCode::kInvalidArgument,
           "the log-probability of child " + std::to_string(k) + " of " + nameCell(cell, level) +
               " is " + std::to_string(value) + "; allowed is -inf or -700 to 0.0001");
    }
    sum += std::exp(static_cast<double>(value));
  }
  if (std::abs(sum - 1.0) > kSumTolerance) {
    fail(ErrorCode::kInvalidArgument, "the child probabilities of " + nameCell(cell, level) +
                                          " sum to " + std::to_string(sum) +
                                          "; allowed is 1 within 0.0001");
  }
}

/// Refuses a level whose cells are not the children with mass of the level above, in order.
void requireChildrenOf(const std::vector<uint64_t>& parents, const std::vector<float>& logs,
                       const std::vector<uint64_t>& cells, size_t level) {
  size_t next = 0;
  for (size_t i = 0; i < parents.size(); ++i) {
    for (size_t k = 0; k < 8; ++k) {
      if (logs[8 * i + k] == kNothing) continue;
      const uint64_t expected = parents[i] << 3 | k;
      if (next >= cells.size() || cells[next] != expected) {
        fail(ErrorCode::kInvalidArgument,
             "octree " + nameCell(expected, level) + " has mass but the stored list has " +
                 (next < cells.size() ? std::to_string(cells[next]) : std::string("nothing")) +
                 " in its place; allowed are exactly the cells with mass, in ascending order");
      }
      ++next;
    }
  }
  if (next != cells.size()) {
    fail(ErrorCode::kInvalidArgument,
         "octree level " + std::to_string(level) + " lists " + std::to_string(cells.size()) +
             " cells; allowed are the " + std::to_string(next) + " cells with mass");
  }
}

}  // namespace

OctreeDensity OctreeDensity::fromPoints(std::span<const float> positions,
                                        std::span<const float> weights,
                                        const OctreeDensityOptions& options) {
  requireLeafLevel(options.leaf_level < 0 ? 0 : static_cast<size_t>(options.leaf_level));
  OctreeDensity density;
  density.root_ = boundingCube(positions, weights);
  OctreeLeaves children = gatherLeaves(positions, weights, density.root_, options.leaf_level);
  const size_t level_count = static_cast<size_t>(options.leaf_level);
  density.cells_.resize(level_count);
  density.log_probabilities_.resize(level_count);
  for (size_t level = level_count; level-- > 0;) {
    OctreeLeaves parents;
    std::vector<size_t> first_child;
    for (size_t i = 0; i < children.codes.size(); ++i) {
      const uint64_t parent = children.codes[i] >> 3;
      if (parents.codes.empty() || parents.codes.back() != parent) {
        parents.codes.push_back(parent);
        parents.masses.push_back(0.0);
        first_child.push_back(i);
      }
      parents.masses.back() += children.masses[i];
    }
    first_child.push_back(children.codes.size());
    std::vector<float>& logs = density.log_probabilities_[level];
    logs.assign(8 * parents.codes.size(), kNothing);
    parallelFor(parents.codes.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        for (size_t child = first_child[i]; child < first_child[i + 1]; ++child) {
          logs[8 * i + (children.codes[child] & 7)] =
              static_cast<float>(std::log(children.masses[child] / parents.masses[i]));
        }
      }
    });
    density.cells_[level] = parents.codes;
    children = std::move(parents);
  }
  return std::move(density).finished();
}

OctreeDensity OctreeDensity::fromLevels(const RootCube& root,
                                        std::vector<std::vector<uint64_t>> cells,
                                        std::vector<std::vector<float>> log_probabilities) {
  for (const double value : root.origin) requireFinite(value, "the octree's root origin");
  requireFinite(root.side, "the octree's root side");
  if (root.side <= 0.0) {
    fail(ErrorCode::kInvalidArgument, "the octree's root side is " + std::to_string(root.side) +
                                          "; allowed are positive lengths in metres");
  }
  requireLeafLevel(cells.size());
  if (log_probabilities.size() != cells.size()) {
    fail(ErrorCode::kInvalidArgument, "the octree has log-probabilities for " +
                                          std::to_string(log_probabilities.size()) +
                                          " levels; allowed is " + std::to_string(cells.size()) +
                                          ", one for each level of cells");
  }
  if (cells[0] != std::vector<uint64_t>{0}) {
    fail(ErrorCode::kInvalidArgument, "octree level 0 lists " + std::to_string(cells[0].size()) +
                                          " cells; allowed is the root alone, cell 0");
  }
  for (size_t level = 0; level < cells.size(); ++level) {
    const std::vector<float>& logs = log_probabilities[level];
    if (logs.size() % 8 != 0 || logs.size() / 8 != cells[level].size()) {
      fail(ErrorCode::kInvalidArgument, "octree level " + std::to_string(level) + " has " +
                                            std::to_string(logs.size()) +
                                            " log-probabilities; allowed is 8 for each of its " +
                                            std::to_string(cells[level].size()) + " cells");
    }
    parallelFor(cells[level].size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        requireDistribution(&logs[8 * i], cells[level][i], level);
    });
    if (level > 0) {
      requireChildrenOf(cells[level - 1], log_probabilities[level - 1], cells[level], level);
    }
  }
  OctreeDensity density;
  density.root_ = root;
  density.cells_ = std::move(cells);
  density.log_probabilities_ = std::move(log_probabilities);
  return std::move(density).finished();
}

OctreeDensity OctreeDensity::finished() && {
  leaf_level_ = static_cast<int>(cells_.size());
  auto tables = std::make_shared<SamplingTables>(makeSamplingTables(cells_, log_probabilities_));
  leaf_count_ = tables->leaves.size();
  tables_ = std::move(tables);
  return std::move(*this);
}

std::optional<OctreeTables> OctreeDensity::tables() const {
  if (!tables_) return std::nullopt;
  return OctreeTables{cells_, *tables_};
}

void OctreeDensity::childLogProbabilities(int level, std::span<const uint64_t> cells,
                                          std::span<float> out, Progress*) const {
  if (level < 0 || level >= leaf_level_) {
    fail(ErrorCode::kInvalidArgument, "the octree was asked for children of level " +
                                          std::to_string(level) + "; allowed is 0 to " +
                                          std::to_string(leaf_level_ - 1));
  }
  if (out.size() / 8 != cells.size() || out.size() % 8 != 0) {
    fail(ErrorCode::kInvalidArgument, "the octree got room for " + std::to_string(out.size()) +
                                          " log-probabilities; allowed is 8 for each of " +
                                          std::to_string(cells.size()) + " cells");
  }
  const std::vector<uint64_t>& stored = cells_[static_cast<size_t>(level)];
  const std::vector<float>& logs = log_probabilities_[static_cast<size_t>(level)];
  parallelFor(cells.size(), kGrain, [&](size_t begin, size_t end) {
    auto at = std::lower_bound(stored.begin(), stored.end(), cells[begin]);
    for (size_t i = begin; i < end; ++i) {
      // The questions ascend: the answer is near the one before, most often right behind it.
      if (at == stored.end() || *at > cells[i]) at = stored.begin();
      if (*at < cells[i]) {
        auto step = std::ptrdiff_t{1};
        while (step < stored.end() - at && at[step] < cells[i]) step *= 2;
        at = std::lower_bound(at + step / 2, at + std::min(step + 1, stored.end() - at), cells[i]);
      }
      float* answer = &out[8 * i];
      if (at != stored.end() && *at == cells[i]) {
        std::copy_n(logs.begin() + 8 * (at - stored.begin()), 8, answer);
      } else {
        std::fill_n(answer, 8, kNothing);
      }
    }
  });
}

}  // namespace stipple
