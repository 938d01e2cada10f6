// Based on: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting for Real-Time Radiance
// Field Rendering, SIGGRAPH 2023, section 5.2. Differs: what is far from the cameras may be larger.

#include "densify/parts/faint_removal.h"

#include "densify/parts/clone_or_split.h"

namespace stipple {

namespace {

class FaintRemoval final : public ControlPart {
 public:
  explicit FaintRemoval(const FaintRemovalOptions& options) : options_(options) {}

  const char* name() const override { return "faint_removal"; }
  ControlRoles owns() const override { return roles(ControlRole::kRemoval); }

  bool removesAt(const ControlMoment& moment) const override {
    return isEarly(moment) ||
           (moment.is_event &&
            (options_.until == 0 ||
             moment.iteration < scaleSchedule(options_.until, moment.iterations)));
  }

  void remove(const ControlMoment& moment, const RawSplats& splats, const RawSplats& appended,
              std::span<uint8_t> goes, std::span<uint8_t> appended_goes) override {
    judge(moment, splats, goes);
    judge(moment, appended, appended_goes);
  }

 private:
  bool isEarly(const ControlMoment& moment) const {
    return options_.early_at > 0 && moment.isAt(options_.early_at);
  }

  void judge(const ControlMoment& moment, const RawSplats& splats, std::span<uint8_t> goes) const {
    const double least = isEarly(moment) ? options_.early_opacity : options_.least_opacity;
    const float least_logit = rawOpacity(static_cast<float>(least));
    // Of a finished cloud huge splats are its sky: without steps nothing takes their place.
    const bool judges_size =
        options_.largest_share > 0 && moment.takes_steps && moment.isAfter(options_.size_after);
    const float huge =
        judges_size ? logShareOfExtent(moment, options_.largest_share) : kLargestLogScale;
    for (size_t i = 0; i < goes.size(); ++i) {
      if (splats.logits[i] < least_logit) goes[i] = 1;
      const float size = largestLogScale(splats, i);
      // Few splats come to the second comparison.
      if (size > huge && !isFarEnoughFor(size, moment, &splats.positions[i * 3])) goes[i] = 1;
    }
  }

  /// Whether a splat is at most largest_share of its distance from the cameras' centre in size.
  bool isFarEnoughFor(float log_size, const FitMoment& moment, const float* position) const {
    const Vec3d place = Eigen::Map<const Vec3f>(position).cast<double>();
    return static_cast<double>(activatedScale(log_size)) <=
           options_.largest_share * (place - moment.centre).norm();
  }

  FaintRemovalOptions options_;
};

}  // namespace

std::unique_ptr<ControlPart> makeFaintRemoval(const FaintRemovalOptions& options) {
  return std::make_unique<FaintRemoval>(options);
}

}  // namespace stipple
