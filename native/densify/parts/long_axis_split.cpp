// Based on: Deng, Diao, Li, Yu, Xu, Improving Densification in 3D Gaussian Splatting for
// High-Fidelity Rendering, arXiv 2508.12313, section 3.2, with the constants of its published
// program. Differs: a scale never falls below the least that splats can have.

#include "densify/parts/long_axis_split.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "densify/quantities/opacity_forms.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

class LongAxisSplit final : public ControlPart {
 public:
  explicit LongAxisSplit(const LongAxisSplitOptions& options)
      : options_(options),
        log_long_(std::log(options.long_scale)),
        log_minor_(std::log(options.minor_scale)) {}

  const char* name() const override { return "long_axis_split"; }
  ControlRoles owns() const override {
    return roles(ControlRole::kChildren, ControlRole::kChildOpacity);
  }

  RawSplats children(const ControlMoment&, const RawSplats& splats,
                     std::span<Candidate> chosen) override {
    std::vector<uint32_t> parents;
    parents.reserve(2 * chosen.size());
    for (Candidate& one : chosen) {
      one.replaces = true;
      parents.insert(parents.end(), 2, one.row);
    }
    RawSplats children = rowsOf(splats, parents);
    for (size_t row = 0; row < children.size(); ++row) {
      place(row, row % 2 == 0 ? 1.0 : -1.0, children);
    }
    return children;
  }

 private:
  /// In: row: a copy of its parent.
  void place(size_t row, double side, RawSplats& children) const {
    float* log_scales = &children.log_scales[row * 3];
    const Eigen::Index longest = std::max_element(log_scales, log_scales + 3) - log_scales;
    const double scale = static_cast<double>(activatedScale(log_scales[longest]));
    const Mat3d turn = rotationFromQuaternion<double>(&children.rotations[row * 4]);
    const Vec3d offset = side * options_.offset * scale * turn.col(longest);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      float& position = children.positions[row * 3 + static_cast<size_t>(axis)];
      const double place = static_cast<double>(position) + offset[axis];
      // A splat as large as the numbers are has no room beside it.
      if (std::abs(place) < static_cast<double>(std::numeric_limits<float>::max())) {
        position = static_cast<float>(place);
      }
      const double log_scale =
          static_cast<double>(log_scales[axis]) + (axis == longest ? log_long_ : log_minor_);
      log_scales[axis] = std::max(static_cast<float>(log_scale), rawScale(0.0f));
    }
    float& logit = children.logits[row];
    logit = scaledOpacityLogit(logit, options_.opacity);
  }

  LongAxisSplitOptions options_;
  double log_long_, log_minor_;
};

}  // namespace

std::unique_ptr<ControlPart> makeLongAxisSplit(const LongAxisSplitOptions& options) {
  return std::make_unique<LongAxisSplit>(options);
}

}  // namespace stipple
