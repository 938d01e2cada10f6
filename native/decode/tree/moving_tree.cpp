#include "decode/tree/moving_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/cloud_extent.h"
#include "decode/tree/merge_leaves.h"
#include "decode/tree/merge_rounds.h"
#include "decode/tree/moving_cost.h"

// Based on: the tree of merge_tree.cpp. Differs: a node has a path, a turn and a life, by the
// numbers of one moving splat (docs/methods/moving_budget.md derives how they are made), and its
// errors are means over the times of a clip.

namespace stipple {

namespace {

constexpr size_t kGrain = 512;
/// Parts of the clip at which neighbours are asked to be near, and times in each.
constexpr size_t kPlaceParts = 4;
/// How far apart lives are whose middles differ by the whole clip: in spacings between nodes where
/// they cover a surface, and at most in units of the tree.
constexpr double kLifeSpacings = 8;
constexpr double kLargestLifeDistance = 2;

void validateInput(const MotionCloud& leaves, std::span<const float> visibility,
                   const MovingTreeOptions& options) {
  validate(leaves, "moving splats");
  requireLeafCount(leaves.size(), "the moving cloud");
  requireVisibility(visibility, leaves.size());
  requireFootprint(options.footprint);
  if (options.times < 1 || options.times > kMostMergeTimes) {
    fail(ErrorCode::kInvalidArgument, "times is " + std::to_string(options.times) + "; 1 to " +
                                          std::to_string(kMostMergeTimes) + " is allowed");
  }
}

/// Where splats are at their own moments, when all of them are seen.
SplatCloud ownMoments(const MotionCloud& leaves) {
  SplatCloud seen;
  seen.resize(leaves.size());
  seen.scales = leaves.splats.scales;
  const MergeScale metres;
  parallelFor(leaves.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const MotionPath path = pathOf(leaves, i, metres);
      for (size_t axis = 0; axis < 3; ++axis) {
        double place = path[0][axis];
        for (size_t k = 1; k <= kMotionHarmonics; ++k) place += path[2 * k - 1][axis];
        seen.positions[3 * i + axis] = static_cast<float>(place);
      }
    }
  });
  return seen;
}

MotionCloud emptyMotion(const MotionCloud& moving, size_t count) {
  MotionCloud out;
  out.splats = emptyLike(moving.splats, count);
  out.clip = moving.clip;
  for (auto& wave : out.waves) wave.resize(3 * count);
  out.phases.resize(4 * count);
  out.spins.resize(4 * count);
  out.lifespans.resize(2 * count);
  out.centres.resize(count);
  return out;
}

void gatherMotion(MotionCloud& moving, const std::vector<uint32_t>& from) {
  gatherRows(moving.splats, from);
  for (auto& wave : moving.waves) gatherRows(wave, 3, from);
  gatherRows(moving.phases, 4, from);
  gatherRows(moving.spins, 4, from);
  gatherRows(moving.lifespans, 2, from);
  gatherRows(moving.centres, 1, from);
}

/// Splats that move.
class MovingNodes final : public MergingNodes {
 public:
  MovingNodes(const MotionCloud& leaves, const std::vector<uint32_t>& order,
              std::span<const float> visibility, const MovingScale& scale, MotionCloud& merged)
      : scale_(scale),
        nodes_(leaves.size()),
        paths_(leaves.size()),
        samples_(leaves.size() * rowLength()),
        merged_(merged),
        harmonics_(leaves.splats, order, merged.splats) {
    parallelFor(nodes_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const double seen = visibility.empty() ? 1.0 : countedVisibility(visibility[order[i]]);
        paths_[i] = pathOf(leaves, order[i], scale_.space);
        nodes_[i] =
            movingLeaf(leaves, order[i], seen, paths_[i], scale_, &samples_[i * rowLength()]);
      }
    });
  }

  size_t size() const override { return nodes_.size(); }

  /// Places in the parts of the clip, and the middle of the life.
  size_t placeWidth() const override { return placeWidthOf(scale_.times); }
  static size_t placeWidthOf(size_t times) {
    return times == 1 ? 3 : 3 * std::min(times, kPlaceParts) + 1;
  }

  void places(std::span<const uint32_t> slots, double* places) const override {
    const size_t width = placeWidth();
    const double spacing = 1 / std::sqrt(static_cast<double>(slots.size()));
    const double life = std::min(kLifeSpacings * spacing, kLargestLifeDistance);
    parallelFor(slots.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) fillPlace(slots[i], life, places + i * width);
    });
  }

  void lookAround(uint32_t slot, std::span<const uint32_t> others) override {
    Surrounding surrounding;
    surrounding.add(asSurrounding(slot));
    for (const uint32_t other : others) surrounding.add(asSurrounding(other));
    nodes_[slot].around = surrounding.mean();
  }

  void costs(uint32_t slot, const uint32_t* others, size_t count, float* costs) const override {
    kernel_.costs(rows(), slot, others, count, costs);
  }

  float merge(uint32_t first, uint32_t second, const MergeIds& ids) override {
    const MovingNode& a = nodes_[first];
    const MovingNode& b = nodes_[second];
    const double centre = mergedCentre(a, b);
    const double weight = a.weight + b.weight;
    const double share = weight > 0 ? a.weight / weight : 0.5;
    const MotionPath path_a = pathAbout(paths_[first], a.centre, centre, scale_.window);
    const MotionPath path_b = pathAbout(paths_[second], b.centre, centre, scale_.window);
    MotionPath path;
    for (size_t row = 0; row < kPathRows; ++row) {
      for (size_t axis = 0; axis < 3; ++axis) {
        path[row][axis] = share * path_a[row][axis] + (1 - share) * path_b[row][axis];
      }
    }
    std::array<double, 3 * kMostMergeTimes> means;
    const bool bends = a.centre != b.centre;
    if (bends) samplePath(path, centre, scale_, means.data());
    MovingMerge merged;
    kernel_.merge(rows(), first, second, bends ? means.data() : nullptr, merged);
    writeMovingNode(merged.node, path, scale_, merged_, ids.merged - nodes_.size());
    harmonics_.mix(ids, share);
    nodes_[first] = merged.node;
    paths_[first] = path;
    std::copy_n(merged.samples.begin(), rowLength(), samplesOf(first));
    constexpr double kLargest = std::numeric_limits<float>::max();
    return static_cast<float>(std::min(merged.error, kLargest));
  }

  void fetchAhead(uint32_t slot) const override {
    const char* bytes = reinterpret_cast<const char*>(rows().samplesOf(slot));
    for (size_t line = 0; line < rowLength() * sizeof(float); line += 64) {
      __builtin_prefetch(bytes + line);
    }
  }

 private:
  size_t rowLength() const { return MovingField::kCount * scale_.stride; }
  float* samplesOf(uint32_t slot) { return samples_.data() + slot * rowLength(); }
  MovingNodeRows rows() const { return {nodes_.data(), samples_.data(), &scale_}; }

  /// What neighbours see of a node over the clip.
  MergeNode asSurrounding(uint32_t slot) const {
    MergeNode seen;
    seen.colour = nodes_[slot].colour;
    const float* samples = rows().samplesOf(slot);
    double opacities = 0, covered = 0;
    for (size_t i = 0; i < scale_.times; ++i) {
      const auto opacity = static_cast<double>(samples[MovingField::kOpacity * scale_.stride + i]);
      const auto area = static_cast<double>(samples[MovingField::kArea * scale_.stride + i]);
      covered += opacity * area;
      opacities += opacity * opacity * area;
    }
    if (!(covered > 0)) return seen;
    seen.opacity = opacities / covered;
    seen.area = covered / seen.opacity / static_cast<double>(scale_.times);
    return seen;
  }

  void fillPlace(uint32_t slot, double life, double* place) const {
    const float* samples = rows().samplesOf(slot);
    if (scale_.times == 1) {
      for (size_t axis = 0; axis < 3; ++axis) {
        place[axis] = static_cast<double>(samples[axis * scale_.stride]);
      }
      return;
    }
    const size_t parts = std::min(scale_.times, kPlaceParts);
    for (size_t part = 0; part < parts; ++part) {
      const size_t begin = part * scale_.times / parts, end = (part + 1) * scale_.times / parts;
      // Parts count together as much as one place would.
      const double share = 1 / (static_cast<double>(end - begin) * std::sqrt(parts));
      for (size_t axis = 0; axis < 3; ++axis) {
        double sum = 0;
        for (size_t i = begin; i < end; ++i) {
          sum += static_cast<double>(samples[axis * scale_.stride + i]);
        }
        place[3 * part + axis] = share * sum;
      }
    }
    double seen = 0, middle = 0;
    for (size_t i = 0; i < scale_.times; ++i) {
      const auto opacity = static_cast<double>(samples[MovingField::kOpacity * scale_.stride + i]);
      seen += opacity;
      middle += opacity * scale_.parts[i];
    }
    place[3 * parts] = life * (seen > 0 ? middle / seen : nodes_[slot].centre);
  }

  MovingScale scale_;
  std::vector<MovingNode> nodes_;  ///< [slots]
  std::vector<MotionPath> paths_;  ///< [slots]
  std::vector<float> samples_;     ///< [slots, MovingField::kCount, stride]
  MotionCloud& merged_;
  HarmonicRows harmonics_;
  MovingMergeKernel kernel_ = chosenMovingMergeKernel();
};

}  // namespace

MovingTree buildMovingTree(const MotionCloud& leaves, std::span<const float> visibility,
                           const MovingTreeOptions& options, Progress* progress) {
  validateInput(leaves, visibility, options);
  MovingScale scale;
  std::vector<uint32_t> order;
  {
    const SplatCloud seen = ownMoments(leaves);
    const CloudExtent extent = cloudExtent(seen);
    order = spatialOrder(seen.positions, extent);
    scale = movingScale(mergeScale(extent, options.footprint), leaves.clip, options.times);
  }
  MovingTree tree;
  tree.nodes = emptyMotion(leaves, leaves.size() - 1);
  std::vector<Merge> merges;
  {
    MovingNodes nodes(leaves, order, visibility, scale, tree.nodes);
    merges = mergeInRounds(nodes, progress);
  }
  gatherMotion(tree.nodes, numberNodes(merges, order, tree));
  return tree;
}

uint64_t movingTreeMemoryBound(uint64_t leaf_count, int sh_degree) {
  constexpr uint64_t kNode = sizeof(MovingNode) + sizeof(MotionPath) +
                             MovingField::kCount * kMostMergeTimes * sizeof(float);
  // Inner nodes and a copy of one column while they are numbered; where splats are at their moments
  // and the order of that.
  constexpr uint64_t kMotion = 3 * kMotionWaves + 4 + 4 + 2 + 1;
  const uint64_t colours = 3 * shCoefficientCount(sh_degree);
  const uint64_t row = sizeof(float) * (11 + kMotion + 2 * colours);
  return leaf_count * (row + kNode + mergeBytesPerNode(MovingNodes::placeWidthOf(kMergeTimes)) +
                       sizeof(float) * 14 + 64) +
         (uint64_t{1} << 20);
}

void validateTree(const MovingTree& tree, const MotionCloud& leaves, const char* what) {
  validateShape(tree, leaves.size(), what);
  requireNodesLike(tree.nodes.splats, leaves.splats, what);
}

}  // namespace stipple
