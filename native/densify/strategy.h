#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "data/clouds/splat_quantities.h"
#include "data/tensor_table.h"
#include "densify/raw_splats.h"
#include "densify/splat_edit.h"
#include "densify/statistic.h"
#include "math/camera.h"
#include "math/vec.h"

namespace stipple {

/// The view that an iteration learns from.
struct TrainingView {
  size_t index = 0;  ///< as ViewEvaluator counts them
  uint32_t width = 0;
  uint32_t height = 0;
  std::span<const float> target;  ///< [H,W,3] over the background of the iteration
};

/// Density control of a cloud that is there, without steps (train/loop/densify_cloud.h).
struct StandaloneEvent {
  uint64_t index = 0;
  uint64_t count = 1;
  bool is_now = false;      ///< else its statistics are being gathered
  uint64_t looks_left = 0;  ///< at views, before it
};

/// Where a fit stands.
struct FitMoment {
  uint64_t iteration = 1;        ///< 1 for the first
  uint64_t iterations = 30000;   ///< of the whole fit
  double extent = 1;             ///< of the cameras: 1.1 times the largest distance from their mean
  Vec3d centre = Vec3d::Zero();  ///< mean place of the cameras, metres
  uint64_t seed = 0;             ///< of the fit; numbers are keyed by (seed, use, iteration, row)
  uint64_t max_splats = 0;       ///< hard cap of the count; 0: none
  double position_rate = 0;      ///< of Adam in this iteration, metres
  size_t view_count = 0;         ///< that are learned from; 0: not known
  double time = 0;               ///< seconds, of the view of this iteration; 0 where nothing moves
  const TrainingView* view = nullptr;  ///< of this iteration; nullptr where none is under way
  std::optional<StandaloneEvent> standalone = {};  ///< there is no fit
};

/// An iteration of a published schedule of 30,000 in a fit of another length: every window,
/// interval and event passes through here, and through nothing else. At least 1.
uint64_t scaleSchedule(uint64_t published, uint64_t iterations);

/// Numbers per splat that a strategy trains beside those of every fit: RawSplats::extras.
struct ExtraParameter {
  std::string name;
  size_t row_length = 1;
  double learning_rate = 0;
};

/// Of Adam, in the units of raw numbers. Positions: per metre of the cameras' extent, from the
/// first to the last iteration log-linearly.
struct LearningRates {
  double first_position = 1.6e-4;
  double last_position = 1.6e-6;
  double rotation = 1e-3;
  double log_scale = 5e-3;
  double logit = 0.05;
  double colour = 2.5e-3;
  double higher_colour = 2.5e-3 / 20;
};

/// How time is stretched about the moment of each splat that moves (motion/time_window.h).
struct TimeStretch {
  double frames = 0;   ///< of the window that gets more of the time; 0: time is not stretched
  double share = 0.7;  ///< of the whole range, that the window gets
};

/// Derivatives of splats by their stored values, shaped as SplatCloud is.
struct CloudGradient {
  std::span<float> positions;  ///< [N,3]
  std::span<float> rotations;  ///< [N,4]
  std::span<float> scales;     ///< [N,3]
  std::span<float> opacities;  ///< [N]
  std::span<float> sh;         ///< [N,(degree+1)^2,3]
};

/// How raw numbers and extra parameters become splats, where that is not exp, logistic and identity
/// (raw_splats.h). Harmonics are the same numbers raw and stored in every case: neither function
/// may touch them, and clouds and derivatives may come without them.
class Parameterisation {
 public:
  virtual ~Parameterisation() = default;
  /// Out: cloud, of as many splats, where the usual activation has already written.
  virtual void activate(const RawSplats& raw, SplatCloud& cloud) const = 0;
  /// In: derivatives by the stored values of the cloud, which it may change. Out: by_raw, where the
  /// usual derivatives stand already; it writes all those of its extras.
  virtual void adjoint(const RawSplats& raw, const SplatCloud& cloud, const CloudGradient& by_cloud,
                       RawSplats& by_raw) const = 0;
};

/// Splats as they are drawn (SplatCloud).
struct DrawnSplats {
  std::span<const float> positions;  ///< [N,3]
  std::span<const float> rotations;  ///< [N,4]
  std::span<const float> scales;     ///< [N,3]
  std::span<const float> opacities;  ///< [N]
  /// [N] the temporal scale that fades each splat at the time of the view, in stretched time, where
  /// StatisticRequest::lifespans asks for it; empty where splats do not move.
  std::span<const float> lifespans = {};
};

/// What one view told about the splats. Arrays live as long as the call.
struct ViewStatistics {
  size_t view = 0;
  uint32_t width = 0;   ///< pixels
  uint32_t height = 0;  ///< pixels
  const Camera* camera = nullptr;
  double loss = 0;  ///< of the picture against its target, without what regularises
  /// [N] 1 where the splat passed culling; what densification papers call visible.
  std::span<const uint8_t> visible;
  /// Of a statistic that was asked for; empty for the others.
  std::span<const float> of(Statistic statistic) const {
    return arrays[static_cast<size_t>(statistic)];
  }
  std::array<std::span<const float>, kStatisticCount> arrays;
  DrawnSplats splats;  ///< where StatisticRequest::drawn_splats asks for them
  ViewErrors errors;   ///< where StatisticRequest::error_maps asks for them
};

/// Draws views on demand, without a step.
class ViewEvaluator {
 public:
  virtual ~ViewEvaluator() = default;
  virtual size_t viewCount() const = 0;
  /// As they are drawn. Valid until the splats change.
  virtual const SplatCloud& splats() = 0;
  virtual const Camera& camera(size_t view) const = 0;
  /// [H,W,3] what the view should look like, over the background of evaluate().
  virtual std::vector<float> target(size_t view) = 0;
  /// [H,W,3] what it looks like now, over the same.
  virtual std::vector<float> picture(size_t view) = 0;
  /// Statistics of the current splats. Valid until the next call.
  virtual const ViewStatistics& evaluate(size_t view, const StatisticRequest& request) = 0;
};

/// Who holds splats, and copies them out where they are asked for. Valid until the splats change.
class SplatReader {
 public:
  virtual ~SplatReader() = default;
  virtual const RawSplats& splats() const = 0;
  virtual const RawSplats& firstMoments() const = 0;
  virtual const RawSplats& secondMoments() const = 0;
};

/// The splats as an edit may see them. They may lie in another processor's memory: their number is
/// always known, whatever else is asked for is copied.
class SplatStore {
 public:
  SplatStore(size_t count, const SplatReader& reader) : count_(count), reader_(&reader) {}
  /// Of arrays that are here, which must outlive this.
  SplatStore(const RawSplats& splats, const RawSplats& first_moments,
             const RawSplats& second_moments)
      : count_(splats.size()), here_{&splats, &first_moments, &second_moments} {}

  size_t size() const { return count_; }
  const RawSplats& splats() const { return reader_ ? reader_->splats() : *here_[0]; }
  const RawSplats& firstMoments() const { return reader_ ? reader_->firstMoments() : *here_[1]; }
  const RawSplats& secondMoments() const { return reader_ ? reader_->secondMoments() : *here_[2]; }

 private:
  size_t count_;
  const SplatReader* reader_ = nullptr;
  std::array<const RawSplats*, 3> here_{};
};

/// What happens in a fit, as whoever controls its splats hears of it: a whole strategy, and each of
/// the parts that it is a list of (control_part.h). Hooks are called in the order in which they
/// stand here; those that are not overridden do nothing. Moment: FitMoment of a strategy, and of a
/// part a ControlMoment, which knows the strategy's schedule.
template <typename Moment>
class FitHooks {
 public:
  virtual ~FitHooks() = default;

  /// As users write it: "adaptive", "long_axis_split".
  virtual const char* name() const = 0;

  // ---- once, before the first iteration --------------------------------------------------------
  /// Changes what a fit of so many iterations begins with (not the splats of a cloud that is
  /// densified), and how fast it learns.
  virtual void prepare(RawSplats&, uint64_t /*iterations*/) const {}
  virtual void adjustRates(LearningRates&) const {}
  /// Of splats that move. Of parts: kTime.
  virtual void adjustStretch(TimeStretch&) const {}
  /// The splats start with these, and the parameterisation stays. Of parts, the owner of
  /// kParameterisation is asked.
  virtual std::vector<ExtraParameter> parameters() const { return {}; }
  /// One array per parameter, [N, row length].
  virtual std::vector<std::vector<float>> initialExtras(const RawSplats&) const { return {}; }
  virtual const Parameterisation* parameterisation() const { return nullptr; }

  // ---- every iteration -------------------------------------------------------------------------
  /// What opacities are multiplied by in the image of this iteration, [N] >= 0; empty: nothing is.
  /// Of parts: kDropout.
  virtual std::vector<float> opacityFactors(const Moment&, size_t /*count*/) const { return {}; }
  /// Whether loss() has anything to add; where it has, stored values are copied out for it. Of
  /// parts: kRegularisation.
  virtual bool regularises(const Moment&) const { return false; }
  /// Value of a regulariser of the stored values; its derivative is added to `gradient`. Of parts:
  /// kRegularisation.
  virtual double loss(const Moment&, const SplatCloud&, const CloudGradient& /*gradient*/) {
    return 0;
  }
  /// Weight of the mean transmittance behind the last splat of each pixel, in the loss. Of parts:
  /// kRegularisation.
  virtual double transmittanceWeight(const Moment&) const { return 0; }
  /// After the backward pass, with the statistics asked for.
  virtual void observe(const Moment&, const ViewStatistics&) {}
  /// Whether Adam takes its step in this iteration; derivatives add up where it does not. Of parts:
  /// kSteps.
  virtual bool stepGate(const Moment&) const { return true; }
  /// After the step: small changes of numbers, as writes. Of parts: kNoise.
  virtual std::optional<SplatEdit> afterStep(const Moment&, const SplatStore&) { return {}; }
  /// Before an edit: looks at further views. Called where wantsSweep says so. It may change how the
  /// parameterisation makes splats.
  virtual bool wantsSweep(const Moment&) const { return false; }
  virtual void sweep(const Moment&, ViewEvaluator&) {}
};

/// Controls which splats there are while they are trained, as the trainer sees it: a list of parts
/// (makeDensityControl). A strategy sees statistics and answers with edits; it draws nothing, steps
/// nothing and knows nobody who does.
/// Determinism: a strategy's answers depend on its calls and on FitMoment::seed alone.
class Strategy : public FitHooks<FitMoment> {
 public:
  /// What this iteration's backward pass shall gather for observe().
  virtual StatisticRequest requests(const FitMoment&) const { return {}; }

  /// Whether the edit of this iteration lowers opacities, for them to come back.
  virtual bool lowersOpacitiesAt(const FitMoment&) const { return false; }
  /// Steps for which splats look like fog after the edit of this iteration; 0: they do not.
  virtual uint64_t foggyStepsAfter(const FitMoment&) const { return 0; }

  /// Which splats there shall be. The strategy's own arrays per splat follow its answer at once;
  /// whoever called applies it.
  virtual std::optional<SplatEdit> edit(const FitMoment&, const SplatStore&) { return {}; }

  /// Scores and ages of so many splats, for looking at; empty where it has none.
  virtual SplatQuantities seen(size_t /*splat_count*/) const { return {}; }

  /// What a checkpoint keeps, and takes back. Errors: kFormat for a table of another strategy.
  virtual TensorTable state() const { return {}; }
  virtual void restore(const TensorTable&) {}
};

}  // namespace stipple
