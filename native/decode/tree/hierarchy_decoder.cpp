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

uint64_t HierarchyDecoder::memoryBound(uint64_t anchor_count, uint32_t) const {
  // Splats and the ids of their nodes, and what allocators round up.
  constexpr uint64_t kRounding = uint64_t{64} << 10;
  return anchor_count * (4 * (11 + leaves_->shStride()) + sizeof(uint32_t)) + kRounding;
}

}  // namespace stipple
