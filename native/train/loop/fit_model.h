#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "data/tensor_table.h"
#include "data/views/view_source.h"
#include "densify/strategy.h"
#include "train/optimiser/image_loss.h"

namespace stipple {

class FitViewEvaluator;

/// Where the seconds of one iteration went.
struct StepSeconds {
  double render = 0;
  double backward = 0;  ///< with the loss
  double field = 0;     ///< network and density, both ways; 0 of explicit splats
  double optimiser = 0;
  double edit = 0;  ///< density control

  StepSeconds& operator+=(const StepSeconds& other);
};

struct StepReport {
  double loss = 0;
  double l1 = 0;
  double ssim = 1;
  uint64_t splat_count = 0;  ///< drawn in this step
  StepSeconds seconds;
  const char* stage =
      "";  ///< for the progress bar: "Density", "Attributes", "Joint", "Splats", "Anchors"
};

/// A view of the step: its picture is composited over the background already.
struct StepView {
  size_t index = 0;  ///< among the views that are learned from, as ViewEvaluator counts them
  const Camera* camera = nullptr;
  const float* target = nullptr;   ///< [H,W,3] in the compositing space
  const float* weights = nullptr;  ///< [H,W] or null: 1
  bool is_opaque = true;           ///< the view has no alpha: all of it is meant to be covered
  double background[3] = {0, 0, 0};
  double time = 0;  ///< seconds, when the picture was taken; 0 where nothing moves
};

/// What is trained: explicit splats, or the field of a learned density. The trainer chooses views,
/// keeps time, measures and saves; a model takes steps.
/// Determinism: the same calls give the same bits, for any number of threads.
class FitModel {
 public:
  virtual ~FitModel() = default;

  /// "explicit", "field", "motion", "scaffold" or "relay".
  virtual const char* name() const = 0;

  /// One iteration. views draws other views for strategies that sweep.
  virtual StepReport step(const FitMoment& moment, const StepView& view, ViewEvaluator* views,
                          Progress* progress) = 0;

  /// Whether the step of this moment ends with opacities lowered for what comes after: then the
  /// splats look like fog for some steps.
  virtual bool lowersOpacitiesAt(const FitMoment&) const { return false; }
  /// Steps for which they do after this moment's.
  virtual uint64_t foggyStepsAfter(const FitMoment&) const { return 0; }

  /// The view of an iteration, as ViewEvaluator counts them, of a model that learns from some views
  /// at a time; empty: the trainer's own order.
  virtual std::optional<size_t> viewAt(uint64_t /*iteration*/) const { return {}; }
  /// Whether the last state is the result, whatever earlier ones measured better: what is measured
  /// on the way shows how far the fit is, and chooses nothing.
  virtual bool isWholeAtItsEndOnly() const { return false; }

  /// The splats at a budget (of a field: its anchors); 0: all that there are, or the largest budget
  /// that was trained. A model of one size gives that, whatever is asked. Of splats that move: as
  /// they are when their clip begins.
  virtual SplatCloud splats(uint64_t budget) = 0;
  /// Whether they move, and the same at a time, seconds.
  virtual bool moves() const { return false; }
  virtual SplatCloud splatsAt(uint64_t budget, double /*seconds*/) { return splats(budget); }
  /// Budgets at which held-out views are worth measuring, ascending; one for a model of one size.
  virtual std::vector<uint64_t> budgets() const = 0;
  /// Scores and ages of splats(0), where density control has any.
  virtual SplatQuantities seen() const { return {}; }
  /// Entropy of the density, nats; not of models without one.
  virtual std::optional<double> densityEntropy() const { return {}; }

  /// Called once when all steps are taken, of the state that is the result, before its budgets are
  /// measured. views: draws splats(0).
  virtual void finish(FitViewEvaluator& /*views*/) {}

  /// Everything that goes on from here, bit for bit, needs. Errors of restore: kFormat.
  virtual TensorTable state() const = 0;
  virtual void restore(const TensorTable& state) = 0;
  virtual uint64_t memoryBytes() const = 0;  ///< held now, about
};

}  // namespace stipple
