#include "density/anchor_sampling.h"

#include <optional>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "density/level_sampling.h"
#include "density/octree_sampling.h"

namespace stipple {
namespace {

AnchorSet makeAnchorSet(const DensityModel& model, const AnchorSamplingOptions& options) {
  if (options.count < 1 || options.count > kMaxAnchorCount) {
    fail(ErrorCode::kInvalidArgument, "the anchor budget is " + std::to_string(options.count) +
                                          "; allowed is 1 to " + std::to_string(kMaxAnchorCount));
  }
  if (options.order != AnchorOrder::kSystematic && options.order != AnchorOrder::kProgressive) {
    fail(ErrorCode::kInvalidArgument, "the anchor order is " +
                                          std::to_string(static_cast<uint32_t>(options.order)) +
                                          "; allowed is 0 (systematic) or 1 (progressive)");
  }
  if (options.with_ranks && options.order != AnchorOrder::kProgressive) {
    fail(ErrorCode::kInvalidArgument,
         "ranks were asked for with the systematic order; allowed is the progressive order, whose "
         "budgets are nested");
  }
  const int leaf_level = model.leafLevel();
  if (leaf_level < 1 || leaf_level > kMaxLeafLevel) {
    fail(ErrorCode::kInvalidArgument, "the density's leaf level is " + std::to_string(leaf_level) +
                                          "; allowed is 1 to " + std::to_string(kMaxLeafLevel));
  }
  AnchorSet anchors;
  anchors.leaf_level = leaf_level;
  anchors.positions.resize(3 * options.count);
  anchors.log_q.resize(options.count);
  anchors.leaves.resize(options.count);
  if (options.with_ranks) anchors.ranks.resize(options.count);
  return anchors;
}

}  // namespace

void anchorPositions(const AnchorSet& anchors, const RootCube& root, float* out) {
  parallelFor(anchors.size(), 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t axis = 0; axis < 3; ++axis) {
        const double unit = anchors.positions[i * 3 + axis];
        out[i * 3 + axis] = static_cast<float>(root.origin[axis] + root.side * unit);
      }
    }
  });
}

uint64_t anchorSetBytes(uint64_t count) {
  // 3 + 1 floats and a leaf code. Large arrays are rounded up to pages of 2 MiB.
  constexpr uint64_t kPage = uint64_t{2} << 20;
  const uint64_t rounding = count * 3 * sizeof(float) < 4 * kPage ? 0 : 3 * kPage;
  return count * (4 * sizeof(float) + sizeof(uint64_t)) + rounding;
}

uint64_t sampleMemoryBound(uint64_t count, bool with_ranks) {
  // Result: 3 + 1 floats and a leaf code. Two frontiers of at most one cell an anchor (code, count,
  // log q), and the places of the leaves.
  constexpr uint64_t kAnchor = 4 * sizeof(float) + sizeof(uint64_t);
  constexpr uint64_t kFrontiers = 2 * (sizeof(uint64_t) + sizeof(uint32_t) + sizeof(double)) + 8;
  constexpr uint64_t kRanks = sizeof(uint64_t) + 2 * sizeof(uint32_t);
  // Questions of the level-by-level sampler, tasks, rounding to huge pages.
  constexpr uint64_t kFixed = uint64_t{24} << 20;
  return count * (kAnchor + kFrontiers + (with_ranks ? kRanks : 0)) + kFixed;
}

AnchorSet sampleAnchors(const DensityModel& model, const AnchorSamplingOptions& options,
                        Progress* progress) {
  AnchorSet anchors = makeAnchorSet(model, options);
  if (const std::optional<OctreeTables> tables = model.tables()) {
    sampleOctree(*tables, options, progress, anchors);
  } else {
    sampleLevelByLevel(model, options, nullptr, progress, anchors);
  }
  advance(progress, 1.0, "Sampling anchors");
  return anchors;
}

AnchorSet sampleAnchors(const DensityModel& model, const AnchorSamplingOptions& options,
                        UniformSource& source) {
  AnchorSet anchors = makeAnchorSet(model, options);
  sampleLevelByLevel(model, options, &source, nullptr, anchors);
  return anchors;
}

}  // namespace stipple
