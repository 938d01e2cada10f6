#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "base/progress.h"
#include "data/clouds/seen_cloud.h"
#include "data/fit_history.h"
#include "data/views/view_source.h"
#include "decode/tree/moving_tree.h"
#include "fit/fit_options.h"
#include "model/splat_model.h"
#include "train/backend/backend_factory.h"
#include "train/loop/trainer.h"

namespace stipple {

/// How a fit is doing, and what it has to say.
struct FitStatus {
  FitFigures figures;
  std::string stage;
  bool is_measured_on_training = false;  ///< too few views to hold any out
  uint64_t note_count = 0;
  uint64_t preview_iteration = 0;  ///< of the newest preview; 0: none yet
};

/// One fit, from its options to its result: it checks the views, makes the model, goes on from a
/// checkpoint or begins, runs the trainer, and keeps what others ask of it meanwhile. run() works
/// on one thread; all else may be called by others at any time.
class FitSession final : public FitObserver {
 public:
  /// Holds the options to their memory. Errors: those of requireFitOptions(), holdToMemory() and,
  /// of splats that move, clipOfViews(), and kInvalidArgument where a checkpoint would replace a
  /// file of another kind.
  /// In: start: splats that it begins with in place of its own, where it is not null. Errors of
  /// those: kInvalidArgument for another model than explicit splats that stand still, none, another
  /// colour space than the views have, and more than max_splats; kMemoryLimit for more than
  /// max_bytes has room for.
  FitSession(std::shared_ptr<const BackendFactory> backends,
             std::shared_ptr<const ViewSource> views, const FitOptions& options,
             std::shared_ptr<const SplatCloud> start = nullptr);

  /// About what run() allocates, bytes.
  uint64_t memoryBound() const;
  /// The same of a session that is not made. Errors: as the constructor.
  static uint64_t memoryBound(const ViewSource& views, const FitOptions& options);

  /// The whole work; at the end, splats that move get the tree of their budgets, unless that would
  /// take more memory than is allowed, or is cancelled. Errors: of views that nothing can be
  /// learned from, of a checkpoint that cannot be read or is of another fit, and those of
  /// Trainer::run().
  void run(Progress& progress);

  FitStatus status() const;
  /// The text lives as long as the session. Errors: kInvalidArgument for an index out of range.
  const char* noteAt(uint64_t index) const;
  /// The newest preview, and a request for another.
  SeenCloud takePreview();
  void watchContributions(bool wanted) { contributions_are_wanted_ = wanted; }
  /// The time that previews show of splats that move, seconds; before, that of the clip's begin.
  /// Errors: kInvalidArgument for a number that is not finite.
  void watchTime(double seconds);

  /// The result at a budget. May be called by several threads. This and what follows, errors:
  /// kInvalidArgument where the fit has not ended, or ended before its first step.
  SeenCloud decode(uint64_t budget) const;
  /// The result for any budget, or of splats that move for any time. Errors: kUnsupported for
  /// explicit splats that stand still.
  std::shared_ptr<const SplatModel> model() const;
  /// What the result was fitted with, as JSON.
  const std::string& settingsJson() const { return settings_json_; }
  /// JSON at the path and curves beside it, with the extension .svg. Errors: kIo.
  void saveReport(const std::string& path) const;
  const FitHistory& history() const { return ended().history(); }

  void figures(const FitFigures& figures) override;
  void note(const std::string& text) override;
  bool wantsPreview() override;
  bool wantsContributions() override { return contributions_are_wanted_; }
  std::optional<double> previewTime() override;
  void preview(SplatCloud cloud, SplatQuantities seen) override;
  void save(const TensorTable& table) override;

 private:
  std::unique_ptr<Trainer> prepared(Progress& progress);
  void noteCut();
  /// The tree of a finished fit of splats that move, so that their model has every budget at once.
  void mergeMoving(Progress& progress);
  std::shared_ptr<const SplatModel> relay() const;
  Trainer& ended() const;

  std::shared_ptr<const BackendFactory> backends_;
  std::shared_ptr<const ViewSource> views_;
  FitOptions options_;  ///< resolved, held to their memory
  std::shared_ptr<const SplatCloud> start_;
  FitViews split_;
  std::string settings_json_;
  std::unique_ptr<Trainer> trainer_;
  std::shared_ptr<const MovingTree> tree_;  ///< null: none was made

  mutable std::mutex decode_mutex_;  ///< models decode and are handed over one at a time
  mutable std::mutex mutex_;         ///< of what follows
  bool has_ended_ = false;
  FitFigures figures_;
  std::string stage_ = "Checking views";
  std::deque<std::string> notes_;  ///< texts stay where they are
  SeenCloud preview_;
  uint64_t preview_iteration_ = 0;
  std::atomic<bool> preview_is_wanted_{false};
  std::atomic<bool> contributions_are_wanted_{false};
  std::optional<double> preview_time_;  ///< seconds; empty: nobody has said
};

}  // namespace stipple
