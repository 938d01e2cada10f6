#include "decode/tree/hierarchy_decoder.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "base/parallel.h"

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
  if (request.gaussians_per_anchor != 1) {
    fail(ErrorCode::kInvalidArgument, "gaussians_per_anchor is " +
                                          std::to_string(request.gaussians_per_anchor) +
                                          "; 1 is allowed for splats that exist already");
  }
  if (request.budget == leaves_->size()) return *leaves_;
  const std::vector<uint32_t> ids = cut(request.budget);
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

SplatGrowth HierarchyDecoder::growth(uint64_t few, uint64_t many) const {
  const std::vector<uint32_t> upper = cut(few), lower = cut(many);
  const size_t inner_count = tree_->nodes.size();
  const auto weightOf = [&](uint32_t id) {
    const SplatCloud& cloud = id < inner_count ? tree_->nodes : *leaves_;
    const size_t row = id < inner_count ? id : id - inner_count;
    const float* s = &cloud.scales[row * 3];
    return cloud.opacities[row] * std::max({s[0] * s[1], s[1] * s[2], s[2] * s[0]});
  };
  // Rows of the smaller cut by node; nodes below it take that of their parent, which is numbered
  // before them.
  std::vector<uint32_t> rows(tree_->parents.size(), TreeShape::kNoParent);
  for (size_t i = 0; i < upper.size(); ++i) rows[upper[i]] = static_cast<uint32_t>(i);
  for (size_t id = 0; id < rows.size(); ++id) {
    const uint32_t parent = tree_->parents[id];
    if (rows[id] == TreeShape::kNoParent && parent != TreeShape::kNoParent) {
      rows[id] = rows[parent];
    }
  }
  SplatGrowth growth;
  growth.sources.resize(lower.size());
  growth.stays.assign(lower.size(), 0);
  std::vector<uint32_t> best(upper.size(), TreeShape::kNoParent);
  for (size_t i = 0; i < lower.size(); ++i) {
    const uint32_t row = rows[lower[i]];
    growth.sources[i] = row;
    if (best[row] == TreeShape::kNoParent || weightOf(lower[i]) > weightOf(lower[best[row]])) {
      best[row] = static_cast<uint32_t>(i);
    }
  }
  for (const uint32_t i : best) growth.stays[i] = 1;
  return growth;
}

uint64_t HierarchyDecoder::memoryBound(uint64_t anchor_count, uint32_t) const {
  // Splats and the ids of their nodes, and what allocators round up.
  constexpr uint64_t kRounding = uint64_t{64} << 10;
  return anchor_count * (4 * (11 + leaves_->shStride()) + sizeof(uint32_t)) + kRounding;
}

}  // namespace stipple
