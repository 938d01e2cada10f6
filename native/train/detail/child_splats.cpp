// Based on: Nam et al., Generative Densification, CVPR 2025: residual attributes. Differs: children
// begin as parts of the splat that they come from, not in its place, and the network moves, scales
// and turns them in that splat's own axes and size, so that it is the same for small and large
// ones.
#include "train/detail/child_splats.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "densify/raw_splats.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 128;
/// Parts of a splat that are 0.4 deviations to both sides and 0.8 times as long look most like it
/// together, of opacities from 0.3 to 0.99 and of two, four and eight of them.
constexpr double kAside = 0.4, kShorter = 0.8;
/// How far the network moves a child of the first layer at most, in deviations, and scales it, in
/// natural logarithms and logits.
constexpr double kReach = 1, kMostScaling = 2, kMostFading = 6;
/// Parts of splats that are more opaque than that would hide too much beside the middle.
constexpr double kMostOpaque = 0.93;

/// Opacity of each of `children` parts that lie on each other and hide what one splat did.
double partOpacity(double opacity, size_t children) {
  return 1 - std::pow(1 - std::min(opacity, kMostOpaque), 1.0 / static_cast<double>(children));
}

int halvingsOf(size_t children) {
  int halvings = 0;
  while ((size_t{1} << halvings) < children) ++halvings;
  return halvings;
}

/// The part of a splat that child number `slot` begins as.
ChildSplats::Start partOf(const ChildSplats::Start& whole, size_t slot, size_t children,
                          const Vec3d& scales) {
  const int halvings = halvingsOf(children);
  // The longest axes as they are now; of equal ones the first.
  std::array<int, 3> order = {0, 1, 2};
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return whole.shrinks[a] * scales[a] > whole.shrinks[b] * scales[b];
  });
  ChildSplats::Start part = whole;
  for (int i = 0; i < halvings; ++i) {
    const int axis = order[static_cast<size_t>(i)];
    const double side = ((slot >> i) & 1) != 0 ? -kAside : kAside;
    part.offset[axis] += side * whole.shrinks[axis];
    part.shrinks[axis] *= kShorter;
  }
  if (children > 1) part.opacity = partOpacity(whole.opacity, children);
  return part;
}

/// most tanh(value / most), near 0 the value itself.
double bounded(float value, double most) {
  return most * std::tanh(static_cast<double>(value) / most);
}
double boundedSlope(float value, double most) {
  const double tangent = std::tanh(static_cast<double>(value) / most);
  return 1 - tangent * tangent;
}

Vec4d product(const Vec4d& a, const Vec4d& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// The turn of a child in the axes of its splat, before it is made unit: never 0, as the first
/// number is held above it.
Vec4d turnOf(const float* said) {
  return {1 + 0.9 * std::tanh(static_cast<double>(said[0])), static_cast<double>(said[1]),
          static_cast<double>(said[2]), static_cast<double>(said[3])};
}

}  // namespace

bool isChildCount(size_t children) {
  return children == 1 || children == 2 || children == 4 || children == 8;
}

ChildSplats::ChildSplats(const SplatCloud& coarse, const CoarseEvidence& evidence,
                         std::span<const size_t> children, const DetailNetwork::Tape& tape)
    : coarse_(coarse), evidence_(evidence) {
  std::vector<Start> now;
  for (uint32_t i = 0; i < evidence.points.size(); ++i) {
    splats_.push_back(orderedSplat(coarse, evidence.points[i]));
    Start start;
    start.point = i;
    start.opacity = static_cast<double>(coarse.opacities[evidence.points[i]]);
    now.push_back(start);
  }
  std::vector<uint8_t> becomes(coarse.size(), 0);
  for (const uint32_t point : evidence.points) becomes[point] = 1;
  for (uint32_t n = 0; n < coarse.size(); ++n) {
    if (becomes[n] == 0) stays_.push_back(n);
  }
  for (size_t l = 0; l < tape.size(); ++l) {
    std::vector<Start> on;
    for (size_t i = 0; i < now.size() * children[l]; ++i) {
      const Start& whole = now[i / children[l]];
      const Start part = partOf(whole, i % children[l], children[l], splats_[whole.point].scales);
      (tape[l].goes_on[i] != 0 ? on : starts_).push_back(part);
    }
    now = std::move(on);
  }
}

SplatCloud ChildSplats::apply(std::span<const DetailNetwork::Leaves> leaves) const {
  SplatCloud fine;
  fine.sh_degree = coarse_.sh_degree;
  fine.colour_space = coarse_.colour_space;
  fine.antialias = coarse_.antialias;
  fine.frame = coarse_.frame;
  const size_t stays = stays_.size(), stride = coarse_.shStride();
  fine.resize(stays + starts_.size());
  const auto copy = [&](size_t from, size_t to) {
    std::copy_n(&coarse_.positions[from * 3], 3, &fine.positions[to * 3]);
    std::copy_n(&coarse_.rotations[from * 4], 4, &fine.rotations[to * 4]);
    std::copy_n(&coarse_.scales[from * 3], 3, &fine.scales[to * 3]);
    fine.opacities[to] = coarse_.opacities[from];
    std::copy_n(&coarse_.sh[from * stride], stride, &fine.sh[to * stride]);
  };
  for (size_t i = 0; i < stays; ++i) copy(stays_[i], i);
  size_t first = 0;
  for (const DetailNetwork::Leaves& layer : leaves) {
    const size_t count = layer.points.size() / 3;
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const Start& start = starts_[first + i];
        const OrderedSplat& splat = splats_[start.point];
        const size_t from = evidence_.points[start.point], to = stays + first + i;
        const float* const said = &layer.attributes[i * kChildNumbers];
        copy(from, to);
        Vec3d offset = start.offset;
        for (int axis = 0; axis < 3; ++axis) {
          const auto k = static_cast<size_t>(axis);
          const double moved = static_cast<double>(layer.points[i * 3 + k]) -
                               static_cast<double>(evidence_.places[start.point * 3 + k]);
          offset[axis] += kReach * 2 / evidence_.side * moved;
          fine.scales[to * 3 + k] =
              static_cast<float>(splat.scales[axis] * start.shrinks[axis] *
                                 std::exp(bounded(said[4 + k], kMostScaling)));
          fine.sh[to * stride + k] += said[k];
        }
        const Vec3d place = splat.axes * offset.cwiseProduct(splat.scales);
        for (int axis = 0; axis < 3; ++axis) {
          fine.positions[to * 3 + static_cast<size_t>(axis)] += static_cast<float>(place[axis]);
        }
        const float logit = rawOpacity(static_cast<float>(start.opacity));
        fine.opacities[to] =
            activatedOpacity(logit + static_cast<float>(bounded(said[3], kMostFading)));
        const Vec4d turn =
            product(quaternionFromRotation(splat.axes), turnOf(said + 7).normalized());
        for (int k = 0; k < 4; ++k) {
          fine.rotations[to * 4 + static_cast<size_t>(k)] = static_cast<float>(turn[k]);
        }
      }
    });
    first += count;
  }
  return fine;
}

std::vector<DetailNetwork::Leaves> ChildSplats::backward(
    std::span<const DetailNetwork::Leaves> leaves, const SplatCloud& fine,
    const SplatCloud& by_fine) const {
  std::vector<DetailNetwork::Leaves> by(leaves.size());
  const size_t stride = coarse_.shStride();
  size_t first = 0;
  for (size_t l = 0; l < leaves.size(); ++l) {
    const size_t count = leaves[l].points.size() / 3;
    by[l].points.resize(count * 3);
    by[l].attributes.resize(count * kChildNumbers);
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const OrderedSplat& splat = splats_[starts_[first + i].point];
        const size_t n = stays_.size() + first + i;
        const float* const said = &leaves[l].attributes[i * kChildNumbers];
        float* const to = &by[l].attributes[i * kChildNumbers];
        const Vec3d by_place(static_cast<double>(by_fine.positions[n * 3]),
                             static_cast<double>(by_fine.positions[n * 3 + 1]),
                             static_cast<double>(by_fine.positions[n * 3 + 2]));
        const Vec3d by_offset = (splat.axes.transpose() * by_place).cwiseProduct(splat.scales);
        for (int axis = 0; axis < 3; ++axis) {
          const auto k = static_cast<size_t>(axis);
          by[l].points[i * 3 + k] =
              static_cast<float>(kReach * 2 / evidence_.side * by_offset[axis]);
          to[k] = by_fine.sh[n * stride + k];
          to[4 + k] = static_cast<float>(static_cast<double>(by_fine.scales[n * 3 + k]) *
                                         static_cast<double>(fine.scales[n * 3 + k]) *
                                         boundedSlope(said[4 + k], kMostScaling));
        }
        const auto opacity = static_cast<double>(fine.opacities[n]);
        to[3] = static_cast<float>(static_cast<double>(by_fine.opacities[n]) * opacity *
                                   (1 - opacity) * boundedSlope(said[3], kMostFading));
        const Vec4d turn = turnOf(said + 7);
        const double length = turn.norm();
        Vec4d whole = quaternionFromRotation(splat.axes);
        whole.tail<3>() *= -1;  // the derivative goes back through its conjugate
        const float* const q = &by_fine.rotations[n * 4];
        const Vec4d by_unit =
            product(whole, Vec4d(static_cast<double>(q[0]), static_cast<double>(q[1]),
                                 static_cast<double>(q[2]), static_cast<double>(q[3])));
        const Vec4d unit = turn / length;
        const Vec4d by_turn = (by_unit - unit * unit.dot(by_unit)) / length;
        const double tangent = std::tanh(static_cast<double>(said[7]));
        to[7] = static_cast<float>(by_turn[0] * 0.9 * (1 - tangent * tangent));
        for (int k = 1; k < 4; ++k) to[7 + k] = static_cast<float>(by_turn[k]);
      }
    });
    first += count;
  }
  return by;
}

}  // namespace stipple
