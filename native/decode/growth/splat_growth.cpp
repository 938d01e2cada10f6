// Based on: Hoppe, Progressive Meshes, SIGGRAPH 1996 (geomorphs: what a finer level adds starts
// where the coarser one has it).
#include "decode/growth/splat_growth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nanoflann.hpp>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "math/cross_product.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;
constexpr uint32_t kNone = ~uint32_t{0};
/// How far on its way from its source a splat is when it appears.
constexpr double kBirth = 0.5;

/// Centres of splats as nanoflann reads them.
struct CentreRows {
  const std::vector<float>& centres;  ///< [N,3]

  size_t kdtree_get_point_count() const { return centres.size() / 3; }
  double kdtree_get_pt(size_t row, size_t axis) const {
    return static_cast<double>(centres[row * 3 + axis]);
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using CentreTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, CentreRows, double>,
                                        CentreRows, 3, uint32_t>;

/// The anchor of the smaller set that each of the larger one is, kNone for those that it lacks.
std::vector<uint32_t> sameAnchors(const AnchorSet& few, const AnchorSet& many) {
  std::vector<uint32_t> same(many.size(), kNone);
  size_t i = 0;
  for (size_t j = 0; j < many.size() && i < few.size(); ++j) {
    while (i < few.size() && few.leaves[i] < many.leaves[j]) ++i;
    if (i == few.size() || few.leaves[i] != many.leaves[j]) continue;
    const auto at = [](const AnchorSet& set, size_t k) { return &set.positions[k * 3]; };
    if (std::equal(at(few, i), at(few, i) + 3, at(many, j))) same[j] = static_cast<uint32_t>(i++);
  }
  return same;
}

/// For each axis of the second frame, that of the first which points most alike.
std::array<size_t, 3> alikeAxes(const Mat3d& alike) {
  static constexpr std::array<std::array<size_t, 3>, 6> kOrders = {
      {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};
  size_t best = 0;
  double most = -1;
  for (size_t k = 0; k < kOrders.size(); ++k) {
    double sum = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double dot =
          alike(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(kOrders[k][axis]));
      sum += dot * dot;
    }
    if (sum > most + 1e-9) {
      most = sum;
      best = k;
    }
  }
  return kOrders[best];
}

double between(double from, double to, double along) {
  return from + along * (to - from);
}

double lengthBetween(double from, double to, double along) {
  if (from <= 0 || to <= 0) return between(from, to, along);
  return std::exp(between(std::log(from), std::log(to), along));
}

/// Row `o` of `out`: rotation and scales of splat i of `many` on its way from splat s of `few`.
void putShape(const SplatCloud& few, size_t s, const SplatCloud& many, size_t i, double along,
              SplatCloud& out, size_t o) {
  const Mat3d from = rotationFromQuaternion<double>(&few.rotations[s * 4]);
  const Mat3d to = rotationFromQuaternion<double>(&many.rotations[i * 4]);
  const Vec3d lengths =
      Eigen::Map<const Vec3f>(&few.scales[s * 3]).cast<double>();  // `out` may be `few`
  const Mat3d alike = to.transpose() * from;
  const std::array<size_t, 3> order = alikeAxes(alike);
  Mat3d start;
  Eigen::Index weakest = 0;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const auto source = static_cast<Eigen::Index>(order[static_cast<size_t>(axis)]);
    const double dot = alike(axis, source);
    start.col(axis) = (dot < 0 ? -1.0 : 1.0) * from.col(source);
    const auto weakest_source = static_cast<Eigen::Index>(order[static_cast<size_t>(weakest)]);
    if (std::abs(dot) < std::abs(alike(weakest, weakest_source))) weakest = axis;
  }
  const Vec3d first_axis = start.col(0), second_axis = start.col(1), third_axis = start.col(2);
  if (crossProduct(first_axis, second_axis).dot(third_axis) < 0)
    start.col(weakest) = -start.col(weakest).eval();
  // A quarter of a turn apart at most, so that the mean of the quaternions has a length.
  Vec4d first = quaternionFromRotation(start);
  const Vec4d last = quaternionFromRotation(to);
  if (first.dot(last) < 0) first = -first;
  const Vec4d turned = (first + along * (last - first)).normalized();
  for (size_t k = 0; k < 4; ++k) {
    out.rotations[o * 4 + k] = static_cast<float>(turned[static_cast<Eigen::Index>(k)]);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    out.scales[o * 3 + axis] =
        static_cast<float>(lengthBetween(lengths[static_cast<Eigen::Index>(order[axis])],
                                         static_cast<double>(many.scales[i * 3 + axis]), along));
  }
}

void putRow(const std::vector<float>& few, size_t s, const std::vector<float>& many, size_t i,
            size_t stride, double along, std::vector<float>& out, size_t o) {
  for (size_t k = 0; k < stride; ++k) {
    out[o * stride + k] =
        static_cast<float>(between(static_cast<double>(few[s * stride + k]),
                                   static_cast<double>(many[i * stride + k]), along));
  }
}

}  // namespace

SplatGrowth growthOfAnchors(const AnchorSet& few, const SplatCloud& few_splats,
                            const AnchorSet& many, const SplatCloud& many_splats) {
  const size_t each = many.size() == 0 ? 1 : many_splats.size() / many.size();
  if (few.size() == 0 || few_splats.size() != few.size() * each ||
      many_splats.size() != many.size() * each) {
    fail(ErrorCode::kInvalidArgument, "budgets: the splats of " + std::to_string(few.size()) +
                                          " and " + std::to_string(many.size()) +
                                          " anchors are not as many for each anchor");
  }
  SplatGrowth growth;
  growth.sources.resize(many_splats.size());
  growth.stays.resize(many_splats.size());
  const std::vector<uint32_t> same = sameAnchors(few, many);
  const CentreRows rows{few_splats.positions};
  const CentreTree tree(3, rows, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  parallelFor(many_splats.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const uint32_t anchor = same[i / each];
      growth.stays[i] = anchor != kNone;
      if (anchor != kNone) {
        growth.sources[i] = static_cast<uint32_t>(anchor * each + i % each);
        continue;
      }
      double squared = 0;
      uint32_t nearest = 0;
      const size_t found = tree.knnSearch(&many_splats.positions[i * 3], 1, &nearest, &squared);
      growth.sources[i] = found == 1 ? nearest : 0;
    }
  });
  return growth;
}

void putGrown(const SplatCloud& few, size_t s, const SplatCloud& many, size_t i, bool stays,
              double along, SplatCloud& out, size_t o) {
  if (stays) {
    putShape(few, s, many, i, along, out, o);
    putRow(few.positions, s, many.positions, i, 3, along, out.positions, o);
    putRow(few.sh, s, many.sh, i, many.shStride(), along, out.sh, o);
    putRow(few.opacities, s, many.opacities, i, 1, along, out.opacities, o);
    return;
  }
  const double place = between(kBirth, 1, along);
  putShape(few, s, many, i, place, out, o);
  putRow(few.positions, s, many.positions, i, 3, place, out.positions, o);
  putRow(few.sh, s, many.sh, i, many.shStride(), place, out.sh, o);
  out.opacities[o] = static_cast<float>(along * static_cast<double>(many.opacities[i]));
}

SplatCloud grownSplats(const SplatCloud& few, const SplatCloud& many, const SplatGrowth& growth,
                       double along) {
  if (few.sh_degree != many.sh_degree || growth.sources.size() != many.size()) {
    fail(ErrorCode::kInvalidArgument, "budgets: splats of two budgets do not fit together");
  }
  SplatCloud out = many;
  if (along >= 1) return out;
  parallelFor(many.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      putGrown(few, growth.sources[i], many, i, growth.stays[i], along, out, i);
    }
  });
  return out;
}

}  // namespace stipple
