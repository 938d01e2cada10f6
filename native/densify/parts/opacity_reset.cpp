// Based on: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting for Real-Time Radiance
// Field Rendering, SIGGRAPH 2023, section 5.2; soft limits: the program of Ye, Li, Liu, Dou, Zhang,
// Zhang, AbsGS, ACM MM 2024.

#include "densify/parts/opacity_reset.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stipple {

namespace {

class OpacityReset final : public ControlPart {
 public:
  explicit OpacityReset(const OpacityResetOptions& options) : options_(options) {}

  const char* name() const override { return "opacity_reset"; }
  ControlRoles owns() const override { return roles(ControlRole::kOpacity); }

  bool lowersAt(const ControlMoment& moment) const override {
    return moment.is_learning && (isSoftlyDue(moment) || isWhollyDue(moment));
  }
  void lowerOpacities(const ControlMoment& moment, const RawSplats& splats,
                      SplatEdit& edit) override {
    if (!moment.is_learning) return;
    if (isSoftlyDue(moment)) limitOpacities(splats, options_.soft_opacity, edit);
    if (isWhollyDue(moment)) limitOpacities(splats, options_.opacity, edit);
  }
  /// Until an opacity that has been limited is a half again, at most.
  uint64_t foggySteps(const ControlMoment& moment) const override {
    if (!moment.is_learning || !isWhollyDue(moment)) return 0;
    const double way = static_cast<double>(rawOpacity(0.5f)) -
                       static_cast<double>(rawOpacity(static_cast<float>(options_.opacity)));
    return static_cast<uint64_t>(std::max(0.0, std::ceil(way / LearningRates().logit)));
  }

 private:
  bool isSoftlyDue(const ControlMoment& moment) const {
    return options_.soft_interval > 0 && isDue(moment, options_.soft_interval, 1);
  }
  bool isWhollyDue(const ControlMoment& moment) const {
    return isDue(moment, options_.interval, options_.least_steps);
  }
  static bool isDue(const ControlMoment& moment, uint64_t published, uint64_t least_steps) {
    const uint64_t interval = scaleSchedule(published, moment.iterations);
    return interval >= least_steps && moment.iteration % interval == 0;
  }

  OpacityResetOptions options_;
};

}  // namespace

void limitOpacities(const RawSplats& splats, double opacity, SplatEdit& edit) {
  const float highest = rawOpacity(static_cast<float>(opacity));
  RowWrite write;
  write.array = RawArray::kLogits;
  write.clear_moments = true;
  write.rows.resize(splats.size());
  write.values.resize(splats.size());
  for (uint32_t i = 0; i < splats.size(); ++i) {
    write.rows[i] = i;
    write.values[i] = std::min(splats.logits[i], highest);
  }
  // What the same edit has written before is limited, not undone.
  for (const RowWrite& before : edit.writes) {
    if (before.array != RawArray::kLogits) continue;
    for (size_t k = 0; k < before.rows.size(); ++k) {
      write.values[before.rows[k]] = std::min(before.values[k], highest);
    }
  }
  edit.writes.push_back(std::move(write));
  for (float& logit : edit.append.logits) logit = std::min(logit, highest);
}

std::unique_ptr<ControlPart> makeOpacityReset(const OpacityResetOptions& options) {
  return std::make_unique<OpacityReset>(options);
}

}  // namespace stipple
