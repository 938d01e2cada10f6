// Based on: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting for Real-Time Radiance
// Field Rendering, SIGGRAPH 2023, section 5.2.

#include "densify/parts/clone_or_split.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

constexpr double kFarthest = 1e38;  ///< metres; what would go further stays, and floats hold it

/// Three independent numbers of the standard normal distribution, for one child of a splat.
Vec3d childOffset(const FitMoment& moment, size_t row, uint64_t child) {
  const uint64_t seed = mixBits(moment.seed) ^ moment.iteration;
  const auto uniform = [&](uint64_t k) {
    return unitDouble(keyedBits(seed, RandomUse::kSplitOffset, (row * 2 + child) * 6 + k));
  };
  return {normalOf(uniform(0), uniform(1)), normalOf(uniform(2), uniform(3)),
          normalOf(uniform(4), uniform(5))};
}

class CloneOrSplit final : public ControlPart {
 public:
  explicit CloneOrSplit(const CloneOrSplitOptions& options)
      : shrink_(static_cast<float>(std::log(options.split_shrink))) {}

  const char* name() const override { return "clone_or_split"; }
  ControlRoles owns() const override { return roles(ControlRole::kChildren); }

  RawSplats children(const ControlMoment& moment, const RawSplats& splats,
                     std::span<Candidate> chosen) override {
    std::vector<uint32_t> parents, split;
    for (const Candidate& one : chosen) (one.replaces ? split : parents).push_back(one.row);
    const size_t copied = parents.size();
    for (int child = 0; child < 2; ++child) {
      parents.insert(parents.end(), split.begin(), split.end());
    }
    RawSplats children = rowsOf(splats, parents);
    for (size_t k = 0; k < 2 * split.size(); ++k) {
      const size_t row = copied + k;
      placeInDistribution(moment, split[k % split.size()], k / split.size(), row, children);
      for (size_t axis = 0; axis < 3; ++axis) children.log_scales[row * 3 + axis] -= shrink_;
    }
    return children;
  }

 private:
  float shrink_;
};

}  // namespace

float largestLogScale(const RawSplats& splats, size_t row) {
  const float* s = &splats.log_scales[row * 3];
  return std::max(s[0], std::max(s[1], s[2]));
}

float logShareOfExtent(const FitMoment& moment, double share) {
  return moment.extent > 0 ? static_cast<float>(std::log(share * moment.extent)) : kLargestLogScale;
}

void placeInDistribution(const FitMoment& moment, uint32_t parent, uint64_t child, size_t row,
                         RawSplats& children) {
  const Mat3d turn = rotationFromQuaternion<double>(&children.rotations[row * 4]);
  Vec3d offset = childOffset(moment, parent, child);
  for (int axis = 0; axis < 3; ++axis) {
    const float log_scale = children.log_scales[row * 3 + static_cast<size_t>(axis)];
    offset[axis] *= static_cast<double>(activatedScale(log_scale));
  }
  const Vec3d moved = turn * offset;
  for (int axis = 0; axis < 3; ++axis) {
    float& position = children.positions[row * 3 + static_cast<size_t>(axis)];
    const double place = static_cast<double>(position) + moved[axis];
    if (std::abs(place) < kFarthest) position = static_cast<float>(place);
  }
}

std::unique_ptr<ControlPart> makeCloneOrSplit(const CloneOrSplitOptions& options) {
  return std::make_unique<CloneOrSplit>(options);
}

}  // namespace stipple
