#include "decode/tree/merge_leaves.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/tree/tree_shape.h"
#include "math/morton.h"
#include "mesh/cell_table.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 2048;
constexpr int kMortonLevel = 16;
constexpr float kLeastVisibility = 0.003f;

}  // namespace

std::vector<uint32_t> spatialOrder(const std::vector<float>& positions, const CloudExtent& extent) {
  const size_t count = positions.size() / 3;
  std::vector<uint64_t> codes(count);
  constexpr double kCells = double{1 << kMortonLevel};
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      uint32_t cell[3];
      for (size_t axis = 0; axis < 3; ++axis) {
        const double x =
            (static_cast<double>(positions[i * 3 + axis]) - extent.centre[axis]) / extent.radius;
        cell[axis] = static_cast<uint32_t>(std::clamp((x + 1) * 0.5 * kCells, 0.0, kCells - 1));
      }
      codes[i] = mortonEncode(cell[0], cell[1], cell[2]);
    }
  });
  return sortedOrder(codes, kMortonLevel * 3);
}

double countedVisibility(float visibility) {
  return static_cast<double>(std::max(visibility, kLeastVisibility));
}

SplatCloud emptyLike(const SplatCloud& cloud, size_t count) {
  SplatCloud out;
  out.sh_degree = cloud.sh_degree;
  out.colour_space = cloud.colour_space;
  out.antialias = cloud.antialias;
  out.frame = cloud.frame;
  out.resize(count);
  return out;
}

void gatherRows(SplatCloud& cloud, const std::vector<uint32_t>& from) {
  gatherRows(cloud.positions, 3, from);
  gatherRows(cloud.rotations, 4, from);
  gatherRows(cloud.scales, 3, from);
  gatherRows(cloud.opacities, 1, from);
  gatherRows(cloud.sh, cloud.shStride(), from);
}

void HarmonicRows::mix(const MergeIds& ids, double share_first) {
  const float* first = row(ids.first);
  const float* second = row(ids.second);
  float* out = &merged_.sh[(ids.merged - order_.size()) * stride_];
  for (size_t k = 0; k < stride_; ++k) {
    out[k] = static_cast<float>(share_first * static_cast<double>(first[k]) +
                                (1 - share_first) * static_cast<double>(second[k]));
  }
}

const float* HarmonicRows::row(uint32_t id) const {
  return id < order_.size() ? &leaves_.sh[order_[id] * stride_]
                            : &merged_.sh[(id - order_.size()) * stride_];
}

void requireFootprint(double footprint) {
  if (std::isfinite(footprint) && footprint >= 0) return;
  fail(ErrorCode::kInvalidArgument,
       "footprint is " + std::to_string(footprint) + " m; 0 (automatic) or more is allowed");
}

void requireNodesLike(const SplatCloud& nodes, const SplatCloud& leaves, const char* what) {
  const std::string name(what);
  if (nodes.size() != leaves.size() - 1) {
    fail(ErrorCode::kInvalidArgument, name + " has " + std::to_string(nodes.size()) +
                                          " inner nodes; a tree over " +
                                          std::to_string(leaves.size()) + " splats has one fewer");
  }
  if (nodes.sh_degree != leaves.sh_degree) {
    fail(ErrorCode::kInvalidArgument,
         name + " has inner nodes of harmonic degree " + std::to_string(nodes.sh_degree) +
             "; that of the splats, " + std::to_string(leaves.sh_degree) + ", is needed");
  }
}

}  // namespace stipple
