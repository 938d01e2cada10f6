#include "decode/tree/hierarchy_decoder.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/growth/splat_growth.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;

/// Rows of one attribute, inner nodes first.
void copyRows(const std::vector<float>& inner, const std::vector<float>& leaves, size_t stride,
              size_t inner_count, const std::vector<uint32_t>& ids, std::vector<float>& out) {
  parallelFor(ids.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* row =
          ids[i] < inner_count ? &inner[ids[i] * stride] : &leaves[(ids[i] - inner_count) * stride];
      std::copy_n(row, stride, &out[i * stride]);
    }
  });
}

void requireOneEach(const DecodeRequest& request) {
  if (request.gaussians_per_anchor == 1) return;
  fail(ErrorCode::kInvalidArgument, "gaussians_per_anchor is " +
                                        std::to_string(request.gaussians_per_anchor) +
                                        "; 1 is allowed for splats that exist already");
}

}  // namespace

HierarchyDecoder::HierarchyDecoder(std::shared_ptr<const SplatCloud> leaves,
                                   std::shared_ptr<const MergeTree> tree)
    : leaves_(std::move(leaves)), tree_(std::move(tree)) {
  if (!leaves_ || !tree_) {
    fail(ErrorCode::kInvalidArgument, "hierarchy: the splats or the tree is missing");
  }
  validateTree(*tree_, *leaves_, "hierarchy");
}

std::vector<uint32_t> HierarchyDecoder::cut(uint64_t budget) const {
  return cutOfShape(*tree_, budget);
}

SplatCloud HierarchyDecoder::decode(const DecodeRequest& request) const {
  requireOneEach(request);
  if (request.budget == leaves_->size()) return *leaves_;
  return rowsOf(cut(request.budget));
}

SplatCloud HierarchyDecoder::rowsOf(const std::vector<uint32_t>& ids) const {
  const SplatCloud& inner = tree_->nodes;
  const SplatCloud& leaves = *leaves_;
  SplatCloud out;
  out.sh_degree = leaves.sh_degree;
  out.colour_space = leaves.colour_space;
  out.antialias = leaves.antialias;
  out.frame = leaves.frame;
  out.resize(ids.size());
  const size_t inner_count = inner.size();
  copyRows(inner.positions, leaves.positions, 3, inner_count, ids, out.positions);
  copyRows(inner.rotations, leaves.rotations, 4, inner_count, ids, out.rotations);
  copyRows(inner.scales, leaves.scales, 3, inner_count, ids, out.scales);
  copyRows(inner.opacities, leaves.opacities, 1, inner_count, ids, out.opacities);
  copyRows(inner.sh, leaves.sh, leaves.shStride(), inner_count, ids, out.sh);
  return out;
}

std::vector<uint32_t> HierarchyDecoder::heirs(uint32_t first, uint32_t end) const {
  const size_t inner_count = tree_->nodes.size();
  const auto weightOf = [&](size_t id) {
    const SplatCloud& cloud = id < inner_count ? tree_->nodes : *leaves_;
    const size_t row = id < inner_count ? id : id - inner_count;
    const float* s = &cloud.scales[row * 3];
    return cloud.opacities[row] * std::max({s[0] * s[1], s[1] * s[2], s[2] * s[0]});
  };
  std::vector<uint32_t> heirs(end - first, TreeShape::kNoParent);
  for (size_t id = first; id < tree_->parents.size(); ++id) {
    const uint32_t parent = tree_->parents[id];
    if (parent < first || parent >= end) continue;
    uint32_t& heir = heirs[parent - first];
    if (heir == TreeShape::kNoParent || weightOf(id) > weightOf(heir)) {
      heir = static_cast<uint32_t>(id);
    }
  }
  return heirs;
}

SplatCloud HierarchyDecoder::decodeSmooth(const DecodeRequest& request) const {
  requireOneEach(request);
  if (request.budget == leaves_->size()) return decode(request);
  // Node s is split by the budget s + 2, and begins to kSplitOctaves before it.
  const double budget = static_cast<double>(request.budget);
  const double ahead = std::min(std::ceil(budget * std::exp2(kSplitOctaves)) - 1,
                                static_cast<double>(leaves_->size()));
  const std::vector<uint32_t> ids = cut(std::max(static_cast<uint64_t>(ahead), request.budget));
  const auto first = static_cast<uint32_t>(request.budget - 1);
  const std::vector<uint32_t> heir = heirs(first, static_cast<uint32_t>(ids.size() - 1));
  // Each from the node above it that shows at the budget.
  const auto isWhole = [&](uint32_t id) {
    return tree_->parents[id] == TreeShape::kNoParent || tree_->parents[id] < first;
  };
  std::vector<uint32_t> tops(ids);
  for (uint32_t& id : tops) {
    while (!isWhole(id)) id = tree_->parents[id];
  }
  SplatCloud out = rowsOf(tops);
  const size_t inner_count = tree_->nodes.size();
  parallelFor(ids.size(), kGrain, [&](size_t begin, size_t end) {
    std::vector<uint32_t> way;
    for (size_t i = begin; i < end; ++i) {
      way.clear();
      for (uint32_t id = ids[i]; id != tops[i]; id = tree_->parents[id]) way.push_back(id);
      for (; !way.empty(); way.pop_back()) {
        const uint32_t id = way.back(), parent = tree_->parents[id];
        const double along = 1 + std::log2(budget / (parent + 2.0)) / kSplitOctaves;
        const bool is_leaf = id >= inner_count;
        putGrown(out, i, is_leaf ? *leaves_ : tree_->nodes, is_leaf ? id - inner_count : id,
                 heir[parent - first] == id, along, out, i);
      }
    }
  });
  return out;
}

uint64_t HierarchyDecoder::memoryBound(uint64_t anchor_count, uint32_t) const {
  // Splats and the ids of their nodes, and what allocators round up.
  constexpr uint64_t kRounding = uint64_t{64} << 10;
  return anchor_count * (4 * (11 + leaves_->shStride()) + sizeof(uint32_t)) + kRounding;
}

}  // namespace stipple
